"""The run of Schurr et al. (ICSV22) at level `paper`, which integrates and finds contact as they do, beside level
`fast`: evidence/paper/paper_run.csv, docs/pictures/paper_run.png and ring_deformation.png.

    python -m evidence.paper.paper_run

Scene planetary_paper, 0.1 s. Level paper takes 1½ hours of one processor; runs that lie in out/paper_run are taken as
they are. Figure: speeds (paper's Fig. 6), and the ring at 33, 66 and 100 ms (Fig. 7), elastic displacement enlarged.
"""

from __future__ import annotations

import base64
import csv
import io
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearfmu.api.results import stage_and_bodies
from gearfmu.report.choice import deformed_gears
from gearfmu.report.deformation import pictures
from gearfmu.report.run import Run
from gearfmu.report.style import styled
from gearfmu.stage import Trace
from gearfmu.stage.run.deformation import Deformation

ROOT = Path(__file__).resolve().parents[2]
SCENE, RUNS, DRAWN = (
    ROOT / "gearfmu" / "scenes" / "planetary_paper.toml",
    ROOT / "out" / "paper_run",
    ROOT / "docs" / "pictures",
)
WAYS = {"paper": ('level = "paper"', ""), "fast": ('level = "fast"', 'h = "5 us"')}  # level, step
SPEEDS = {"planet 1": "planet1.gear.w", "carrier": "carrier.gear.w", "sun": "sun.gear.w"}
SETTLED = 0.02  # s


def trace_of(way: str) -> Trace:
    """The run of a way; made where it is not there."""
    folder = RUNS / way
    if not (folder / "trace.h5").is_file():
        level, step = WAYS[way]
        text = re.sub(r"^level = .*$", level, SCENE.read_text(encoding="utf-8"), flags=re.MULTILINE)
        folder.mkdir(parents=True, exist_ok=True)
        own = folder / "planetary_paper.toml"
        own.write_text(re.sub(r"^h = .*$", step, text, flags=re.MULTILINE), encoding="utf-8")
        command = [sys.executable, "-m", "gearfmu", "run", str(own), "--unit", "kernel", "--out", str(folder)]
        subprocess.run(command, check=True)
    return Trace.load(folder / "trace.h5")


def ring_of(way: str, trace: Trace) -> tuple[bytes, float]:
    """Picture of the ring (PNG), and its largest elastic displacement at these times, m."""
    run = Run(trace, trace.meta, *stage_and_bodies(trace.meta), Deformation.load(RUNS / way / "deformation.h5"))
    assert run.deformation is not None
    (ring,), _ = deformed_gears(run)
    plot = pictures(run.deformation, ring, trace, run.stage)
    assert plot is not None
    coded = re.search(r"base64,([^\"]+)", str(plot.picture))
    assert coded is not None
    return base64.b64decode(coded[1]), max(
        float(np.linalg.norm(ring.elastic(i), axis=1).max()) for i in run.deformation.pictures
    )


def rows_of(way: str, trace: Trace, largest: float) -> list[str]:
    """Level, price, then mean and rms of the change of each speed after the start, largest displacement of the ring."""
    late = trace.time > SETTLED
    numbers = [trace.meta["realtime_factor"]]
    for channel in SPEEDS.values():
        speed = trace[channel][late]
        numbers += [np.mean(speed), np.std(speed)]
    return [way, *(f"{number:.5g}" for number in numbers), f"{1e6 * largest:.3g}"]


def draw_speed(axis: Axes, name: str, traces: dict[str, Trace]) -> None:
    """One speed of all ways."""
    for way, trace in traces.items():
        axis.plot(1e3 * trace.time, trace[SPEEDS[name]], lw=0.5 if way == "paper" else 0.8, label=f"level {way}")
    axis.set_ylabel(f"{name} in rad/s")


def main() -> None:
    """Run what is missing, print, write table and pictures."""
    traces = {way: trace_of(way) for way in WAYS}
    rings = {way: ring_of(way, trace) for way, trace in traces.items()}
    head = [
        "level",
        "realtime_factor",
        *(f"{name.replace(' ', '')}_{what}_rad_s" for name in SPEEDS for what in ("mean", "rms")),
    ]
    rows = [[*head, "ring_um"], *(rows_of(way, traces[way], rings[way][1]) for way in WAYS)]
    print(*(",".join(row) for row in rows), sep="\n")
    with Path(__file__).with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    (DRAWN / "ring_deformation.png").write_bytes(rings["fast"][0])
    with styled():
        figure = Figure(figsize=(9.6, 12.0), layout="constrained")
        axes = figure.subplots(5, 1, height_ratios=(1, 1, 1, 2.1, 2.1))
        for axis, name in zip(axes, SPEEDS, strict=False):
            draw_speed(axis, name, traces)
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=2)
        axes[2].set_xlabel("t in ms")
        for axis, (way, (picture, _)) in zip(axes[3:], rings.items(), strict=True):
            axis.imshow(matplotlib.image.imread(io.BytesIO(picture)))
            axis.set_title(f"ring, level {way}", loc="left")
            axis.axis("off")
        figure.savefig(DRAWN / "paper_run.png", dpi=110)


if __name__ == "__main__":
    main()
