"""What a communication step costs outside the kernel: the harness, through an FMU and with the bare kernel.

    python benchmarks/harness.py

Scene clutch_closure, master gs_mean, communication step 100 µs. Medians over the steps: whole step; its share inside
the stage's `step` (kernel and one call); harness: the difference and that one call, which is timed with nothing to do.
Two recordings: everything (some fifty channels), and one channel. `trace`: making the trace of the kept rows, a step.
Prints a table and writes benchmarks/harness.csv. Aim (issue 3, design): 20 µs with the FMU, 5 µs with the kernel.
"""

from __future__ import annotations

import csv
import platform
import tempfile
import time as clock
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu import fmu
from gearfmu.cosim.drivetrain import build, shafts_of, stage_signals, stage_start
from gearfmu.cosim.fmu_unit import FmuUnit
from gearfmu.cosim.masters import Cut, master
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.recorder import Recorder
from gearfmu.cosim.scene_run import stage_model
from gearfmu.cosim.source import Source
from gearfmu.spec.scene import load_scene

FILE = Path(__file__).with_suffix(".csv")
STEPS, STEP = 2000, 1e-4
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


def empty_call(stage: Any) -> float:
    """Median time, ns, of one timed call of the stage's library with nothing to do."""
    handle, spent = stage.resolve([]), []
    address = np.zeros(1).ctypes.data
    for _ in range(STEPS):
        started = clock.perf_counter_ns()
        if isinstance(stage, FmuUnit):
            stage.read("Real", None, 0, address)
        else:
            stage.get(handle)
        spent.append(clock.perf_counter_ns() - started)
    return float(np.median(spent))


def measure(source: Source, recorded: str) -> dict[str, object]:
    """One row: medians in µs."""
    scene = load_scene("clutch_closure")
    shafts = shafts_of(source.model.spec)
    stage = source.unit({"level": "rigid", "slices": 1} | stage_start(scene, shafts))
    timed, drive = Clocked(stage), PyUnit(build(scene, shafts))
    chosen = master("gs_mean", Cut(timed, drive, (shafts.pinion, shafts.wheel), stage_signals(scene, shafts)))
    recorder = Recorder(timed, drive, RECORDED[recorded], STEPS)
    chosen.begin(0.0)
    whole, inside = np.zeros(STEPS), np.zeros(STEPS)
    for n in range(STEPS):
        started = clock.perf_counter_ns()
        chosen.step(n * STEP, STEP)
        recorder.take((n + 1) * STEP)
        whole[n], inside[n] = clock.perf_counter_ns() - started, timed.spent
    started = clock.perf_counter_ns()
    channels = len(recorder.trace({}).channels)
    trace = (clock.perf_counter_ns() - started) / STEPS
    harness = float(np.median(whole - inside)) + empty_call(stage)
    stage.close()
    return {
        "unit": "fmu" if source.fmu_path else "kernel",
        "channels": channels,
        "step_us": round(1e-3 * float(np.median(whole)), 2),
        "stage_us": round(1e-3 * float(np.median(inside)), 2),
        "harness_us": round(1e-3 * harness, 2),
        "trace_us": round(1e-3 * trace, 2),
        "machine": platform.processor() or platform.machine(),
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
