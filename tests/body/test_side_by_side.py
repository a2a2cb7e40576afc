"""Gears reduced in processes of their own, and the memory that a reduction takes."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gearfmu.body import apart, body_needs, reduce_bodies, reduce_body
from gearfmu.body.layout import entries_of, value_of
from gearfmu.errors import MeshError
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction import memory
from gearfmu.reduction.carrier import carrier_need
from gearfmu.reduction.memory import Need, gear_need, whole_need
from gearfmu.stagefile.stage import load_stage

ROOT = Path(__file__).resolve().parents[2]
COUNTS = "modes = 21\nroll_points = 4\nwidth_functions = 2\n"
MESH = "flank = 2\nthickness = 1\nroot = 2\nrim = 1\nwidth = 1\n"


@pytest.fixture
def spec(tmp_path: Path) -> object:
    """The shipped helical pair on a mesh of a second."""
    base = f'base = "{ROOT / "reduced_models" / "helical_demo" / "stage.toml"}"\nname = "tiny"\n'
    gears = "".join(f"[gears.{g}.body]\n{COUNTS}[gears.{g}.body.mesh]\n{MESH}" for g in ("pinion", "wheel"))
    (tmp_path / "stage.toml").write_text(base + gears, encoding="utf-8")
    return load_stage(tmp_path / "stage.toml")


def test_gears_side_by_side_are_those_made_one_after_the_other(
    spec: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = reduce_bodies(spec, tmp_path / "alone")
    monkeypatch.setattr(apart, "_WORTH", 0)
    monkeypatch.setattr(apart.os, "cpu_count", lambda: 2)
    told: list[str] = []
    together = reduce_bodies(spec, tmp_path / "together", progress=lambda text, share: told.append(text))
    assert {text.split(":")[0] for text in told} == {"pinion", "wheel"}
    for one, other in zip(alone, together, strict=True):
        assert one.name == other.name and other.how.provenance["cpu_s"] > 0
        assert np.allclose(one.frequency, other.frequency, rtol=1e-9)
        for entry in entries_of(one):
            if "static" in entry.field:
                own = value_of(one, entry.field)
                assert np.abs(own - value_of(other, entry.field)).max() < 1e-9 * np.abs(own).max(), entry.path


def test_what_a_process_raises_is_raised_here(spec: object, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    with pytest.raises(OSError, match="file"):
        apart.reduce_apart_together([(spec, "pinion", tmp_path / "file" / "below" / "pinion.h5")])


def test_a_gear_that_does_not_fit_is_refused_with_the_counts_to_lower(
    spec: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "meminfo"
    table.write_text("MemTotal: 8000000 kB\nMemAvailable:   100000 kB\n", encoding="ascii")
    monkeypatch.setattr(memory, "_MEMORY_TABLE", table)
    with pytest.raises(MeshError, match=r"pinion.*about 0\.2 GB.*0\.1 GB are free: lower .*flank = 2.*width = 1"):
        reduce_bodies(spec, tmp_path)
    monkeypatch.setattr(memory, "_MEMORY_TABLE", tmp_path / "none")
    memory.require_memory(Need(10**6, 1e15), "")  # a system that does not tell


def test_the_estimate_is_near_what_was_measured() -> None:
    """Measured peaks of processes that reduced one gear: 0.25 GB of 4 818 unknowns a sector, 1.06 of 30 954, 1.37 of
    33 870 (docs/decisions/bodies.md)."""
    for nodes, cut, teeth, counts, measured in (
        (10571, 253, 31, (400, 28, 5), 1.06e9),
        (11603, 313, 73, (400, 28, 5), 1.37e9),
    ):
        sector = SimpleNamespace(nodes=range(nodes), cut_minus=range(cut), cut_plus=range(cut), teeth=teeth)
        modes, rolls, functions = counts
        body = SimpleNamespace(modes=modes, roll_points=rolls, width_functions=functions)
        assert gear_need(sector, body).memory == pytest.approx(measured, rel=0.25)


def test_a_finer_mesh_needs_more(spec: object) -> None:
    gear, geometry = spec.gears[0], spec.written.geometry.gears[0]  # type: ignore[attr-defined]
    needs = []
    for scale in (1.0, 2.0, 4.0):
        mesh = gear.body.mesh.model_copy(update={"scale": scale})
        needs.append(gear_need(gear_sector(geometry, gear.face_width, mesh), gear.body).memory)
    assert needs[0] < needs[1] < needs[2]


def test_the_estimate_of_carriers_is_near_what_was_measured() -> None:
    """Peaks of processes that reduced the carrier of planetary54 alone."""
    for scale, measured in ((1.0, 2.1e9), (0.5, 0.55e9), (0.3, 0.228e9)):
        need = carrier_need(load_stage("planetary54", {"carrier.mesh.scale": scale}).by_file["carrier"])
        assert need.memory == pytest.approx(measured, rel=0.25) and need.whole


def test_the_estimate_of_a_gear_with_all_its_teeth_is_near_what_was_measured() -> None:
    """An imported pinion of fzg_c, 60 modes, 48 loads a tooth: 0.39 GB of 17 568 unknowns, 1.19 of 60 816."""
    for unknowns, measured in ((17568, 0.39e9), (60816, 1.19e9)):
        assert whole_need(unknowns, 60 + 3 * 48, 1).memory == pytest.approx(measured, rel=0.25)


def test_a_carrier_that_does_not_fit_is_refused_with_the_counts_to_lower(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "available_memory", lambda: 1e9)
    with pytest.raises(MeshError, match=r"carrier.*about \d\.\d GB .*carrier\.mesh \(around = 4.*scale = 1\)"):
        reduce_body(load_stage("planetary54"), "carrier")


def test_every_body_of_a_stage_has_its_need_before_the_work(spec: object) -> None:
    assert set(body_needs(spec)) == {"pinion", "wheel"}
    assert set(body_needs(load_stage("planetary54"))) == {"sun", "planet", "ring", "carrier"}
    assert {"pinion1", "wheel1"} <= set(body_needs(load_stage("two_stage")))


@pytest.mark.full
def test_gears_of_a_set_are_made_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "_WORTH", 0)
    monkeypatch.setattr(apart.os, "cpu_count", lambda: 2)
    base = f'base = "{ROOT / "reduced_models" / "planetary54" / "stage.toml"}"\nname = "tiny"\n'
    gears = "".join(f"[{g}.body]\n{COUNTS}[{g}.body.mesh]\n{MESH}" for g in ("sun", "planet", "ring"))
    (tmp_path / "stage.toml").write_text(base + gears + "[carrier.mesh]\nscale = 0.2\n", encoding="utf-8")
    spec, told = load_stage(tmp_path / "stage.toml"), list[str]()
    bodies = reduce_bodies(spec, progress=lambda text, share: told.append(text))
    assert [body.name for body in bodies] == ["sun", "planet", "ring", "carrier"]
    assert {text.split(":")[0] for text in told} == {"sun", "planet", "ring", "carrier"}
    again = reduce_body(spec, "planet")
    assert np.allclose(again.frequency, bodies[1].frequency, rtol=1e-9)
