"""What it costs to cut the clutch closure in two: error of the input shaft's torque by master, communication step H and
what the importer connects.

    python -m evidence.accuracy.coupling

Reference: the same drivetrain and the same kernel coupled by gs_mean at every internal step (H = h). That it is the
solution of the uncut equations shows in the rows with H = 2h: two masters of different kind, and what is left.
Errors: rms of the difference over the whole scene, over the rms of the AC part (reference minus its 10 ms moving
average: ringing and tooth mesh alone) and over the standard deviation of the torque. predicted_over_true: Richardson's
estimate from H and H/2 (`gearfmu run --verify`) over the true error. lock_shift_s: of the communication point at which
the clutch is seen locked. All runs of a group have the same internal step h.
Prints the table, writes evidence/accuracy/coupling.csv and docs/pictures/coupling.svg; with the argument `chart` only
the latter, from the committed table.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evidence.tables import read_rows, told, write_rows
from gearfmu.cosim.accuracy import Window, alternating, coupling_errors, rms
from gearfmu.cosim.coupled import OK, Result
from gearfmu.cosim.kernel_unit import KernelUnit, RowLog, Source
from gearfmu.cosim.masters import KEYS, RATE
from gearfmu.cosim.scene_run import run_once, stage_model
from gearfmu.files import written_whole
from gearfmu.report.style import panels, styled
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage.run.trace import Trace

ROOT = Path(__file__).resolve().parents[2]
FILE, PICTURE = Path(__file__).with_suffix(".csv"), ROOT / "docs" / "pictures" / "coupling.svg"
STEPS = (25e-6, 50e-6, 100e-6, 200e-6, 250e-6, 500e-6, 1e-3)
WHOLE = Window(0.0, steady=False)


def distance(trace: Trace, reference: Trace, name: str) -> tuple[float, float, float]:
    """How far a channel of `trace` is from `reference`, a run of the same scene at a whole multiple of times as many
    points, at the times of `trace`: rms of the difference in the channel's unit, over the rms of the reference's AC
    part, over its standard deviation, both at all its points."""
    step, fine = float(trace.time[1] - trace.time[0]), float(reference.time[1] - reference.time[0])
    ratio = round(step / fine)
    assert ratio >= 1 and abs(ratio * fine - step) <= 1e-6 * fine, "steps are whole multiples of the reference's"
    index = np.arange(trace.time.size)
    index = index[ratio * index < reference.time.size]
    error, whole = rms(trace[name][index] - reference[name][ratio * index]), reference[name]
    return error, error / rms(alternating(whole, fine, WHOLE.steady)), error / float(np.std(whole))


@dataclass(frozen=True)
class Group:
    """Runs that share a reference: level, internal step h, and where the clutch is (cut at soft springs or at
    shafts)."""

    level: str
    h: float
    chain: bool

    @property
    def torque(self) -> str:
        """Channel of the input shaft's torque."""
        return "pinion.shaft.tau" if self.chain else "pinion.tau"

    def scene(self, master: str, step: float) -> SceneSpec:
        """The clutch closure in this group."""
        scene = load_scene("clutch_closure")
        locked = "pinion.clutch.locked" if self.chain else "drive.clutch.locked"
        changed = {
            "record": (self.torque, locked),
            "passenger_car": scene.passenger_car.model_copy(update={"chain_in_fmu": self.chain}),
            "stage": scene.stage.model_copy(update={"level": self.level, "h": self.h}),
            "coupling": scene.coupling.model_copy(update={"step": step, "master": master}),
        }
        return scene.model_copy(update=changed)


@dataclass(frozen=True)
class Wiring:
    """Connections of an importer: motion inputs of the stage, rates of its signals, and the torque output that jacobi
    holds over a step ("tau" or "tau_next"). Start values of φ and w are given in any case; after them an input that is
    not connected stays as it is."""

    motion: tuple[str, ...] = KEYS
    rates: bool = True
    held: str = "tau"

    def has(self, name: str) -> bool:
        """Whether an input of the stage is connected."""
        return self.rates if name.endswith(RATE) else name.rpartition(".")[2] in (*self.motion, "capacity")

    def order(self, master: str) -> int:
        """Of a master with these connections."""
        return 2 if self.motion == KEYS and self.rates and (master == "gs_mean" or self.held == "tau_next") else 1


