"""Scenes of stepping: any communication steps, many rollbacks, very many steps."""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from evidence.stability.astray import run_astray
from evidence.stability.bench import Variant, geometry, kernel, model
from evidence.stability.case import Case, Finding
from evidence.stability.checks import at_most, finding, mean_torque, near
from evidence.stability.loads import DRAG, DRIVEN, LOOSE, NOMINAL, RELIEVED, SWING, swinging
from evidence.stability.motion import RPM, Constant, loaded
from evidence.stability.record import run, run_times

SPEED = 2000 * RPM
MESH_PERIOD = 60.0 / 2000 / 16  # s
INTERNAL_STEPS = 10_000_000
ROLLBACKS = 10_000
SHORTEST, LONGEST, EQUAL = 1e-6, 1e-3, 2e-5  # s, communication steps


def random_communication_steps(case: Case) -> Finding:
    """302 N·m at 2000 rpm with communication steps drawn between 1 µs and 1 ms (log-uniform): mean torque to 1 %,
    transmission error to 5 % of its alternating part what equal steps give; energy balance over all changes of step."""
    pair, duration = geometry(RELIEVED), 0.3
    random = np.random.default_rng(1)
    steps = np.exp(random.uniform(np.log(SHORTEST), np.log(LONGEST), 5000))
    times = np.concatenate([[0.0], np.cumsum(steps)])
    times = times[times <= duration]
    turning = loaded(RELIEVED, Constant(SPEED), NOMINAL)
    made = run_times(kernel(model(RELIEVED), case), turning, times)
    equal = run(kernel(model(RELIEVED), case), turning, duration, EQUAL)
    later = made.after(0.05)
    expected = np.interp(later.time, equal.time, equal["mesh.te"])
    off = float(np.sqrt(np.mean((later["mesh.te"] - expected) ** 2)) / equal.after(0.05)["mesh.te"].std())
    carried = mean_torque(later, pair)
    said = near("mean torque", carried, NOMINAL, 0.01)
    said += at_most("transmission error against equal steps, of its alternating part", off, 0.05)
    return finding(made, pair, said, {"mean_torque_Nm": carried, "te_off": off})


def rollbacks(case: Case) -> Finding:
    """Rattle; at every step the state is saved, the run goes astray for 1 to 3 steps under other inputs and returns:
    10⁴ times, and the end is bit for bit that of the straight run."""
    variant = Variant(ports=(DRIVEN, LOOSE))
    inputs, start = swinging(1500 * RPM, 53.0, SWING, DRAG)

    def wander(random: np.random.Generator) -> dict[str, float]:
        return {"pinion.w": 1500 * RPM + random.normal(0.0, 5.0), "wheel.tau": random.normal(0.0, 20.0)}

    made, said = run_astray(lambda: kernel(model(variant), case, start), inputs, wander, ROLLBACKS)
    return finding(made, geometry(variant), said, {"rollbacks": float(ROLLBACKS)})


def ten_million_steps(case: Case) -> Finding:
    """302 N·m at 2000 rpm for 1e7 internal steps, sampled once a mesh period: force and transmission
    error may not drift by more than 1e-4, memory not grow."""
    pair = geometry(RELIEVED)
    turning = loaded(RELIEVED, Constant(SPEED), NOMINAL)
    inner = run(kernel(model(RELIEVED), case), turning, 4 * MESH_PERIOD, MESH_PERIOD).h
    periods = int(INTERNAL_STEPS * inner / MESH_PERIOD) + 1
    memory: list[float] = []  # from the second communication step on: all that a run needs is there then

    def watched(time: float) -> Mapping[str, float]:
        if time and (not memory or time > (periods - 1.5) * MESH_PERIOD):
            memory.append(_memory())
        return turning(time)

    made = run(kernel(model(RELIEVED), case), watched, periods * MESH_PERIOD, MESH_PERIOD)
    grown = memory[-1] - memory[0]
    tenth, said, facts = made.time.size // 10, [], {"internal_steps": float(made["solver.steps"][-1])}
    for name in ("mesh.force_mean", "mesh.force_max", "mesh.te"):
        values = made[name][tenth:]
        drift = float(abs(values[-tenth:].mean() / values[:tenth].mean() - 1.0))
        facts[f"drift_of_{name}"] = drift
        facts[f"scatter_of_{name}"] = float(values.std() / abs(values.mean()))
        said += at_most(f"drift of {name}", drift, 1e-4)
    facts["memory_grown_MB"] = grown / 1e6
    said += at_most("growth of memory (MB)", grown / 1e6, 2.0)
    said += near("mean torque", mean_torque(made.after(0.05), pair), NOMINAL, 0.01)
    return finding(made, pair, said, facts)


def _memory() -> float:
    """Resident memory of this process, bytes; 0 where the system does not tell it as Linux does."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0
    return pages * float(mmap.PAGESIZE)
