"""REXS in JSON: the same components, relations and load cases as in XML, written here after the public schema."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from test_rexs import PAIR, SET, stage_of

from gearfmu.cli import outcome
from gearfmu.rexs.reading import read_rexs
from gearfmu.rexs.stage import draft_from_rexs


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