class WiredUnit(KernelUnit):
    """A stage as an importer with these connections steps it."""

    def __init__(self, blob: bytes, parameters: Mapping[str, Any], wiring: Wiring) -> None:
        super().__init__(blob, parameters)
        self.wiring, self.begun = wiring, False

    def initialize(self, time: float) -> None:
        """From now on inputs that are not connected stay."""
        super().initialize(time)
        self.begun = True

    def resolve(self, names: Sequence[str]) -> Any:
        """The held torque in place of `tau`; a handle of inputs is their names."""
        if all(self.kernel.variables[name].causality == "input" for name in names):
            return names
        held = f".{self.wiring.held}"
        return super().resolve([name.removesuffix(".tau") + held if name.endswith(".tau") else name for name in names])

    def log(self, names: Sequence[str], points: int) -> RowLog:
        """Of these outputs themselves."""
        return RowLog(partial(self.get, super().resolve(names)), len(names), points)

    def set(self, handle: Any, values: Any) -> None:
        """Connected inputs, before the start φ and w too."""
        given = {n: v for n, v in zip(handle, values, strict=True) if self.wiring.has(n) or self._starts(n)}
        super().set(super().resolve(list(given)), list(given.values()))

    def _starts(self, name: str) -> bool:
        return not self.begun and name.endswith((".phi", ".w"))


@dataclass(frozen=True)
class WiredSource(Source):
    """A source of such units."""

    wiring: Wiring = Wiring()

    def unit(self, parameters: Mapping[str, Any]) -> WiredUnit:
        """A fresh instance with these start values."""
        return WiredUnit(self.model.blob, parameters, self.wiring)


@dataclass(frozen=True)
class Line:
    """A master and what is connected."""

    master: str
    wiring: Wiring = Wiring()

    @property
    def unconnected(self) -> str:
        """Inputs that stay as they are."""
        names = [f".{key}" for key in ("w", "a") if key not in self.wiring.motion]
        return " ".join(names + ([] if self.wiring.rates else ["capacity_rate"]))


GS, NEXT = Line("gs_mean"), Line("jacobi", Wiring(held="tau_next"))
INSIDE = (
    GS,
    Line("gs_mean", Wiring(rates=False)),
    NEXT,
    Line("jacobi", Wiring(("phi", "w"), held="tau_next")),
    Line("jacobi", Wiring(rates=False, held="tau_next")),
    Line("jacobi"),
    Line("jacobi", Wiring(("phi", "w"))),
    Line("jacobi", Wiring(rates=False)),
    Line("jacobi", Wiring(("phi", "w"), rates=False)),
    Line("jacobi", Wiring(("phi",))),
    Line("jacobi", Wiring(("phi",), held="tau_mean")),
)
PLAN: tuple[tuple[Group, tuple[Line, ...], tuple[float, ...]], ...] = (
    (Group("fast", 5e-6, True), INSIDE, STEPS),
    (Group("fast", 5e-6, False), (GS, NEXT, Line("jacobi")), STEPS),
    (Group("standard", 2.5e-6, True), (GS, NEXT, Line("jacobi")), (50e-6, 100e-6, 500e-6, 1e-3)),
)


def lock(trace: Trace) -> float:
    """Time, s, from which the clutch is seen locked; NaN when it does not lock."""
    name = next(name for name in trace.channels if name.endswith(".clutch.locked"))
    return float(trace.time[np.argmax(trace[name] > 0)]) if trace[name].any() else float("nan")


