"""Planetary sets with bodies made elsewhere: planet, ring and carrier; our own meshes come back as the same bodies."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from decks import write_deck
from gears import write_matrices

from gearfmu import cli
from gearfmu.body import reduce_body
from gearfmu.body.sector import body_sector
from gearfmu.errors import MeshError, SpecError
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.femesh.mesh import FeMesh, rotated
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import carrier_geometry
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

BOLTS = ["PIN_A", "PIN_B", "PIN_C", "PIN_D"]
CARRIER = '[carrier.import]\nfile = "carrier.inp"\nlength = "1 mm"\nbore = "SHAFT"\n'
CARRIER += f"bolts = {BOLTS}\n".replace("'", '"')
PLANET = '[planet.import]\nfile = "planet.inp"\nlength = "1 mm"\nbore = "BORE"\n'


def stage(folder: Path, section: str = "") -> Stage:
    """planetary54 on coarse meshes, with import sections at its end."""
    text = find_stage("planetary54").read_text(encoding="utf-8")
    coarse = re.sub(r"(?m)^(\[(?:sun|planet|ring)\.body\.mesh\]|\[carrier\.mesh\])$", r"\1\nscale = 0.2", text)
    coarse = re.sub(r"(?m)^modes = \d+", "modes = 48", coarse)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "stage.toml").write_text(coarse + "\n" + section, encoding="utf-8")
    return load_stage(folder / "stage.toml")


@lru_cache(maxsize=1)
def carrier_parts() -> tuple[FeMesh, dict[str, np.ndarray]]:
    spec = load_stage("planetary54")
    sector = carrier_sector(
        carrier_geometry(spec.bodies["carrier"]), spec.written.carrier.mesh.model_copy(update={"scale": 0.2})
    )
    mesh = sector.full()
    sets = {name: sector.sector_nodes(k)[sector.sets["bolt"]] for k, name in enumerate(BOLTS)}
    return mesh, sets | {"SHAFT": mesh.sets["bore"]}


def carrier_deck(folder: Path, nodes: np.ndarray | None = None) -> Path:
    mesh, sets = carrier_parts()
    folder.mkdir(parents=True, exist_ok=True)
    points = 1e3 * (mesh.nodes if nodes is None else nodes)
    return write_deck(folder / "carrier.inp", points, {"hexahedron20": mesh.elements}, sets)


@pytest.mark.parametrize("ready", [False, True])
def test_our_own_carrier_comes_back_as_the_same_full_model(tmp_path: Path, ready: bool) -> None:
    carrier_deck(tmp_path)
    own = stage(tmp_path / "own")
    section = CARRIER
    if ready:
        write_matrices(tmp_path, carrier_parts()[0])
        section += 'stiffness = "k.npz"\nmass = "m.npz"\nforce_unit = "1e-3 N"\n'
    body, native = (carrier_full_order(spec.by_file["carrier"]) for spec in (stage(tmp_path, section), own))
    assert [(i.name, i.kind) for i in body.interfaces] == [(i.name, i.kind) for i in native.interfaces]
    assert body.ground == native.ground and body.length == native.length
    for one, other in zip(body.interfaces, native.interfaces, strict=True):
        assert np.allclose(one.point, other.point, atol=1e-9)
    for name in ("stiffness", "mass"):
        assert np.abs(getattr(body, name) - getattr(native, name)).max() < 1e-9 * getattr(native, name).max(), name
    assert np.abs(body.rows() - native.rows()).max() < 1e-9


RING = '[ring.import]\nfile = "ring.inp"\nlength = "1 mm"\n'


def toothed_deck(folder: Path, name: str, mesh: FeMesh, angle: float = 0.0) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    sets = {key.upper(): nodes for key, nodes in mesh.sets.items()}
    return write_deck(folder / f"{name}.inp", 1e3 * rotated(mesh.nodes, angle), {"hexahedron20": mesh.elements}, sets)


@pytest.mark.parametrize(
    ("name", "whole", "section"),
    [("planet", False, PLANET), ("ring", False, RING),
     pytest.param("ring", True, RING + 'rim = "RIM"\n', marks=pytest.mark.full)],
)  # fmt: skip
def test_an_imported_planet_or_ring_is_the_same_body(tmp_path: Path, name: str, whole: bool, section: str) -> None:
    """One sector, or the whole ring turned by an angle; rows, tables and the sensor on the rim."""
    own = stage(tmp_path / "own")
    sector = body_sector(own, name)
    toothed_deck(tmp_path, name, sector.full() if whole else sector, 0.02 if whole else 0.0)
    body, native = (reduce_body(spec, name) for spec in (stage(tmp_path, section), own))
    assert body.how.mesh["method"] == "cyclic" and body.modes == native.modes
    assert np.abs(body.frequency / native.frequency - 1).max() < (1e-8 if whole else 1e-9)
    for field in ("flank.static", "flank.node", "static", "mass", *["sensors.points"] * (name == "ring")):
        one, other = (attrgetter(field)(b) for b in (body, native))
        assert np.abs(one - other).max() < (1e-7 if name == "ring" else 1e-9) * np.abs(other).max(), field
    if name == "ring":
        assert body.flank.internal
        grams = [b.sensors.rows @ b.sensors.rows.T for b in (body, native)]  # the members of a pair may turn
        assert np.abs(grams[0] - grams[1]).max() < 1e-6 * np.abs(grams[1]).max()


def test_rings_by_the_mean_tooth_and_other_rings_are_refused(tmp_path: Path) -> None:
    own = stage(tmp_path / "own")
    sector = body_sector(own, "ring")
    whole = sector.full()
    used, cells = np.unique(whole.elements[1:], return_inverse=True)
    rim = np.flatnonzero(np.isin(used, whole.sets["rim"]))
    toothed_deck(tmp_path, "ring", FeMesh(whole.nodes[used], cells.reshape(-1, 20), {"rim": rim}))
    with pytest.raises(MeshError, match="sectors only"):
        reduce_body(stage(tmp_path, RING), "ring")
    toothed_deck(tmp_path, "ring", replace(sector, nodes=1.01 * sector.nodes))
    with pytest.raises(MeshError, match="not the gear of the stage file|no involute"):
        reduce_body(stage(tmp_path, RING), "ring")


def turned(angle: float) -> np.ndarray:
    return rotated(carrier_parts()[0].nodes, angle)


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        (lambda: turned(0.3), r"axis of 'PIN_A' \(bolt0\) .* at \(42.99, 13.3\) and \(45, .*'PIN_D' .* bolt 0 on \+x"),
        (lambda: turned(-np.pi / 2), r"'PIN_B' \(bolt1\) .* counter-clockwise"),
        (lambda: carrier_parts()[0].nodes + [0, 0, 0.03], r"'PIN_A' \(bolt0\) at z = .* not where the planet sits"),
        (lambda: carrier_parts()[0].nodes + [2e-3, 0, 0], r"'SHAFT' \(bore\)"),
        (lambda: 1e-3 * carrier_parts()[0].nodes, r"axis of 'PIN_A' .* at \(0.045, .*\) and \(45"),
        (lambda: carrier_parts()[0].nodes * [1, 1, -1], "inside out"),
    ],
    ids=["turned", "a quarter off", "too high", "off the axis", "wrong unit", "mirrored"],
)  # fmt: skip
def test_a_carrier_that_lies_elsewhere_is_refused(tmp_path: Path, nodes, message: str) -> None:
    carrier_deck(tmp_path, nodes())
    with pytest.raises(MeshError, match=message) as caught:
        carrier_full_order(stage(tmp_path, CARRIER).by_file["carrier"])
    assert str(tmp_path / "carrier.inp") in str(caught.value) and "\n" not in str(caught.value)


def test_what_the_file_says_is_checked_at_load(tmp_path: Path) -> None:
    """Missing files of several bodies in one list; a bolt without a set."""
    with pytest.raises(SpecError) as caught:
        stage(tmp_path, CARRIER.replace(', "PIN_D"', "") + PLANET + "[ring.import]\nfile = 'ring.inp'\n")
    fields = {problem.field for problem in caught.value.problems}
    assert {"ring.import.length", "ring.import.file", "carrier.import.file", "planet.import.file"} <= fields
    carrier_deck(tmp_path)
    with pytest.raises(SpecError, match="carrier.import.bolts = PIN_A, PIN_B, PIN_C: one node set for each of the 4"):
        stage(tmp_path, CARRIER.replace(', "PIN_D"', ""))


def test_the_verbs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """import checks and prints the section; frf keeps your mesh; mesh has no sector of it."""
    deck = carrier_deck(tmp_path)
    own = stage(tmp_path / "own")
    bolts = [word for name in BOLTS for word in ("--bolt", name)]
    call = ["import", str(deck), str(own.source), "carrier", "--length", "1 mm", "--bore", "SHAFT"]
    assert cli.outcome([*call, *bolts]) == 0
    assert f"bolts = {BOLTS}".replace("'", '"') in capsys.readouterr().out
    assert cli.outcome(call) == cli.USAGE_ERROR and "4 times --bolt" in capsys.readouterr().err
    ring = toothed_deck(tmp_path, "ring", body_sector(own, "ring"))
    call = ["import", str(ring), str(own.source), "ring", "--length", "1 mm", "--bore", "RIM"]
    assert cli.outcome(call) == 0
    assert '[ring.import]\nfile = "ring.inp"\nlength = "1 mm"\nrim = "RIM"' in capsys.readouterr().out
    stage(tmp_path, CARRIER)
    out = ["--out", str(tmp_path / "o")]
    assert cli.outcome(["frf", str(tmp_path), "carrier", "--scale", "0.5", *out]) == 1
    assert cli.outcome(["mesh", str(tmp_path), "--gear", "carrier", *out]) == 1
    assert "no sector" in capsys.readouterr().err and not (tmp_path / "o").exists()
