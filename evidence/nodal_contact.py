"""Nodal contact of the FZG pair with tip relief against line contact of the same truncated modes, at 302 N·m: mean
transmission error, mesh stiffness, high-frequency transmission error and price over the number of nodes, the penalty
stiffness and the step; and what rk45 with all modes costs and errs by with either contact, against the full model.

    python evidence/nodal_contact.py [--only mesh penalty step levels] [--chart]

Bores are held (no bearings), so that only bodies and contacts yield. Tables `mesh` and `penalty` run through half a
mesh period at 200 rpm, with single and double contact, after another half to settle: transmission is quasi-static
there, and what lies above 20 mesh orders (Hann window) is the nodes' doing or the change of teeth's, as the line shows.
Table `step` compares steps of central with rk45 at 2000 rpm. Table `levels`, at 2000 rpm with bearings, compares every
line with level full by dg4 at 0.25 µs over one mesh period after one to settle, in
communication steps of 20 µs. A table takes some 30 s. Writes
nodal_contact.csv beside this file; --chart draws docs/pictures/nodal.svg from it.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from gearfmu.body import load_bodies
from gearfmu.files import written_whole
from gearfmu.report.style import panels, styled
from gearfmu.spec.forms.expand import expand_pair
from gearfmu.spec.stage import load_stage
from gearfmu.stage import Steady, assemble, simulate
from gearfmu.stage.build.nodal import mesh_penalty

HERE = Path(__file__).parent
TABLE, CHART = HERE / "nodal_contact.csv", HERE.parent / "docs" / "pictures" / "nodal.svg"
STAGE, TORQUE, SLOW, FAST = "fzg_c/stage_relief", 302.0, 200 * np.pi / 30, 2000 * np.pi / 30
FULL, PAPER, LINE, NODAL = 3, 4, 1, 2
DG4, RK45, CENTRAL = 0, 2, 3
SAMPLES, COARSE, HIGH = 1000, 94, 20  # of a run: communication steps; of table levels, 20 µs; orders of the mesh
PERIODS, SETTLE = {SLOW: 0.5, FAST: 1.0}, {SLOW: 0.5, FAST: 1.0}  # mesh periods by speed
ALONG, PENALTIES, STEPS = (11, 21, 41, 81, 161, 321), (1 / 16, 1 / 4, 1.0, 4.0, 16.0), (0.4e-6, 0.2e-6, 0.1e-6)


@dataclass(frozen=True)
class Line:
    """One run. along: nodes of a flank, 0: line contact; penalty: times that of "hertz"; h_s: 0 where the integrator
    chooses; te: mean transmission error; stiffness: mean force over it; high: rms of the transmission error above 20
    mesh orders; te_rms: rms of its difference from the table's reference; cpu: processor seconds per second without
    what is made once."""

    table: str
    name: str
    along: int
    penalty: float
    h_s: float
    te_um: float
    stiffness_N_per_um: float
    high_um: float
    te_rms_um: float
    cpu: float


class Pair:
    """The stage with any numbers of nodal contact; the first run of a table is its reference."""

    def __init__(self) -> None:
        self.spec = load_stage(STAGE)
        self.bodies = load_bodies(self.spec)
        stage = expand_pair(self.spec)
        self.hertz = mesh_penalty(stage, stage.engagements[0])
        self.reference: dict[str, np.ndarray] = {}

    def model(self, along: int, penalty: float):  # noqa: ANN201  (StageModel)
        """The stage's model with these nodes and this penalty over that of "hertz"."""
        contact = self.spec.contact
        nodal = contact.nodal.model_copy(update={"along": along or 41, "penalty": penalty * self.hertz})
        return assemble(
            self.spec.model_copy(update={"contact": contact.model_copy(update={"nodal": nodal})}), self.bodies
        )

    def line(
        self, table: str, name: str, speed: float, parameters: Mapping[str, float], along: int = 0, penalty: float = 1.0
    ) -> Line:
        """A run at `speed`, rad/s, of PERIODS after SETTLE."""
        model = self.model(along, penalty)
        window = PERIODS[speed] * 2 * np.pi / (speed * self.spec.gears[0].teeth)
        count = COARSE if table == "levels" else SAMPLES
        step, duration = window / count, window * (1.0 + SETTLE[speed] / PERIODS[speed])
        values = {"level": PAPER, "contact": NODAL if along else LINE} | dict(parameters)
        drive = Steady(model, speed, TORQUE)
        drive(0.0)
        first = simulate(model, drive, 20 * step, step, values).meta
        trace = simulate(model, drive, duration, step, values)
        cpu = (trace.meta["cpu_s"] - first["cpu_s"]) / (duration - 20 * step)
        te, force = 1e6 * trace["mesh.te"][-count:], trace["mesh.force"][-count:]
        reference = self.reference.setdefault(table, te)
        apart = float(np.sqrt(np.mean((te - reference) ** 2)))
        upper, stiffness = high(te, PERIODS[speed]), force.mean() / te.mean()
        return Line(table, name, along, penalty, values.get("h", 0.0), te.mean(), stiffness, upper, apart, cpu)


