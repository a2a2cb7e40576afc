"""The work–precision chart of a study: error against processor time per simulated second."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes

from gearfmu.report.style import COLOURS, MUTED, panels, plain_ticks, saved, styled
from gearfmu.stage.assembly.levels import LEVELS

QUANTITIES = {"te": "transmission error", "force": "mesh force", "bearing": "bearing force"}
MARKS = {"rk45": "s", "dg4": "o"}


def write_chart(rows: Sequence[object], slices: int, path: Path, title: str = "") -> list[Path]:
    """SVG and PNG beside each other at `path` with the suffix replaced; returns both.

    rows: of gearfmu.study, one scene; slices: of the scene, drawn full, others thin.
    """
    with styled(), rc_context({"svg.hashsalt": "study"}):
        figure, axes = panels((2.7, 2.4, 2.4))
        for name, panel in zip(QUANTITIES, axes, strict=True):
            draw(panel, rows, slices, name)
        axes[0].set_title(title, loc="left")
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        axes[-1].set_xlabel("processor time of the stage per simulated second")
        return saved(figure, path)


def draw(panel: Axes, rows: Sequence[Any], slices: int, name: str) -> None:
    """One quantity (te, force, bearing) of the rows into a matplotlib panel."""
    lines: dict[tuple[str, str, int], list[Any]] = {}
    for row in rows:
        if row.realtime_factor > 0 and getattr(row, f"{name}_error") > 0:
            lines.setdefault((row.level, row.integrator, row.slices), []).append(row)
    kinds = list(dict.fromkeys(key[:2] for key in sorted(lines, key=lambda key: _rank(key[0]))))
    for key, line in sorted(lines.items(), key=lambda item: _rank(item[0][0])):
        own = key[2] == slices
        line.sort(key=lambda row: row.h_s)
        time, error = [r.realtime_factor for r in line], [100 * getattr(r, f"{name}_error") for r in line]
        colour = COLOURS[kinds.index(key[:2]) % len(COLOURS)]
        style = {"marker": MARKS.get(key[1], "^"), "markersize": 4.0, "label": _label(key)} if own else {"alpha": 0.35}
        panel.loglog(time, error, color=colour, linewidth=1.2 if own else 0.7, **style)
        if own and name == "te":
            _write_steps(panel, line, time, error)
    plain_ticks(panel)
    panel.set_ylabel(f"{QUANTITIES[name]}, %")


def _write_steps(panel: Axes, line: Sequence[Any], time: list[float], error: list[float]) -> None:
    """The step beside the first and the last point of a line."""
    for k in sorted({0, len(line) - 1}):
        text, at = f"{1e6 * line[k].h_s:.3g} µs", (time[k], error[k])
        panel.annotate(text, at, textcoords="offset points", xytext=(4, 4), color=MUTED, fontsize=7)


def _label(key: tuple[str, str, int]) -> str:
    level, integrator, _ = key
    if level == "paper":
        return f"paper: truncated modes, {integrator}"
    return level if integrator == "dg4" else f"{level}, {integrator}"


def _rank(level: str) -> int:
    order = (*LEVELS, "paper")
    return order.index(level) if level in order else len(order)
