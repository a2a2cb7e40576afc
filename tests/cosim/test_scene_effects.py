"""[stage.effects] of a scene reaches the kernel, through the FMU too, and stands in the summary."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearfmu import fmu
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import run_once, stage_model, summary
from gearfmu.scenefile.scene import SHIPPED, SceneSpec, load_scene


def scene(folder: Path, effects: str) -> SceneSpec:
    """pair_loaded, 2 ms, with these lines in [stage.effects]."""
    text = (SHIPPED / "pair_loaded.toml").read_text(encoding="utf-8")
    (folder / "scene.toml").write_text(f"{text}\n[stage.effects]\n{effects}\n", encoding="utf-8")
    shipped = load_scene(folder / "scene.toml")
    if not effects:
        return shipped
    short = {"duration": 2e-3, "settle": 0.0, "stage": shipped.stage.model_copy(update={"level": "fast"})}
    return shipped.model_copy(update=short)


def test_a_scene_switches_effects(tmp_path: Path) -> None:
    """Bearings off: no bore moves; through FMU and kernel alike. Nothing named: the scene's hash stays."""
    held = scene(tmp_path, "bearings = false\ncoast_flank = true")
    model = stage_model(held)
    traces = [
        run_once(held, source).trace
        for source in (Source(model), Source(model, fmu.export(model, tmp_path / "pair.fmu")))
    ]
    for trace in traces:
        assert (
            np.all(trace["pinion.gear.y"] == 0)
            and np.all(trace["bearing.pinion.fy"] != 0)
            and np.array_equal(trace["mesh.te"], traces[0]["mesh.te"])
        )
    assert scene(tmp_path, "").hash == load_scene("pair_loaded").hash


def test_the_summary_says_what_was_off(tmp_path: Path) -> None:
    held = scene(tmp_path, "tip_contact = false\nhertz = true")
    source = Source(stage_model(held))
    assert summary(held, source, run_once(held, source), None)["effects_off"] == ["tip_contact"]