def high(te: np.ndarray, periods: float) -> float:
    """rms above HIGH mesh orders of so many mesh periods; a straight line is taken away first."""
    at = np.arange(te.size)
    hann = np.hanning(te.size) / np.sqrt(3 / 8)
    spectrum = np.fft.rfft(hann * (te - np.polyval(np.polyfit(at, te, 1), at)))
    spectrum[: round(HIGH * periods)] = 0.0
    return float(np.sqrt(2 * np.sum(np.abs(spectrum) ** 2)) / te.size)


def measure(pair: Pair, tables: list[str]) -> Iterator[Line]:
    """All lines of the tables."""
    held = {"effect.bearings": 0.0, "integrator": RK45}
    for table in ("mesh", "penalty"):
        if table in tables:
            yield pair.line(table, "line", SLOW, held)
    if "mesh" in tables:
        yield from (pair.line("mesh", "nodal", SLOW, held, along) for along in ALONG)
    if "penalty" in tables:
        yield from (pair.line("penalty", "nodal", SLOW, held, 161, penalty) for penalty in PENALTIES)
    if "step" in tables:
        yield pair.line("step", "nodal rk45", FAST, held, 81)
        for h in STEPS:
            yield pair.line("step", "nodal central", FAST, held | {"integrator": CENTRAL, "h": h}, 81)
    if "levels" in tables:
        free = {"level": FULL, "integrator": DG4}
        yield pair.line("levels", "full dg4 0.25 us", FAST, free | {"h": 0.25e-6})
        yield pair.line("levels", "full dg4", FAST, free)
        yield pair.line("levels", "full rk45", FAST, {"level": FULL, "integrator": RK45})
        yield pair.line("levels", "truncated, line, rk45", FAST, {"integrator": RK45})
        for along in (41, 161):
            yield pair.line("levels", f"paper, {along} nodes, rk45", FAST, {"integrator": RK45}, along)


def read() -> list[dict[str, str]]:
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def chart() -> None:
    """docs/pictures/nodal.svg from the table."""
    rows = read()
    of = {
        name: [row for row in rows if row["table"] == name and int(row["along"])]
        for name in ("mesh", "penalty", "step")
    }
    line = next(row for row in rows if row["table"] == "mesh" and not int(row["along"]))
    with styled(), rc_context({"svg.hashsalt": "nodal"}):
        figure, axes = panels((2.2, 2.2, 2.0), share=False)
        number = lambda table, key: [float(row[key]) for row in of[table]]  # noqa: E731
        axes[0].loglog(number("mesh", "along"), number("mesh", "high_um"), "o-", label="nodal contact")
        axes[0].axhline(float(line["high_um"]), linestyle="--", color="#6a7079", label="line contact")
        axes[0].set(xlabel="nodes along a flank", ylabel="te above 20 orders, µm rms")
        axes[1].semilogx(
            number("penalty", "penalty"), number("penalty", "te_um"), "o-", label="nodal contact, 161 nodes"
        )
        axes[1].axhline(float(line["te_um"]), linestyle="--", color="#6a7079", label="line contact")
        axes[1].set(xlabel="penalty stiffness over that of Hertz's half-width", ylabel="mean te, µm")
        steps = [row for row in of["step"] if float(row["h_s"])]
        axes[2].loglog(
            [1e6 * float(r["h_s"]) for r in steps],
            [float(r["te_rms_um"]) for r in steps],
            "o-",
            label="central, from rk45",
        )
        axes[2].set(xlabel="step h, µs", ylabel="te difference, µm rms")
        for panel in axes:
            panel.legend(loc="best")
            for axis in (panel.xaxis, panel.yaxis):
                if axis.get_scale() == "log":
                    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
                    axis.set_minor_locator(NullLocator())
        with written_whole(CHART) as temporary:
            figure.savefig(temporary, format="svg", metadata={"Date": None})


def main() -> None:
    """Measure what is asked for, keep the other tables, and draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    tables = ["mesh", "penalty", "step", "levels"]
    parser.add_argument("--only", nargs="*", choices=tables, default=tables)
    parser.add_argument("--chart", action="store_true", help="draw the chart of the table that is there")
    chosen = parser.parse_args()
    if chosen.chart:
        return chart()
    kept = [row for row in read() if row["table"] not in chosen.only] if TABLE.exists() else []
    found = []
    for line in measure(Pair(), chosen.only):
        found.append(
            {key: f"{value:.6g}" if isinstance(value, float) else value for key, value in asdict(line).items()}
        )
        print("  ".join(str(value) for value in found[-1].values()), flush=True)
        with written_whole(TABLE) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Line)], lineterminator="\n")
            writer.writeheader()
            writer.writerows([*kept, *found])
    return None


if __name__ == "__main__":
    main()
