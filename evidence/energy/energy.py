"""Energy of the time step on the shipped bodies: what conservation tests T1–T9 leave of it, and what controls do.

    python -m evidence.energy.energy

Undamped free rattle of ±30 µm along the line of action and its harder relatives, mesh position frozen
(effect.roll_motion off), random starts: place in the mesh, place in the backlash, speed. Drift: largest change of
stored energy minus work of the ports, over the larger of kinetic and stored energy at the start; growth: largest growth
in one step, same scale. Prints a table and writes it as CSV: one row a case, build, local law, number of slices and
step, largest values over all starts.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from evidence.energy.free import FreePair, Rattle, energies, free_pair, started
from evidence.energy.kernel_variants import LOOSE_SOLVER, WITHOUT_ETA, WRONG_MATRIX, double_states, variant
from gearfmu.body import load_bodies
from gearfmu.errors import SimulationError
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stage.run.trace import write_columns
from gearfmu.stagefile.stage import load_stage

STEPS = (5e-6, 7.5e-6, 10e-6)
SLICES = (1, 5, 10)
RELIEVED, HELICAL = "fzg_c/stage_relief", "helical_demo"
DG4, EM = 0, 1
DOUBLE, FLOAT, CURVED = 1e-8, 1e-5, 1e-6  # limits of the drift: double, as shipped (10 000 steps that round states to
# single precision: 1e-5 of a mode's energy), double with the load-dependent law
GROWTH = 2e-5  # in one damped step: what dashpots hold outside their path balances to second order (theory, 12a)
DAMPED = {"effect.contact_damping": 1.0, "effect.modal_damping": 1.0}


@dataclass(frozen=True)
class Case:
    """start: what is not random; stage: of the pair; builds: names of kernels it runs with; laws: 0 linear, 1
    load-dependent; limit: drift allowed, None: that of build and law; infinite: nothing promised; at_least: a control
    must drift by more."""

    test: str
    start: Rattle
    builds: tuple[str, ...] = ("double", "shipped")
    laws: tuple[int, ...] = (0, 1)
    slices: tuple[int, ...] = SLICES
    steps: tuple[float, ...] = STEPS
    parameters: Mapping[str, float] = field(default_factory=dict)
    limit: float | None = None
    at_least: float = 0.0
    stage: str = RELIEVED


FREE = Rattle()
HARD = (5,)
CASES = {
    "free rattle": Case("T1 T2 T6", FREE),
    "under load 10 N·m": Case("T3", Rattle(load=10.0)),
    "under load 302 N·m": Case("T3", Rattle(load=302.0), slices=HARD),
    "jammed 1 µm": Case("T4", Rattle(play=-1e-6)),  # little enough that flanks part
    "jammed 20 µm": Case("T4", Rattle(play=-20e-6), slices=HARD),
    "bearings 1e8 N/m": Case("T5", Rattle(bearing=1e8), laws=(0,), slices=HARD),
    "bearings 1e9 N/m": Case("T5", Rattle(bearing=1e9), laws=(0,), slices=HARD),
    "bearings 1e10 N/m": Case("T5", Rattle(bearing=1e10), laws=(0,), slices=HARD),
    "solver loose, 1e-5": Case("T7", FREE, ("loose",), laws=(1,), slices=HARD, limit=1e-6),
    "gamma = 0 (em)": Case("em", FREE, ("double",), slices=HARD, parameters={"integrator": EM}),
    "damped": Case("T9", Rattle(bearing_damping=600.0), slices=HARD, parameters=DAMPED),
    "damped under load": Case("T9", Rattle(load=10.0, bearing_damping=600.0), slices=HARD, parameters=DAMPED),
}


# a helical step costs eight times a spur one: with as many parts as by default and the longest step
CASES |= {
    f"helical, {name}": replace(CASES[name], slices=(7,), steps=STEPS[-1:], stage=HELICAL)
    for name in ("free rattle", "under load 10 N·m", "jammed 1 µm", "jammed 20 µm", "damped", "damped under load")
}
CASES["helical, under load 150 N·m"] = replace(CASES["helical, under load 10 N·m"], start=Rattle(load=150.0))


def control(test: str, start: Rattle, build: str, at_least: float, **parameters: float) -> Case:
    """A case that must be seen to fail: linear law, five slices."""
    return Case(test, start, (build,), (0,), HARD, parameters=parameters, limit=np.inf, at_least=at_least)


CONTROLS = {
    "control: without η": control("T8", FREE, "no eta", 1e-3),
    "control: without η, under load": control("T8", Rattle(load=10.0), "no eta", 1e-3),
    "control: without η, jammed": control("T8", Rattle(play=-1e-6), "no eta", 1e-3),
    "control: D 4 % wrong": control("T7", FREE, "wrong", 1e-4),
}


def kernels(folder: Path) -> dict[str, Path | None]:
    """Name → library; the shipped one is the package's own."""
    edits = {"loose": LOOSE_SOLVER, "no eta": WITHOUT_ETA, "wrong": WRONG_MATRIX}
    made = {name: variant(folder, name.replace(" ", "_"), edit) for name, edit in edits.items()}
    return {"shipped": None, "double": double_states(folder), **made}


