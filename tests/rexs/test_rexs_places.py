"""Values of a REXS file are those of the component they belong to: gears of different widths, shafts of several
sections, and fields that nobody filled in."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from test_rexs import PAIR, SET, attribute_of, changed, stage_of, without

from gearfmu.cli import outcome
from gearfmu.errors import SpecError
from gearfmu.rexs.reading import read_rexs
from gearfmu.rexs.stage import draft_from_rexs

SECTIONS = ((40, 26, 26, 0, 0), (40, 28, 34, 6, 10), (40, 38, 38, 12, 12))  # length, outer and inner begin and end, mm
ONE_PIECE = ((60, 30, 30, 0, 0), (60, 60, 60, 10, 18))


def sections(shaft: int, rows: tuple[tuple[float, ...], ...]) -> list[tuple[str, str]]:
    """Edits that give a shaft of the pair these sections one after the other instead of its only one."""
    old, parts, links, place = shaft + 1, "", "", 0.0
    names = ("length", "outer_diameter_begin", "outer_diameter_end", "inner_diameter_begin", "inner_diameter_end")
    for k, row in enumerate(rows):
        own = 100 * shaft + k
        values = zip(("u_coordinate_on_shaft", *names), (place, *row), strict=True)
        lines = "".join(f'<attribute id="{name}" unit="mm">{value}</attribute>' for name, value in values)
        parts += f'<component id="{own}" type="shaft_section" name="">{lines}</component>'
        links += f'<relation id="{own}" type="assembly"><ref role="assembly" id="{shaft}"/><ref id="{own}"/></relation>'
        place += row[0]
    return [
        (rf'<component id="{old}" (?:(?!</component>).|\n)*</component>', parts),
        (r"<relations>", f"<relations>{links}"),
    ]


def test_every_gear_has_its_own_width(tmp_path: Path) -> None:
    """Reading one body's width for both passed while both were 14 mm. The torque that is assumed counts the common
    width."""
    edits = (attribute_of("20", "face_width", "15"), attribute_of("21", "face_width", "12"))
    made = stage_of(changed(tmp_path, PAIR, *edits, without("torque_around_u_axis")), tmp_path)
    assert [gear.face_width for gear in made.gears] == [0.015, 0.012]
    common = stage_of(changed(tmp_path, PAIR, without("torque_around_u_axis")), tmp_path / "b")
    assert made.torque_max == pytest.approx(12 / 14 * common.torque_max, rel=0.1)


def test_every_gear_of_a_set_has_its_own_width(tmp_path: Path) -> None:
    draft = draft_from_rexs(SET)
    ids = {name: draft.marks[f"{name}.teeth"].split()[-1] for name in ("sun", "planet", "ring")}
    widths = {"sun": "31", "planet": "29", "ring": "33"}
    edits = [attribute_of(ids[name], "face_width", widths[name]) for name in ("sun", "ring")]
    edits += [attribute_of(planet, "face_width", "29") for planet in ("100", "110", "120", "130")]
    tables = draft_from_rexs(changed(tmp_path, SET, *edits)).tables
    assert {name: tables[name]["face_width"] for name in widths} == {name: f"{w} mm" for name, w in widths.items()}


@pytest.mark.parametrize(("at", "bore"), [("20", 26), ("50", 29.5), ("60", 31), ("80", 34), ("81", 38), ("90", 14)])
def test_the_bore_is_that_of_the_section_under_the_gear(tmp_path: Path, at: str, bore: float) -> None:
    """Of a shaft of three sections, the middle one a cone, and of a gear of one piece with its shaft. The first section
    served wherever the gear was, and the other gear's shaft is another."""
    edits = [*sections(10, ONE_PIECE if at == "90" else SECTIONS), attribute_of("20", "u_coordinate_on_shaft", at)]
    made = stage_of(changed(tmp_path, PAIR, *edits), tmp_path)
    assert [gear.bore_diameter for gear in made.gears] == [pytest.approx(1e-3 * bore), 0.040]


