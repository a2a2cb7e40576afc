"""[stage.effects] of a scene reaches the kernel, through the FMU too, and stands in the summary."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearfmu import fmu
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import run_once, stage_model, summary
from gearfmu.scenefile.scene import SceneSpec, load_scene


def scene(**effects: bool) -> SceneSpec:
    """pair_loaded, 2 ms, with these effects."""
    short = {"duration": 2e-3, "settle": 0.0, "stage.level": "fast"}
    return load_scene("pair_loaded", short | {f"stage.effects.{name}": on for name, on in effects.items()})


def test_a_scene_switches_effects(tmp_path: Path) -> None:
    """Bearings off: no bore moves; through FMU and kernel alike."""
    held = scene(bearings=False, coast_flank=True)
    model = stage_model(held)
    traces = [
        run_once(held, source).trace
        for source in (Source(model), Source(model, fmu.export(model, tmp_path / "pair.fmu")))
    ]
    for trace in traces:
        assert np.all(trace["pinion.gear.y"] == 0) and np.all(trace["bearing.pinion.fy"] != 0)
        assert np.array_equal(trace["mesh.te"], traces[0]["mesh.te"])


def test_the_summary_says_what_was_off() -> None:
    held = scene(tip_contact=False, hertz=True)
    source = Source(stage_model(held))
    assert summary(held, source, run_once(held, source), None)["effects_off"] == ["tip_contact"]
