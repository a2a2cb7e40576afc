"""Gears reduced in processes of their own, and the memory that a reduction takes."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gearfmu.body import apart, body_needs, reduce_bodies, reduce_body
from gearfmu.body.layout import entries_of, value_of
from gearfmu.errors import MeshError
from gearfmu.reduction import memory
from gearfmu.reduction.carrier import carrier_need
from gearfmu.reduction.memory import Need, gear_need, whole_need
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage

FEW = {"modes": 21, "roll_points": 4, "width_functions": 2, "mesh.flank": 2, "mesh.thickness": 1, "mesh.root": 2}
FEW |= {"mesh.rim": 1, "mesh.width": 1}


def small(stage: str, gears: tuple[str, ...], more: dict[str, float] | None = None) -> Stage:
    """A shipped stage with gears of a second."""
    return load_stage(stage, {f"{gear}.body.{field}": n for gear in gears for field, n in FEW.items()} | (more or {}))


@pytest.fixture
def spec() -> Stage:
    return small("helical_demo", ("gears.pinion", "gears.wheel"))


def test_gears_side_by_side_are_those_made_one_after_the_other(
    spec: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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


def test_what_a_process_raises_is_raised_here(spec: Stage, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    with pytest.raises(OSError, match="file"):
        apart.reduce_apart_together([(spec, "pinion", tmp_path / "file" / "below" / "pinion.h5")])


def test_a_gear_that_does_not_fit_is_refused_with_the_counts_to_lower(
    spec: Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "meminfo"
    table.write_text("MemTotal: 8000000 kB\nMemAvailable:   100000 kB\n", encoding="ascii")
    monkeypatch.setattr(memory, "_MEMORY_TABLE", table)
    with pytest.raises(MeshError, match=r"pinion.*about 0\.2 GB.*0\.1 GB are free: lower .*flank = 2.*width = 1"):
        reduce_bodies(spec, tmp_path)
    monkeypatch.setattr(memory, "_MEMORY_TABLE", tmp_path / "none")
    memory.require_memory(Need(10**6, 1e15), "")  # a system that does not tell


def of_gear(nodes: int, cut: int, teeth: int) -> Need:
    """With 400 modes, 28 rolls and 5 width functions."""
    sector = SimpleNamespace(nodes=range(nodes), cut_minus=range(cut), cut_plus=range(cut), teeth=teeth)
    return gear_need(sector, SimpleNamespace(modes=400, roll_points=28, width_functions=5))


def of_carrier(scale: float) -> Need:
    return carrier_need(load_stage("planetary54", {"carrier.mesh.scale": scale}).by_file["carrier"])


def of_import(unknowns: int) -> Need:
    """A pinion of fzg_c with all its teeth, 60 modes, 48 loads a tooth."""
    return whole_need(unknowns, 60 + 3 * 48, 1)


@pytest.mark.parametrize(
    ("need", "measured"),
    [
        (of_gear(10571, 253, 31), 1.06e9), (of_gear(11603, 313, 73), 1.37e9),
        (of_carrier(1.0), 2.1e9), (of_carrier(0.5), 0.55e9), (of_carrier(0.3), 0.228e9),
        (of_import(17568), 0.39e9), (of_import(60816), 1.19e9),
    ],
)  # fmt: skip
def test_the_estimate_is_near_what_was_measured(need: Need, measured: float) -> None:
    """Peaks of processes that reduced one body (docs/decisions/bodies.md)."""
    assert need.memory == pytest.approx(measured, rel=0.25)


def test_a_carrier_that_does_not_fit_is_refused_with_the_counts_to_lower(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "available_memory", lambda: 1e9)
    with pytest.raises(MeshError, match=r"carrier.*about \d\.\d GB .*carrier\.mesh \(around = 4.*scale = 1\)"):
        reduce_body(load_stage("planetary54"), "carrier")


def test_every_body_of_a_stage_has_its_need_before_the_work(spec: Stage) -> None:
    assert set(body_needs(spec)) == {"pinion", "wheel"}
    assert set(body_needs(load_stage("planetary54"))) == {"sun", "planet", "ring", "carrier"}
    assert {"pinion1", "wheel1"} <= set(body_needs(load_stage("two_stage")))


@pytest.mark.full
def test_gears_of_a_set_are_made_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "_WORTH", 0)
    monkeypatch.setattr(apart.os, "cpu_count", lambda: 2)
    spec, told = small("planetary54", ("sun", "planet", "ring"), {"carrier.mesh.scale": 0.2}), list[str]()
    bodies = reduce_bodies(spec, tmp_path, progress=lambda text, share: told.append(text))
    assert [body.name for body in bodies] == ["sun", "planet", "ring", "carrier"]
    assert {text.split(":")[0] for text in told} == {"sun", "planet", "ring", "carrier"}
    again = reduce_body(spec, "planet")
    assert np.allclose(again.frequency, bodies[1].frequency, rtol=1e-9)
