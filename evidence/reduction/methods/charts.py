"""Charts of reduction methods: error against size and processor time, cost against unknowns and inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context

from gearfmu.report.frf import label_of, readable
from gearfmu.report.style import COLOURS, panels, saved, styled


def write_growth_chart(rows: Sequence[Mapping[str, Any]], path: Path, title: str) -> list[Path]:
    """Largest error against the number of vectors and against processor time, one line a method; rows with method, n,
    max_error, seconds."""
    with styled(), rc_context({"svg.hashsalt": path.stem}):
        figure, axes = panels((3.2, 3.2), share=False)
        for number, method in enumerate(dict.fromkeys(row["method"] for row in rows)):
            line = [row for row in rows if row["method"] == method]
            style = {"color": COLOURS[number % len(COLOURS)], "marker": "o", "markersize": 3.5}
            error = [row["max_error"] for row in line]
            axes[0].semilogy([row["n"] for row in line], error, label=label_of(method), **style)
            axes[1].loglog([row["seconds"] for row in line], error, **style)
        for axis in axes:
            axis.set_ylabel("largest relative error")
            readable(axis.yaxis, powers=True)
        readable(axes[1].xaxis, powers=False)
        axes[0].set_title(title, loc="left")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        axes[0].set_xlabel("vectors n")
        axes[1].set_xlabel("processor time of the reduction, s")
        return saved(figure, path)


def write_cost_chart(
    by_mesh: Sequence[Mapping[str, Any]], by_inputs: Sequence[Mapping[str, Any]], path: Path, title: str
) -> list[Path]:
    """Processor time and memory against the number of unknowns, time against the number of inputs, one line a method;
    rows with method, dof, inputs, seconds, memory_MB."""
    shown = ((by_mesh, "dof", "seconds"), (by_mesh, "dof", "memory_MB"), (by_inputs, "inputs", "seconds"))
    named = {"dof": "unknowns", "inputs": "inputs", "seconds": "processor time, s", "memory_MB": "memory, MB"}
    methods = list(dict.fromkeys(row["method"] for row in by_mesh))
    with styled(), rc_context({"svg.hashsalt": path.stem}):
        figure, axes = panels((2.6,) * len(shown), share=False)
        for axis, (rows, x, y) in zip(axes, shown, strict=True):
            for number, method in enumerate(methods):
                line = [row for row in rows if row["method"] == method]
                style = {"color": COLOURS[number % len(COLOURS)], "marker": "o", "markersize": 3.5}
                axis.loglog([row[x] for row in line], [row[y] for row in line], label=label_of(method), **style)
            axis.set_xlabel(named[x])
            axis.set_ylabel(named[y])
            axis.set_xticks(sorted({row[x] for row in rows}))
            readable(axis.xaxis, powers=False)
            readable(axis.yaxis, powers=False)
            axis.set_ylim(bottom=0.5 * min(row[y] for row in rows))
        axes[0].set_title(title, loc="left")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return saved(figure, path)
