"""What ways to compute cost beside their kernel: processor time of the whole over that spent in calls of the library.

    python -m evidence.price.python_loops [pair] [set]

Ways: simulate, mesh_efficiency, a point of a sweep with its row, a scene by the kernel, a trial of a plan, loaded
transmission error, modes. calls: of the library; a way that makes millions of them has a loop in Python over steps or
channels. Assembling the model is left out. Prints a table; the aim is 1.5 for runs of a stage alone.
"""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from gearfmu import cosim
from gearfmu.body import load_bodies
from gearfmu.cosim.scene_run import Staged
from gearfmu.kernel.binding import load
from gearfmu.modes.linear import stage_modes
from gearfmu.planning.choice import Choice
from gearfmu.planning.request import request
from gearfmu.planning.trials import Task, Window, prime, run_trial
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.stage import Steady, assemble, simulate
from gearfmu.stage.run.efficiency import mesh_efficiency
from gearfmu.stage.run.set_te import stage_te
from gearfmu.sweeps.rows import run_alone, trace_row

FAST, STEP = {"level": 1.0}, 20e-6
TIMED = ("gk_set", "gk_get", "gk_set_many", "gk_get_many", "gk_prepare", "gk_initialize", "gk_step", "gk_record")
TIMED += ("gk_te", "gk_rest", "gk_linearise", "gk_adopt")


@dataclass(frozen=True)
class Case:
    """stage and scene by name, torque (N·m), speed (rad/s), simulated time of runs (s)."""

    stage: str
    scene: str
    torque: float
    speed: float
    duration: float


CASES = {
    "pair": Case("fzg_c/stage_relief", "pair_loaded", 302.0, 209.0, 0.4),
    "set": Case("planetary54", "planetary_paper", 600.0, 85.0, 0.1),
}


class Clock:
    """Time and number of calls of the loaded library, which all pass here from then on."""

    def __init__(self) -> None:
        self.seconds, self.calls, library = 0.0, 0, load(None)
        for name in TIMED:
            setattr(library, name, self._timed(getattr(library, name)))

    def _timed(self, own: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any) -> Any:
            started = clock.process_time()
            found = own(*given)
            self.seconds += clock.process_time() - started
            self.calls += 1
            return found

        return call


def ways(case: Case) -> Iterator[tuple[str, Callable[[], object]]]:
    """Name and computation of every way."""
    spec, scene = load_stage(case.stage), load_scene(case.scene)
    bodies = load_bodies(spec)
    model, drive = assemble(spec, bodies), {"torque": case.torque, "speed": case.speed}
    point = {**drive, "duration": case.duration, "step": STEP, "level": "fast"}
    short = scene.model_copy(update={"duration": 1000 * scene.coupling.step})
    sprung, staged = model.driven_by_springs(), Staged.of(short, load_stage(scene.stage.name), bodies)
    prime(scene.model_dump_json(), scene, staged.model)
    window = Window(0.02, 0.02)
    task = Task(
        scene.model_dump_json(),
        Choice("fast", 0.0, scene.stage.slices, ()),
        window,
        request(scene, staged.model, ["te"], ["200 Hz", "3 kHz"], "1 dB"),
    )
    yield "simulate", lambda: simulate(sprung, Steady(sprung, case.speed, case.torque), case.duration, STEP, FAST)
    yield "efficiency", lambda: mesh_efficiency(model, case.torque, case.speed, FAST)
    yield "point of a sweep", lambda: trace_row(run_alone(model, point))
    yield "scene", lambda: cosim.run(staged, unit="kernel")
    yield "trial of a plan", lambda: run_trial(task)
    yield "te", lambda: stage_te(model, [case.torque], 20)
    yield "modes", lambda: stage_modes(model, bodies, case.torque, positions=4)


def main() -> None:
    timed = Clock()
    print(f"{'stage':6} {'way':18} {'whole s':>8} {'kernel s':>9} {'ratio':>6} {'calls':>9}")
    for name in sys.argv[1:] or CASES:
        for way, compute in ways(CASES[name]):
            before, calls, started = timed.seconds, timed.calls, clock.process_time()
            compute()
            whole, own = clock.process_time() - started, timed.seconds - before
            print(f"{name:6} {way:18} {whole:8.3f} {own:9.3f} {whole / own:6.2f} {timed.calls - calls:9}")


if __name__ == "__main__":
    main()
