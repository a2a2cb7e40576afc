"""Gear data from REXS files: examples/rexs holds a pair and a planetary set, written after the public specification."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from gearfmu.cli import outcome
from gearfmu.errors import SpecError
from gearfmu.geometry.shifts import sum_of_shifts
from gearfmu.rexs.reading import read_rexs
from gearfmu.rexs.stage import draft_from_rexs
from gearfmu.stagefile.proposals.new import write_drafted
from gearfmu.stagefile.stage import load_stage

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "rexs"
PAIR, SET = EXAMPLES / "fzg_c.rexs", EXAMPLES / "planetary54.rexs"


def changed(tmp_path: Path, source: Path, *edits: tuple[str, str]) -> Path:
    """The file with all matches of regular expressions replaced; every one must match."""
    text = source.read_text(encoding="utf-8")
    for pattern, new in edits:
        text, count = re.subn(pattern, new, text)
        assert count, pattern
    path = tmp_path / "changed.rexs"
    path.write_text(text, encoding="utf-8")
    return path


def attribute_of(component: str, name: str, value: str) -> tuple[str, str]:
    """An edit of one attribute of the component with this identifier."""
    return rf'(<component id="{component}" (?:(?!</component>).|\n)*?id="{name}" unit="[^"]*">)[^<]*', rf"\g<1>{value}"


def without(name: str) -> tuple[str, str]:
    """An edit that takes an attribute away everywhere."""
    return rf' *<attribute id="{name}".*</attribute>\n', ""


def stage_of(path: Path, tmp_path: Path, stage: str = ""):
    """The tables of a REXS file's stage, through its stage.toml."""
    draft = draft_from_rexs(path, stage)
    return load_stage(write_drafted("made", draft.tables, draft.marks, "a test", tmp_path)).written


def test_a_pair_is_the_one_whose_data_the_file_holds(tmp_path: Path) -> None:
    made, shipped = stage_of(PAIR, tmp_path), load_stage("fzg_c").written
    kept = {"backlash": made.pair.backlash}
    assert made.pair == shipped.pair.model_copy(update=kept) and made.pair.backlash == pytest.approx(9e-5)
    for own, other in zip(made.gears, shipped.gears, strict=True):
        kept = {"bearing": own.bearing, "body": own.body, "bore_coupling": "rigid", "tip_edge_radius": 2.25e-4}
        assert own == other.model_copy(update=kept)
        assert (own.bearing.stiffness, own.bearing.tilt) == (4e8, pytest.approx(2 * 2e8 * 0.04**2))
    assert made.torque_max == 535, "the larger one of two load cases, whatever its sign"
    assert made.speed_max == pytest.approx(227.3)


def test_a_set_is_the_one_whose_data_the_file_holds(tmp_path: Path) -> None:
    made, shipped = stage_of(SET, tmp_path), load_stage("planetary54").written
    assert made.set == shipped.set.model_copy(update={"backlash": made.set.backlash})
    for name in ("sun", "planet", "ring"):
        own, other = getattr(made, name), getattr(shipped, name)
        kept = {"body": own.body, "tip_relief": None, "tip_edge_radius": 1.25e-4}
        assert own == other.model_copy(update=kept), name
    assert made.carrier == shipped.carrier
    assert made.torque_max == 600 and made.speed_max == pytest.approx(78.54)


@pytest.mark.parametrize("path", [PAIR, SET], ids=["pair", "set"])
def test_every_value_says_where_it_is_from_and_every_attribute_is_used_or_listed(path: Path, tmp_path: Path) -> None:
    draft, model = draft_from_rexs(path), read_rexs(path)
    text = write_drafted("made", draft.tables, draft.marks, "a test", tmp_path).read_text(encoding="utf-8")
    values = [line for line in text.splitlines() if re.match(r"\w+ = ", line)][3:]
    assert len(values) > 60
    assert not [line for line in values if not re.search(r"; (REXS \w+|assumed)", line)]
    every = sum(len(place) for c in model.components.values() for place in (c.attributes, *c.cases))
    assert len(list(model.unread())) == every, "nothing is read before somebody asks"
    assert 0 < len(draft.unread) < 0.5 * every
    listed = {(entry.attribute, entry.value) for entry in draft.unread}
    assert ("tolerance_class_according_to_iso_1328_2013", "5") in listed
    assert not {"number_of_teeth", "center_distance", "normal_module"} & {name for name, _ in listed}