def rows(group: Group, lines: tuple[Line, ...], steps: tuple[float, ...]) -> Iterator[dict[str, object]]:
    """Table of one group."""
    source = Source(stage_model(group.scene("gs_mean", group.h)))
    reference = run_once(group.scene("gs_mean", group.h), source).trace
    for line in lines:
        sizes = (2.0 * group.h, *steps) if line in (GS, NEXT) else steps
        results: dict[float, Result] = {}
        for step in sizes:
            results[step] = run_once(group.scene(line.master, step), WiredSource(source.model, wiring=line.wiring))
        for step in sizes:
            yield row(group, line, results, step, reference)


def row(group: Group, line: Line, results: dict[float, Result], step: float, reference: Trace) -> dict[str, object]:
    """One line of the table; a run that did not reach the end has an outcome and no numbers."""
    result, name = results[step], group.torque
    found: dict[str, object] = {
        "level": group.level,
        "h_s": group.h,
        "clutch": "inside" if group.chain else "outside",
        "master": line.master,
        "held": line.wiring.held if line.master == "jacobi" else "",
        "unconnected": line.unconnected,
        "H_s": step,
        "outcome": result.outcome,
    }
    if result.outcome != OK:
        return found | dict.fromkeys(NUMBERS)
    true, over_ac, over_std = distance(result.trace, reference, name)
    half = next((r for h, r in results.items() if abs(2 * h - step) < 1e-12 and r.outcome == OK), None)
    order = line.wiring.order(line.master)
    estimate = coupling_errors(result.trace, half.trace, order, WHOLE)[name].rms if half else None
    return found | {
        "error_over_ac": over_ac,
        "error_over_std": over_std,
        "error_Nm": true,
        "predicted_over_true": estimate / true if estimate else None,
        "lock_shift_s": round(lock(result.trace) - lock(reference), 9),
        "energy_residual": result.energy_residual,
    }


NUMBERS = (
    "error_over_ac", "error_over_std", "error_Nm", "predicted_over_true", "lock_shift_s", "energy_residual",
)  # fmt: skip
NAMED = {
    ("inside", "gs_mean", "", ""): "gs_mean",
    ("inside", "jacobi", "tau_next", ""): "jacobi, tau_next held",
    ("inside", "jacobi", "tau", ""): "jacobi",
    ("inside", "jacobi", "tau", "capacity_rate"): "jacobi, capacity held too",
    ("outside", "gs_mean", "", ""): "gs_mean, cut at stiff shafts",
    ("outside", "jacobi", "tau", ""): "jacobi, cut at stiff shafts",
}


def line_of(row: dict[str, str]) -> tuple[str, ...]:
    """What makes the line of a row."""
    return tuple(row[key] for key in ("clutch", "master", "held", "unconnected"))


def draw(table: list[dict[str, str]]) -> None:
    """Error over H of the lines that have a name."""
    with styled():
        figure, (axes,) = panels((3.2,))
        for line, label in NAMED.items():
            points = [
                (1e6 * float(row["H_s"]), 100 * float(row["error_over_std"]))
                for row in table
                if row["level"] == "fast" and line_of(row) == line and row["outcome"] == OK
            ]
            points = [point for point in points if point[1] < 100]
            axes.loglog(*zip(*points, strict=True), "o--" if line[0] == "outside" else "o-", label=label)
        axes.set(xlabel="communication step in µs", ylabel="input shaft torque, rms error in % of its std")
        for axis, ticks in ((axes.xaxis, (10, 25, 50, 100, 200, 500, 1000)), (axes.yaxis, (1e-6, 1e-4, 1e-2, 1, 100))):
            axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.set_ticks((), minor=True)
        axes.set_ylim(5e-7, 200)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)
        with written_whole(PICTURE) as temporary:
            figure.savefig(temporary, format="svg")


def main() -> None:
    """Measure, print and write, or read; draw."""
    if sys.argv[1:] != ["chart"]:
        write_rows(FILE, told(line for group in PLAN for line in rows(*group)))
    draw(read_rows(FILE))


if __name__ == "__main__":
    main()
