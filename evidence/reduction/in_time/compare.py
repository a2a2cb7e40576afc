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
curves_<scene>.csv beside this file, and draws docs/pictures/in_time_<scene>.svg. Ten minutes of one core, a
third of it the modes of the gears.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.ticker import FuncFormatter

from evidence.reduction.in_time.scenes import Meshes, Scene, carrier_planet, hammering, ring_hammering
from evidence.reduction.in_time.transient import Assembly, Member, Motion, Scheme, integrate
from evidence.tables import read_columns, told, write_columns, write_rows
from gearfmu.files import written_whole
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import Size
from gearfmu.reduction.oscillators import oscillators
from gearfmu.report.style import INK, panels, styled

HERE = Path(__file__).parent
PICTURES = HERE.parents[2] / "docs" / "pictures"
FOUR = ("modal", "craig_bampton", "rubin", "krylov")
EVERY = 2  # steps of a curve's points
QUARTER = "tooth13"  # of 54
LATE = 0.2  # the last part of a run whose error stands apart


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


# curves of the pictures
RUNS = {
    "carrier_planet": {
        "modal 120 | rubin 60": "modal truncation",
        "craig_bampton 120 | rubin 60": "Craig–Bampton",
        "rubin 120 | rubin 60": "Rubin / MacNeal",
        "krylov 120 | rubin 60": "block Krylov",
    },
    "hammering": {
        "krylov 120 | modal 400": "reduced as in the paper",
        "krylov 120 | modal 400 + residual": "with static residual",
    },
    "ring_hammering": {
        "modal 400 | whole": "modal truncation",
        "craig_bampton 400 | whole": "Craig–Bampton",
        "rubin 400 | whole": "Rubin / MacNeal",
        "modal 400 + residual | whole": "modes with static residual",
    },
}
SHOWN = {
    "carrier_planet": ("bolt deflection, µm", "bolt tilt, mrad", "pin elongation, µm"),
    "hammering": ("mesh force, N", "planet speed, rad/s", "sun speed, rad/s"),
    "ring_hammering": ("mesh force, N", "planet speed, rad/s", "tooth of the ring, µm"),
}
FLOOR = 1e-8  # of the differences shown
DIFFERENCE = {
    "carrier_planet": "bolt deflection, µm",
    "hammering": "planet speed, rad/s",
    "ring_hammering": "tooth of the ring, µm",
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


def channels(scene: Scene, motion: Motion) -> dict[str, np.ndarray]:
    """Name with unit → (T,). Speeds are central differences of displacements."""

    def read(name: str, interface: str, component: str) -> np.ndarray:
        return motion.interfaces[name][:, scene.solids[name].index(interface, component)]

    def speed(name: str, component: str) -> np.ndarray:
        return np.gradient(read(name, "bore", component), motion.time)

    force = -motion.tension[:, scene.assembly.joints.unilateral].sum(axis=1)
    if "ring" in scene.solids:
        return {
            "mesh force, N": force,
            "planet speed, rad/s": speed("planet", "rz"),
            "pin deflection, µm": 1e6 * read("planet", "bore", "uy"),
            "tooth of the ring, µm": 1e6 * read("ring", "tooth0", "uy"),
            "ring a quarter away, µm": 1e6 * read("ring", QUARTER, "uy"),
        }
    bolt = read("carrier", "bolt0", "uy")
    found = {
        "bolt deflection, µm": 1e6 * (bolt - scene.radius * read("carrier", "bore", "rz")),
        "bolt tilt, mrad": 1e3 * read("carrier", "bolt0", "rx"),
        "pin elongation, µm": 1e6 * (read("planet", "bore", "uy") - bolt),
    }
    if "sun" not in scene.solids:
        return found | {"planet speed, m/s": speed("planet", "uy"), "carrier speed, rad/s": speed("carrier", "rz")}
    return {
        "mesh force, N": force,
        "planet speed, rad/s": speed("planet", "rz"),
        "sun speed, rad/s": speed("sun", "rz"),
        **found,
    }


def errors(reference: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """rms of the difference, of the whole run and of its last part, over the rms of the whole reference."""
    off, last = other - reference, slice(-round(LATE * len(reference)), None)
    return _rms(off) / _rms(reference), _rms(off[last]) / _rms(reference)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


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


def draw(name: str) -> None:
    """docs/pictures/in_time_<name>.svg: curves of the unreduced bodies and of the reduced ones, and the difference."""
    columns = read_columns(HERE / f"curves_{name}.csv")
    at = 1e3 * columns["time_s"]
    with styled(), rc_context({"svg.hashsalt": name}):
        figure, axes = panels((1.7,) * len(SHOWN[name]) + (2.0,))
        for panel, channel in zip(axes, SHOWN[name], strict=False):
            panel.plot(at, columns[f"{channel} | whole | whole"], color=INK, linewidth=2.4, label="finite elements")
            for run, label in RUNS[name].items():
                panel.plot(at, columns[f"{channel} | {run}"], linewidth=1.0, label=label)
            panel.set_ylabel(channel)
        channel = DIFFERENCE[name]
        whole = columns[f"{channel} | whole | whole"]
        for index, (run, label) in enumerate(RUNS[name].items()):
            off = np.abs(columns[f"{channel} | {run}"] - whole) / np.sqrt(np.mean(whole**2))
            axes[-1].semilogy(at[1:], np.maximum(off[1:], FLOOR), color=f"C{index}", label=label)
        axes[-1].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes[-1].set(xlabel="time, ms", ylabel=f"difference in {channel.split(',')[0]}\nover its rms")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        with written_whole(PICTURES / f"in_time_{name}.svg") as temporary:
            figure.savefig(temporary, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    write_rows(HERE / "errors.csv", told(line for name, study in STUDIES.items() for line in measure(name, study)))
    for name in STUDIES:
        draw(name)