def random_start(base: Rattle, seed: int) -> Rattle:
    """Anywhere in the mesh, anywhere in the backlash, 0.05 to 0.2 m/s."""
    rng = np.random.default_rng(seed)
    position, place, speed = rng.random(), rng.uniform(-0.4, 0.4), rng.uniform(0.05, 0.2)
    return replace(base, position=position, offset=place * max(base.play, 0.0), speed=speed)


def row(pair: FreePair, name: str, case: Case, chosen: tuple[str, int, int, float], run: Mapping) -> dict[str, object]:
    """One line of the table. chosen: build, law, slices, step; run: libraries, starts, duration, level."""
    build, law, slices, h = chosen
    parameters = {"level": LEVELS.index(run["level"]), "h": h, "slices": slices, "effect.hertz": law, **case.parameters}
    worst: dict[str, float] = {"drift": 0.0, "growth": -np.inf, "changes": 0, "retried_steps": 0}
    for seed in range(run["starts"]):
        kernel = started(pair, random_start(case.start, seed), parameters, run["libraries"][build])
        try:
            found = energies(kernel, h, run["duration"])
        except SimulationError:  # the kernel gave the run up: a control, or a failure of the test
            worst["drift"] = np.inf
            continue
        worst["drift"], worst["growth"] = max(worst["drift"], found.drift), max(worst["growth"], found.growth)
        worst["changes"] += found.changes
        worst["retried_steps"] += found.retried_steps
    limit = case.limit if case.limit is not None else FLOAT if build == "shipped" else CURVED if law else DOUBLE
    return {
        "test": case.test,
        "case": name,
        "build": build,
        "law": ("linear", "hertz")[law],
        "slices": slices,
        "h_s": h,
        "starts": run["starts"],
        "duration_s": run["duration"],
        "drift": worst.pop("drift"),
        "limit": limit if not case.at_least else case.at_least,
        **worst,
    }


def combinations(case: Case) -> Iterator[tuple[str, int, int, float]]:
    """Every (build, law, slices, step) of a case."""
    return ((b, law, s, h) for b in case.builds for law in case.laws for s in case.slices for h in case.steps)


def keeps(case: Case, line: Mapping) -> bool:
    """Whether a line is as it should be: within its limit, or a control that is seen to fail; damped runs never
    grow."""
    if case.at_least:
        return line["drift"] > case.at_least
    return (
        line["drift"] <= line["limit"] and not line["retried_steps"] and (case.test != "T9" or line["growth"] <= GROWTH)
    )


def main() -> int:
    """Print and write the table; exit code: number of lines that are not as they should be."""
    pairs = {stage: free_pair(spec := load_stage(stage), load_bodies(spec)) for stage in (RELIEVED, HELICAL)}
    lines, bad = [], 0
    with tempfile.TemporaryDirectory() as folder:
        run = {"libraries": kernels(Path(folder)), "starts": 20, "duration": 0.05, "level": "fast"}
        for name, case in (CASES | CONTROLS).items():
            for combination in combinations(case):
                lines.append(row(pairs[case.stage], name, case, combination, run))
                bad += not shown(case, lines[-1])
    write_columns(
        Path(__file__).with_suffix(".csv"), {column: np.array([line[column] for line in lines]) for column in lines[0]}
    )
    return bad


def shown(case: Case, line: Mapping) -> bool:
    """Print a line; returns whether it is as it should be."""
    good = keeps(case, line)
    print(
        f"{line['test']:9} {line['case']:31} {line['build']:8} {line['law']:7} {line['slices']:3d} "
        f"{1e6 * line['h_s']:5.1f} µs  "
        f"drift {line['drift']:.1e} ({'>' if case.at_least else '≤'} {line['limit']:.0e})  growth "
        f"{line['growth']:.1e}  "
        f"{line['changes']:6d} changes {line['retried_steps']:3d} retried{'' if good else '   ← NOT KEPT'}",
        flush=True,
    )
    return good


if __name__ == "__main__":
    sys.exit(main())
