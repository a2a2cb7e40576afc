"""What a communication step costs outside the kernel: the harness, through an FMU and with the bare kernel.

    python -m evidence.price.harness

Scene clutch_closure, master gs_mean, communication step 100 µs; everything recorded (some seventy channels), or one.
step, stage: median of the quietest hundred steps, of the whole step and of its share inside the stage's `step` (kernel
and one call); harness: the same of their difference, and that one call, which is timed with nothing to do. Parts,
processor time of loops of their own: unit (set, step without kernel, get, log), drivetrain (motion ahead and step),
signals. trace: what making the trace of the kept rows takes, per step.
Prints a table and writes evidence/price/harness.csv. Aim (issue 3, design): harness 20 µs with the FMU, 5 µs with the
kernel.
"""

from __future__ import annotations

import csv
import tempfile
import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu import fmu
from gearfmu.cosim.coupled import DRIVE, Recorder
from gearfmu.cosim.fmu_unit import FmuUnit
from gearfmu.cosim.kernel_unit import Source
from gearfmu.cosim.masters import KEYS, Cut, master
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.scene_run import drive_of, stage_model
from gearfmu.scenefile.scene import load_scene

FILE = Path(__file__).with_suffix(".csv")
STEPS, STEP, BLOCK = 2000, 1e-4, 100
RECORDED = {"all": ("*",), "one": ("mesh.te",)}


class Clocked:
    """A unit whose steps are timed one by one."""

    def __init__(self, unit: Any) -> None:
        self.unit, self.spent = unit, 0
        for name in ("outputs", "initialize", "resolve", "set", "get", "log", "save", "restore"):
            setattr(self, name, getattr(unit, name))

    def step(self, time: float, h: float) -> None:
        """The unit's step."""
        started = clock.perf_counter_ns()
        self.unit.step(time, h)
        self.spent = clock.perf_counter_ns() - started


def loop(call: Callable[[], object]) -> float:
    """Processor time of a call, µs, mean of a loop, smallest of five."""
    found = []
    for _ in range(5):
        started = clock.thread_time_ns()
        for _ in range(STEPS):
            call()
        found.append(clock.thread_time_ns() - started)
    return 1e-3 * min(found) / STEPS


def empty_call(stage: Any) -> Callable[[], object]:
    """A call of the stage's library with nothing to do."""
    if isinstance(stage, FmuUnit):
        return lambda: stage._getters["Real"](stage._component, None, 0, None)
    handle = stage.resolve([])
    return lambda: stage.get(handle)


def run(chosen: Any, recorder: Recorder, timed: Clocked) -> tuple[float, float, float]:
    """Whole step, inside the stage, outside, µs: medians of the block of steps with the smallest, since others use
    the machine too."""
    whole, inside = np.zeros(STEPS), np.zeros(STEPS)
    for n in range(STEPS):
        started = clock.perf_counter_ns()
        chosen.step(n * STEP, STEP)
        recorder.take((n + 1) * STEP)
        whole[n], inside[n] = clock.perf_counter_ns() - started, timed.spent
    blocks = [1e-3 * np.median(values.reshape(-1, BLOCK), axis=1) for values in (whole, inside, whole - inside)]
    return tuple(float(values.min()) for values in blocks)


def measure(source: Source, recorded: str) -> dict[str, object]:
    """One row: times in µs."""
    scene = load_scene("clutch_closure")
    drive = drive_of(scene, source.model.stage)
    stage = source.unit({"level": "rigid", "slices": 1} | drive.start())
    timed = Clocked(stage)
    unit = PyUnit(drive.partner(lambda torques: {}))
    chosen = master("gs_mean", Cut(timed, unit, drive.signals))
    recorder = Recorder(timed, unit, RECORDED[recorded], STEPS, drive.silent)
    chosen.begin(0.0)
    whole, inside, outside = run(chosen, recorder, timed)
    empty = loop(empty_call(stage))
    started = clock.thread_time_ns()
    channels = len(recorder.trace({}).channels)
    trace = 1e-3 * (clock.thread_time_ns() - started) / STEPS
    found = {
        "unit": "fmu" if source.fmu_path else "kernel",
        "channels": channels,
        "step_us": whole,
        "stage_us": inside,
        "harness_us": outside + empty,
        **parts(chosen, stage, empty, [n for n in recorder.trace({}).channels if not n.startswith(DRIVE)]),
        "trace_us": trace,
    }
    stage.close()
    return {key: round(value, 2) if isinstance(value, float) else value for key, value in found.items()}


def parts(chosen: Any, stage: Any, empty: float, names: list[str]) -> dict[str, float]:
    """What unit, drivetrain and signals cost of a step, µs."""
    drive, time = chosen.drive, STEPS * STEP
    inputs = stage.resolve([f"{shaft}.{key}" for shaft in drive.ports for key in KEYS])
    mean, log = stage.resolve([f"{shaft}.tau_mean" for shaft in drive.ports]), stage.log(names, 5 * STEPS)
    values, tau = chosen.motion.copy(), stage.get(mean).tolist()
    given = loop(lambda: stage.set(inputs, values))

    def drivetrain() -> None:
        drive.ahead(time, STEP, chosen.motion)
        drive.drive(tau, time, STEP)

    return {
        "unit_us": given + empty + loop(lambda: stage.get(mean).tolist()) + loop(log.take),
        "drivetrain_us": loop(drivetrain),
        "signals_us": loop(lambda: chosen.send(time, STEP)) - given,
    }


def main() -> list[dict[str, object]]:
    """All rows, printed."""
    model = stage_model(load_scene("clutch_closure"))
    with tempfile.TemporaryDirectory() as folder:
        sources = (Source(model, fmu.export(model, Path(folder) / "stage.fmu")), Source(model))
        rows = [measure(source, recorded) for source in sources for recorded in RECORDED]
    for row in rows:
        print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    return rows


if __name__ == "__main__":
    measured = main()
    with open(FILE, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, measured[0].keys())
        writer.writeheader()
        writer.writerows(measured)