def test_shafts_keep_bores_round_and_edges_follow_the_module(tmp_path: Path) -> None:
    """As `gearfmu new` proposes them. Averaging bores made imported pairs 27 % too soft, and every tip edge was that of
    a module of 4.5 mm."""
    made = stage_of(PAIR, tmp_path)
    assert [gear.bore_coupling for gear in made.gears] == ["rigid", "rigid"]
    half = changed(tmp_path, SET, *((rf'(id="{name}" unit=)"mm"', r'\1"cm"') for name in LENGTHS))
    for name in ("sun", "planet", "ring"):
        small, large = draft_from_rexs(SET).tables[name], draft_from_rexs(half).tables[name]
        assert (small["tip_edge_radius"], large["tip_edge_radius"]) == ("0.125 mm", "1.25 mm")
    ports = draft_from_rexs(PAIR).tables["ports"]
    assert ports["pinion"]["k"] == "18000 N*m/rad", "535 N·m over 0.03 rad, rounded up"


LENGTHS = ("normal_module", "face_width", "center_distance", "tip_diameter")


@pytest.mark.parametrize("shown", ["1", "0", "0.001"])
def test_a_placeholder_for_a_tip_circle_is_computed(tmp_path: Path, shown: str) -> None:
    """Programs write 1 mm or 0 where nothing was filled in. The diameter is then that of a file without it, and a note
    says so."""
    for source, path in ((PAIR, "gears.pinion"), (SET, "ring")):
        component = draft_from_rexs(source).marks[f"{path}.tip_diameter"].split()[-1]
        filled = draft_from_rexs(changed(tmp_path, source, attribute_of(component, "tip_diameter", shown)))
        left_out = draft_from_rexs(changed(tmp_path, source, without("tip_diameter")))
        assert filled.at(f"{path}.tip_diameter") == left_out.at(f"{path}.tip_diameter")
        assert [note for note in filled.notes if f" {component} " in note and "placeholder" in note]


def test_other_placeholders_are_refused_or_left_aside(tmp_path: Path) -> None:
    zero = [attribute_of("20", name, "0") for name in ("face_width", "normal_module")]
    with pytest.raises(SpecError) as error:
        draft_from_rexs(changed(tmp_path, PAIR, *zero, attribute_of("21", "number_of_teeth", "0")))
    found = {problem.field: problem.remedy for problem in error.value.problems}
    assert len(found) == 3 and all("placeholder" in remedy for remedy in found.values())
    rigid = draft_from_rexs(changed(tmp_path, PAIR, attribute_of("41", "elastic_modulus", "2.1e8")))
    assert rigid.at("gears.pinion.material.youngs_modulus") == "206 GPa", "a shaft's rigid material is no gear's"
    nothing = [attribute_of("41", name, "0") for name in ("elastic_modulus", "poisson_ratio", "density")]
    nothing += [attribute_of("11", f"outer_diameter_{end}", "0") for end in ("begin", "end")]
    pinion = stage_of(changed(tmp_path, PAIR, *nothing), tmp_path).gears[0]
    assert (pinion.material.youngs_modulus, pinion.material.density) == (206e9, 7850)
    assert pinion.bore_diameter == pytest.approx(31e-3, rel=0.05), "half the root diameter"


def test_a_set_with_a_sun_of_seventeen_teeth_and_a_sharp_hob_is_valid(tmp_path: Path) -> None:
    """As design programs export it: no profile shift, a tool whose tip radius is 0.25 modules."""
    teeth = {"20": "17", "21": "-55", "100": "19", "110": "19", "120": "19", "130": "19"}
    edits = [attribute_of(component, "number_of_teeth", z) for component, z in teeth.items()]
    fillet = (r'(id="tip_radius_factor" unit="none">)[^<]*', r"\g<1>0.25")
    made = stage_of(changed(tmp_path, SET, *edits, fillet, without("tip_diameter")), tmp_path)
    assert (made.sun.teeth, made.planet.teeth, made.ring.teeth) == (17, 19, 55)
    assert made.sun.rack.fillet_radius == 0.25 and made.sun.profile_shift == 0


