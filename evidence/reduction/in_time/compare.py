"""The paper's reductions in the time domain against the unreduced finite elements (its Figs. 3 and 4).

    python -m evidence.reduction.in_time.compare

carrier_planet : carrier + one planet (scenes.py), 1 ms; the carrier reduced by each method and to several sizes.
hammering      : carrier + planet + sun through their backlash, 0.5 ms; the carrier by each method, gears by eigenmodes.
ring_hammering : planet and ring on its mounts through their backlash, 0.5 ms; the ring by each method.

A line that reduces one kind of body has the others unreduced, or reduced so that a line of their own shows them to be
without influence (planet: Rubin 60; carrier: Krylov 120).
Everything is integrated by the same scheme (HHT-α, α = −0.05) with the same step and contact points, so that the
reduction alone makes a difference; one line tells what half the step does to the finite elements themselves.
Writes errors.csv (rms of the difference, in the whole run and in its last fifth, over that of the reference) and
curves_<scene>.csv beside this file, and draws docs/pictures/in_time_<scene>.svg (chart.py). Ten minutes of one core, a
third of it the modes of the gears.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evidence.reduction.in_time.channels import channels, errors
from evidence.reduction.in_time.chart import RUNS, draw
from evidence.reduction.in_time.scenes import Meshes, Scene, carrier_planet, hammering, ring_hammering
from evidence.reduction.in_time.transient import Assembly, Member, Scheme, integrate
from evidence.tables import told, write_columns, write_rows
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import Size
from gearfmu.reduction.oscillators import oscillators

HERE = Path(__file__).parent
FOUR = ("modal", "craig_bampton", "rubin", "krylov")
EVERY = 2  # steps of a curve's points


@dataclass(frozen=True)
class Run:
    """One line of a table: how each kind of body is reduced, "whole" or method and number; see `reduced`. carrier: of
    the carrier, or of the ring in its own scene."""

    carrier: str = "whole"
    gears: str = "whole"
    half_step: bool = False

    @property
    def name(self) -> str:
        return f"{self.carrier} | {self.gears}" + (" | half the step" if self.half_step else "")


@dataclass(frozen=True)
class Study:
    """A scene, its scheme, and its runs; the first is the reference."""

    make: Callable[[Meshes], Scene]
    meshes: Meshes
    scheme: Scheme
    runs: tuple[Run, ...]


SIZES, PAPER = (60, 120, 240), 120
OF_RING = 400  # the paper's 162 constraint modes and 238 eigenmodes
PLANET = "rubin 60"
CARRIER = f"krylov {PAPER}"
STUDIES = {
    "carrier_planet": Study(
        carrier_planet,
        Meshes(carrier=0.5, gear=0.17),
        Scheme(2e-6, 1e-3),
        (
            Run(),
            Run(gears=PLANET),
            Run(gears=PLANET, half_step=True),
            *(Run(f"{method} {n}", PLANET) for n in SIZES for method in FOUR),
            *(Run(f"modal {n} + residual", PLANET) for n in SIZES),
        ),
    ),
    "hammering": Study(
        hammering,
        Meshes(carrier=0.5, gear=0.25),
        Scheme(1e-6, 0.5e-3),
        (
            Run(),
            Run(CARRIER),
            Run(CARRIER, half_step=True),
            *(Run(CARRIER, f"modal {n}{rest}") for n in (400, 200, 100) for rest in ("", " + residual")),
            Run(CARRIER, "rubin 400"),
            *(Run(f"{method} {PAPER}", "modal 400 + residual") for method in FOUR if method != "krylov"),
        ),
    ),
    "ring_hammering": Study(
        ring_hammering,
        Meshes(gear=0.17, ring=0.17),
        Scheme(1e-6, 0.5e-3),
        (
            Run(),
            Run(half_step=True),
            *(Run(f"{method} {OF_RING}") for method in FOUR[:3]),
            Run(f"modal {OF_RING} + residual"),
            Run(f"rubin {OF_RING}", "modal 400 + residual"),
        ),
    ),
}


def measure(name: str, study: Study) -> Iterator[dict[str, object]]:
    """A line for every channel of every run of a study; its curves are written when it ends. error, late: over the
    reference's rms, of the whole run and of its last fifth; seconds: processor time of the integration."""
    scene = study.make(study.meshes)
    made: dict[tuple[str, str], Member] = {}
    curves: dict[str, dict[str, np.ndarray]] = {}
    for run in study.runs:
        parts, assembly, started = 2 if run.half_step else 1, reduced(scene, run, made), time.process_time()
        motion = integrate(assembly, replace(study.scheme, step=study.scheme.step / parts))
        seconds = time.process_time() - started
        curves[run.name] = {key: values[::parts] for key, values in channels(scene, motion).items()}
        reference = curves[study.runs[0].name]
        for channel, values in curves[run.name].items():
            error, late = errors(reference[channel], values)
            head = {"scene": name, "carrier": run.carrier, "gears": run.gears, "half_step": run.half_step}
            yield head | {"channel": channel, "error": error, "late": late, "seconds": seconds}
    write_curves(name, study.scheme, curves)


def reduced(scene: Scene, run: Run, made: dict[tuple[str, str], Member]) -> Assembly:
    """The scene's assembly with its bodies reduced as the run says; `made` keeps what was reduced before."""
    others = []
    for name, solid in scene.solids.items():
        text = run.carrier if name in ("carrier", "ring") else run.gears
        if text == "whole":
            continue
        if (name, text) not in made:
            method, number, *extra = text.split(" ", 2)
            basis = METHODS[method](solid.inputs or solid.full, Size(int(number)))
            model = oscillators(solid.full, basis, damping_ratio=0.0)
            made[name, text] = Member.reduced(model, residual=bool(extra))
        others.append(made[name, text])
    return scene.assembly.with_members(*others)


def write_curves(name: str, scheme: Scheme, curves: dict[str, dict[str, np.ndarray]]) -> None:
    """curves_<name>.csv: time and every channel of the reference and of what the picture shows."""
    columns = {"time_s": np.arange(scheme.steps + 1) * scheme.step}
    for run, found in curves.items():
        if run in (STUDIES[name].runs[0].name, *RUNS[name]):
            columns |= {f"{channel} | {run}": values for channel, values in found.items()}
    write_columns(HERE / f"curves_{name}.csv", {key: values[::EVERY] for key, values in columns.items()})


if __name__ == "__main__":
    write_rows(HERE / "errors.csv", told(line for name, study in STUDIES.items() for line in measure(name, study)))
    for name in STUDIES:
        draw(name)