def test_the_verb_writes_stage_and_list(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert outcome(["new", "mine", "--rexs", str(PAIR)]) == 0
    printed = capsys.readouterr().out
    assert "pair.backlash" in printed and "rexs_unread.csv" in printed
    with (tmp_path / "mine" / "rexs_unread.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    oil = [row for row in rows if row["attribute"] == "viscosity_at_40_degree_celsius"]
    assert oil == [{"component": 'lubricant 43 "oil"', "attribute": oil[0]["attribute"], "value": "100",
                    "unit": "mm^2 / s"}]  # fmt: skip
    assert outcome(["new", "mine", "--rexs", str(PAIR)]) == 1, "an existing file is never touched"


def test_all_unfit_units_are_named_at_once(tmp_path: Path) -> None:
    path = changed(
        tmp_path, PAIR, (r'(id="face_width" unit=)"mm"', r'\1"deg"'), (r'(id="center_distance" unit=)"mm"', r'\1""')
    )
    with pytest.raises(SpecError) as error:
        draft_from_rexs(path)
    fields = {problem.field for problem in error.value.problems}
    assert {'cylindrical_gear 20 "pinion": face_width', 'cylindrical_stage 3 "test gears": center_distance'} <= fields
    assert "unit of another kind" in str(error.value) and "unit is missing" in str(error.value)


def test_units_of_a_file_are_kept_in_their_meaning(tmp_path: Path) -> None:
    path = changed(tmp_path, PAIR, (r'(id="center_distance" unit=)"mm">91.5', r'\1"mum">91500'), (r'"deg"', '"°"'))
    assert stage_of(path, tmp_path).pair == stage_of(PAIR, tmp_path / "b").pair


def test_missing_profile_shifts_follow_from_the_centre_distance(tmp_path: Path) -> None:
    made = stage_of(changed(tmp_path, PAIR, without("addendum_modification_coefficient")), tmp_path)
    assert sum(gear.profile_shift for gear in made.gears) == pytest.approx(0.1817 + 0.1715, abs=3e-5)
    assert abs(made.geometry.nominal_backlash) < 5e-9


def test_missing_tip_diameters_keep_the_tip_clearance(tmp_path: Path) -> None:
    made = stage_of(changed(tmp_path, PAIR, without("tip_diameter")), tmp_path)
    pair = made.geometry
    for own, other in (pair.gears, pair.gears[::-1]):
        assert pair.a - own.r_a - other.r_f == pytest.approx(0.25 * 4.5e-3, abs=1e-5)


def test_helical_pair_without_bearings_loads_and_tools(tmp_path: Path) -> None:
    """The wheel's hand is read, everything else is assumed; module and centre distance fit 25 degrees."""
    angle = r'("helix_angle_reference_diameter" unit="deg">)0(</attribute>\n *<attribute id="tip_diameter" unit="mm">)'
    diameters = (("82.46", 25, 90), ("118.36", -25, 128))
    edits = [(f"{angle}{old}", rf"\g<1>{hand}\g<2>{new}") for old, hand, new in diameters]
    path = changed(
        tmp_path, PAIR, *edits, (r'(id="center_distance" unit="mm">)91.5', r"\g<1>100.5"),
        without("radial_stiffness"), without("torque_around_u_axis"), without("rotational_speed"),
        without("tip_radius_factor"), without("density"),
    )  # fmt: skip
    made = stage_of(path, tmp_path)
    assert made.pair.helix_angle == pytest.approx(0.4363323130)
    assert made.gears[0].bearing.axial and made.gears[0].material.density == 7850
    d, u = 16 * 4.5e-3 / 0.9063077870, 1.5
    assert made.torque_max == pytest.approx(4e6 * 14e-3 * d**2 * u / (u + 1) / 2, rel=0.05)


@pytest.mark.parametrize("sign", [1, -1])
def test_either_sign_of_the_rings_profile_shift_is_understood(tmp_path: Path, sign: int) -> None:
    """ISO 21771 counts it positive inwards; the stage file outwards, as the centre distance of 45.2 mm tells."""
    alpha = 0.3490658503988659
    external = sum_of_shifts(2.5e-3, alpha, 0.0, 36, 45.2e-3)
    internal = external / 2 + sum_of_shifts(2.5e-3, alpha, 0.0, 36, 45.2e-3)
    shift = r'(id="addendum_modification_coefficient" unit="none">)0'
    path = changed(
        tmp_path, SET, (shift, rf"\g<1>{external / 2:.9f}"), without("tip_diameter"),
        (rf'(name="ring, \w+">(?:.|\n)*?"addendum_modification_coefficient" unit="none">){external / 2:.9f}',
         rf"\g<1>{sign * internal:.9f}"),
        (r'(id="center_distance" unit="mm">)45', r"\g<1>45.2"),
    )  # fmt: skip
    made = stage_of(path, tmp_path)
    assert made.ring.profile_shift == pytest.approx(internal, abs=1e-8)


DISTANCE = r'(id="center_distance" unit="mm">)[-\d.]+'
TEETH = r'(name="planet 2">\n *<attribute id="number_of_teeth" unit="none">)18'


@pytest.mark.parametrize(
    ("path", "pattern", "value", "why"),
    [
        (PAIR, DISTANCE, "-91.5", "-91.5 mm: must be above"),
        (PAIR, DISTANCE, "0", "0 mm: must"),
        (SET, DISTANCE, "0", "needs cylindrical_stage parts"),
        (SET, TEETH, "19", 'cylindrical_gear 120 "planet 2": differs'),
    ],
)
def test_numbers_that_no_stage_has_are_refused(tmp_path: Path, path: Path, pattern: str, value: str, why: str) -> None:
    with pytest.raises(SpecError, match=why):
        draft_from_rexs(changed(tmp_path, path, (pattern, rf"\g<1>{value}")))


def test_planets_that_are_not_equally_spaced_keep_their_places(tmp_path: Path) -> None:
    path = changed(tmp_path, SET, (r'("rotating_angle_around_neg_u_axis" unit="deg">)180', r"\g<1>185"))
    assert stage_of(path, tmp_path).set.positions == (0, 18, 37, 54)


def test_one_of_several_stages_is_asked_for(tmp_path: Path) -> None:
    second = '<component id="4" type="cylindrical_stage" name="second"/>\n    <component id="10"'
    path = changed(tmp_path, PAIR, (r'<component id="10"', second))
    with pytest.raises(SpecError, match='say which stage.*3 "test gears"; cylindrical_stage 4 "second"'):
        draft_from_rexs(path)
    assert draft_from_rexs(path, "3").tables == draft_from_rexs(path, "test gears").tables
    with pytest.raises(SpecError, match="two cylindrical_gear"):
        draft_from_rexs(path, "second")


def test_a_file_that_makes_no_stage_is_written_and_judged(tmp_path: Path, monkeypatch, capsys) -> None:
    path = changed(tmp_path, PAIR, (r'(id="tip_diameter" unit="mm">)82.46', r"\g<1>60"))
    monkeypatch.chdir(tmp_path)
    assert outcome(["new", "mine", "--rexs", str(path)]) == 1
    assert "no involute is left" in capsys.readouterr().err and (tmp_path / "mine" / "stage.toml").exists()


@pytest.mark.parametrize(
    ("text", "why"),
    [('{"model": {}}', "REXS in JSON"), ('{"model": ', "no valid JSON"), ("[1, 2]", "REXS in JSON"),
     ('{"model": {"version": "2.0"}}', "versions 1.0 to 1.7"), ("teeth = 17", "neither JSON nor"),
     ('<model version="2.0"/>', "versions 1.0 to 1.7"), ("<a/>", "root element"),
     ('<model version="1.4"/>', "no such stage|which stage|none")],
)  # fmt: skip
def test_what_is_no_rexs_file_is_refused(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "x.rexs"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError, match=why):
        draft_from_rexs(path)
