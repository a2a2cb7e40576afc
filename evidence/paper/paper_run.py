"""The run of Schurr et al. (ICSV22) at level `fast`, and its first milliseconds at level `paper`, which integrates and
finds contact as they do: paper_run.csv beside this file, docs/pictures/paper_run.png and ring_deformation.png.

    python -m evidence.paper.paper_run

Scene planetary_paper, 0.1 s at level fast, default step; SHORT at level paper, ten minutes of one processor (all of it
takes 1½ hours). Figure: speeds over SHORT (paper's Fig. 6), and the ring at level fast at 33, 66 and 100 ms (Fig. 7),
elastic displacement enlarged.
"""

from __future__ import annotations

import base64
import csv
import io
import re
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
from matplotlib.figure import Figure

from gearfmu.api.results import stage_and_bodies
from gearfmu.api.runs import run
from gearfmu.report.choice import deformed_gears
from gearfmu.report.deformation import pictures
from gearfmu.report.run import Run
from gearfmu.report.style import styled
from gearfmu.spec.scene import load_scene
from gearfmu.stage import Trace
from gearfmu.stage.run.deformation import Deformation

ROOT = Path(__file__).resolve().parents[2]
RUNS, DRAWN = ROOT / "out" / "paper_run", ROOT / "docs" / "pictures"
SHORT, SETTLED = 10e-3, 4e-3  # s
DURATIONS = {"fast": None, "paper": SHORT}  # by level; None: of the scene
SPEEDS = {"planet 1": "planet1.gear.w", "carrier": "carrier.gear.w", "sun": "sun.gear.w"}


def trace_of(level: str) -> Trace:
    """The run at a level."""
    folder, short = RUNS / level, DURATIONS[level]
    changes: dict[str, Any] = {"stage.level": level, "stage.h": None}
    changes |= {"duration": f"{short} s", "settle": f"{SETTLED} s", "deformation": None} if short else {}
    run(load_scene("planetary_paper", changes), folder, unit="kernel")
    return Trace.load(folder / "trace.h5")


def ring_of(trace: Trace) -> tuple[bytes, float]:
    """Picture of the ring at level fast (PNG), and its largest elastic displacement at these times, m."""
    found = Run(trace, trace.meta, *stage_and_bodies(trace.meta), Deformation.load(RUNS / "fast" / "deformation.h5"))
    assert found.deformation is not None
    (ring,), _ = deformed_gears(found)
    plot = pictures(found.deformation, ring, trace, found.stage)
    assert plot is not None
    coded = re.search(r"base64,([^\"]+)", str(plot.picture))
    assert coded is not None
    times = found.deformation.pictures
    return base64.b64decode(coded[1]), max(float(np.linalg.norm(ring.elastic(i), axis=1).max()) for i in times)


def row_of(level: str, trace: Trace, largest: float) -> list[str]:
    """Level, price, then mean and rms of each speed from SETTLED to SHORT; the ring over all."""
    both = (trace.time > SETTLED) & (trace.time <= SHORT)
    numbers = [trace.meta["realtime_factor"]]
    for channel in SPEEDS.values():
        numbers += [np.mean(trace[channel][both]), np.std(trace[channel][both])]
    return [level, *(f"{number:.5g}" for number in numbers), f"{1e6 * largest:.3g}" if level == "fast" else ""]


def draw(traces: dict[str, Trace], ring: bytes) -> None:
    """Speeds of both levels over SHORT, and the ring."""
    with styled():
        figure = Figure(figsize=(9.6, 9.0), layout="constrained")
        axes = figure.subplots(4, 1, height_ratios=(1, 1, 1, 2.1))
        for axis, (name, channel) in zip(axes, SPEEDS.items(), strict=False):
            for level, trace in traces.items():
                shown = trace.time <= SHORT
                axis.plot(1e3 * trace.time[shown], trace[channel][shown], lw=0.8, label=f"level {level}")
            axis.set_ylabel(f"{name} in rad/s")
        axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=2)
        axes[2].set_xlabel("t in ms")
        axes[3].imshow(matplotlib.image.imread(io.BytesIO(ring)))
        axes[3].set_title("ring, level fast", loc="left")
        axes[3].axis("off")
        figure.savefig(DRAWN / "paper_run.png", dpi=110)


def main() -> None:
    """Run, print, write table and pictures."""
    traces = {level: trace_of(level) for level in DURATIONS}
    ring, largest = ring_of(traces["fast"])
    names = [f"{name.replace(' ', '')}_{what}_rad_s" for name in SPEEDS for what in ("mean", "rms")]
    rows = [["level", "realtime_factor", *names, "ring_um"]]
    rows += [row_of(level, trace, largest) for level, trace in traces.items()]
    print(*(",".join(row) for row in rows), sep="\n")
    with Path(__file__).with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    (DRAWN / "ring_deformation.png").write_bytes(ring)
    draw(traces, ring)


if __name__ == "__main__":
    main()