# ---- JSON: components, relations and load cases as in XML, written here after the public schema ----------------------
def in_json(source: Path) -> dict[str, Any]:
    """A file in XML as the tables of one in JSON: identifiers are integers, a value has its type as key."""
    root = ElementTree.parse(source).getroot()

    def attributes(element: ElementTree.Element) -> list[dict[str, Any]]:
        return [attribute(entry) for entry in element.iterfind("attribute")]

    def attribute(entry: ElementTree.Element) -> dict[str, Any]:
        try:
            value: dict[str, Any] = {"floating_point": float(entry.text or "")}
        except ValueError:
            value = {"string": entry.text}
        return {"id": entry.get("id"), "unit": entry.get("unit")} | value

    def component(element: ElementTree.Element) -> dict[str, Any]:
        own = {"id": int(element.get("id") or 0), "type": element.get("type"), "attributes": attributes(element)}
        return own | ({"name": element.get("name")} if element.get("name") else {})

    def relation(element: ElementTree.Element) -> dict[str, Any]:
        refs = [{"id": int(ref.get("id") or 0), "role": ref.get("role")} for ref in element.iterfind("ref")]
        return {"id": int(element.get("id") or 0), "type": element.get("type"), "refs": refs}

    cases = [
        {"id": k, "components": [component(element) for element in case.iter("component")]}
        for k, case in enumerate(root.iterfind("load_spectrum/load_case"))
    ]
    model = {
        "version": root.get("version"),
        "applicationId": "a test",
        "applicationVersion": "1",
        "date": "2026-01-01T00:00:00+00:00",
        "relations": [relation(element) for element in root.iterfind("relations/relation")],
        "components": [component(element) for element in root.iterfind("components/component")],
        "load_spectrum": {"id": 1, "load_cases": cases},
    }
    return {"model": model}


@pytest.mark.parametrize("source", [PAIR, SET], ids=["pair", "set"])
def test_json_and_xml_make_the_same_stage(tmp_path: Path, source: Path) -> None:
    path = tmp_path / "same.rexsj"
    path.write_text(json.dumps(in_json(source)), encoding="utf-8")
    one, other = draft_from_rexs(source), draft_from_rexs(path)
    assert other.marks == one.marks and len(other.unread) == len(one.unread)
    made, wanted = stage_of(path, tmp_path / "a"), stage_of(source, tmp_path / "b")
    assert made.model_copy(update={"source": wanted.source}) == wanted


def test_arrays_nothing_and_a_byte_order_mark(tmp_path: Path) -> None:
    tables = in_json(PAIR)
    del tables["model"]["load_spectrum"]
    tables["model"]["components"][0]["attributes"] = [
        {"id": "u_axis_vector", "unit": "mm", "floating_point_array": [0.0, 1.5, -2e-3]},
        {"id": "is_engaged", "unit": "none", "boolean": False},
        {"id": "matrix", "integer_matrix": [[1, 2], [3, 4]]},
        {"id": "empty", "unit": None},
    ]
    path = tmp_path / "x.json"
    path.write_text(json.dumps(tables), encoding="utf-8-sig", newline="\r\n")
    found = read_rexs(path).components["1"].attributes
    texts = {name: attribute.text for name, attribute in found.items()}
    assert texts == {"u_axis_vector": "0.0 1.5 -0.002", "is_engaged": "false", "matrix": "1 2 3 4", "empty": ""}


def test_an_archive_may_hold_json_and_the_verb_reads_it(tmp_path: Path, monkeypatch, capsys) -> None:
    with zipfile.ZipFile(tmp_path / "pair.rexsz", "w") as target:
        target.writestr("pair.rexsj", json.dumps(in_json(PAIR)))
    monkeypatch.chdir(tmp_path)
    assert outcome(["new", "mine", "--rexs", "pair.rexsz"]) == 0
    assert "gears.pinion.bore_coupling" in capsys.readouterr().out
