"""Stepping of a planned run by the kernel, or by the exported FMU.

Only kernels take a state over from another choice (`gk_adopt`), right after a step. A run that changes its choice is
therefore remembered one communication step early, in the kernel's bytes, which an FMU's state holds too. A kernel makes
that step again, the kernel of the new choice takes its state over, and the FMU of the new choice gets the bytes of it.
Both ways end in the same numbers.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gearfmu.cosim.coupled import CoupledRun, Saved
from gearfmu.cosim.fmu_unit import FmuUnit, kernel_bytes, with_kernel_bytes
from gearfmu.cosim.kernel_unit import KernelUnit, Source
from gearfmu.cosim.scene_run import coupled_run
from gearfmu.planning.choice import Choice
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage import StageModel


class Road:
    """Runs of a scene with one choice or another. fmu: None for the kernel."""

    def __init__(self, scene: SceneSpec, model: StageModel, fmu: Path | None = None) -> None:
        self.scene, self.model, self.fmu = scene, model, fmu

    def begin(self, choice: Choice) -> CoupledRun:
        """From the start of the scene."""
        run = coupled_run(choice.of(self.scene), Source(self.model, self.fmu))
        run.begin()
        return run

    def keep(self, run: CoupledRun) -> Saved:
        """State of a run, for `again`."""
        saved = run.save()
        return saved if self.fmu is None else replace(saved, stage=kernel_bytes(saved.stage))

    def again(self, choice: Choice, before: Saved) -> CoupledRun:
        """The kernel run with the choice one communication step behind `before`, whatever the road."""
        run = self.kernel(choice)
        unit = run.cut.stage
        assert isinstance(unit, KernelUnit), "the source has no FMU"
        unit.kernel.prepare()
        run.restore(before)
        run.new_recorder(1)
        run.advance(run.at + 1)
        return run

    def change(self, choice: Choice, before: CoupledRun) -> CoupledRun:
        """A run with this choice that goes on where a kernel run stands that has just made a step."""
        taken = self.kernel(choice)
        taken.take_over(before)
        if self.fmu is None:
            return taken
        run = coupled_run(choice.of(self.scene), Source(self.model, self.fmu))
        unit, kernel = run.cut.stage, taken.cut.stage
        assert isinstance(unit, FmuUnit) and isinstance(kernel, KernelUnit), "of the sources that were named"
        run.restore(replace(taken.save(), stage=with_kernel_bytes(unit.save(), kernel.save(), taken.time)))
        return run

    def kernel(self, choice: Choice, record: tuple[str, ...] | None = None) -> CoupledRun:
        """A run by the kernel that is not begun. record: names of channels, those of the scene when None."""
        scene = self.scene if record is None else self.scene.model_copy(update={"record": record})
        return coupled_run(choice.of(scene), Source(self.model))
