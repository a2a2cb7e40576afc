"""Scenes that record gears deformed: what they may say, frames at their times, FMU against kernel, and no cost else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu import cosim, fmu
from gearfmu.cosim.frames import frame_plan
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.scene_run import Staged, run_once, stage_model
from gearfmu.errors import CouplingError, SpecError
from gearfmu.scenefile.scene import DeformationChoice, SceneSpec, load_scene
from gearfmu.stage.run.deformation import Deformation


def closure(**deformation: object) -> SceneSpec:
    """The first 2 ms of a clutch closure."""
    short = load_scene("clutch_closure", {"duration": 2e-3, "settle": 0.0, "stage.level": "fast"})
    return short.model_copy(update={"deformation": DeformationChoice(**deformation) if deformation else None})


def test_the_papers_scene_asks_for_the_papers_times() -> None:
    choice = load_scene("planetary_paper").deformation
    assert choice is not None and choice.gears == ("ring",) and choice.times == pytest.approx((0.033, 0.066, 0.1))
    assert choice.picture_steps(2e-5) == [1650, 3300, 5000]
    assert choice.film_steps(2e-5, 5000) == list(range(0, 5001, 100))


def test_frames_that_fall_between_steps_take_the_nearest() -> None:
    choice = DeformationChoice(gears=("ring",), every=2.5e-4)
    assert choice.film_steps(1e-4, 10) == [0, 2, 5, 8, 10]


def test_fmu_and_kernel_record_the_same_frames_and_the_trace_stays(tmp_path: Path) -> None:
    asked = closure(gears=("wheel",), times=(1e-3,), every=5e-4)
    model = stage_model(asked)
    plan = frame_plan(asked, asked.deformation)
    through_fmu = run_once(asked, Source(model, fmu.export(model, tmp_path / "pair.fmu")), frames=plan)
    through_kernel = run_once(asked, Source(model), frames=plan)
    plain = run_once(closure(), Source(stage_model(closure())))
    found = [run.frames.frames({"wheel": "0" * 64}, {}) for run in (through_fmu, through_kernel) if run.frames]
    assert len(found) == 2 and plain.frames is None
    for frames in found:
        assert frames.time == pytest.approx([0, 5e-4, 1e-3, 1.5e-3, 2e-3])
        assert frames.pictures.tolist() == [2] and frames.film.tolist() == [0, 1, 2, 3, 4]
    wheel, other = (frames.gears["wheel"] for frames in found)
    assert wheel.amplitude.shape[0] == 5 and np.abs(wheel.amplitude[-1]).max() > 1e-9
    assert np.array_equal(wheel.amplitude, other.amplitude) and np.array_equal(wheel.motion, other.motion)
    assert list(plain.trace.channels) == list(through_fmu.trace.channels)
    assert all(np.array_equal(plain.trace[name], through_fmu.trace[name]) for name in plain.trace.channels)


def test_a_run_leaves_its_deformation_beside_the_trace(tmp_path: Path) -> None:
    trace = cosim.run(closure(gears=("pinion", "wheel"), times=(1e-3, 2e-3)), tmp_path, unit="kernel")
    found = Deformation.load(tmp_path / trace.meta["deformation"])
    assert set(found.gears) == {"pinion", "wheel"} and found.film.size == 0 and found.time.size == 2
    assert found.gears["wheel"].body_hash == trace.meta["hashes"]["body wheel"]
    assert found.meta["model"] == trace.meta["hashes"]["model"]


def test_an_fmu_that_does_not_tell_is_refused(tmp_path: Path) -> None:
    model = stage_model(closure())
    path = fmu.export(model, tmp_path / "pair.fmu")
    asked = closure(gears=("wheel",), times=(1e-3,))
    with pytest.raises(SpecError, match=r"pair.fmu: observed gears = none.*--observe wheel"):
        cosim.run(Staged.of_fmu(asked, path))
    with pytest.raises(CouplingError, match="--observe wheel"):
        run_once(asked, Source(model), frames=frame_plan(asked, asked.deformation))
