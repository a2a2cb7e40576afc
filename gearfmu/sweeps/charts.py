"""Pictures of a sweep: Harris map, mesh harmonics over torque, levels over one or two swept keys."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearfmu.report.metrics import level
from gearfmu.report.style import panels, styled, written
from gearfmu.report.te import write_plot
from gearfmu.stage.run.te import TeResult
from gearfmu.sweeps.table import SweepTable

TORQUE, SPEED = "torque_Nm", "speed_rad_s"
MOST_CURVES = 8
RPM = 30 / np.pi
LABELS = {TORQUE: "torque in N·m", SPEED: "speed in rpm"}


def write_charts(table: SweepTable, out: Path) -> list[Path]:
    """Write the charts of the table as .png into `out`; returns the paths.

    harris : transmission error over the mesh cycle, a curve a torque, of many at most 8. te_orders : its mesh orders
    over torque. levels : of mesh force and bearing forces, their alternating part in dB re 1 N rms, as a map over two
    swept keys or curves over one. Further swept keys are held at the values of the first point; titles name them.
    """
    axes = numeric_axes(table)
    found: list[Path] = []
    if not np.any(table["outcome"] == "ok"):
        return []
    if TORQUE in axes and table.curves:
        found += [_harris(table, out / "harris.png"), _orders(table, out / "te_orders.png")]
    if axes and any(name.endswith("_rms_ac_N") for name in table.columns):
        found.append(_levels(table, axes, out / "levels.png"))
    return found


def fixed(table: SweepTable, free: Sequence[str]) -> tuple[np.ndarray, str]:
    """Mask (n,) of the rows with results in which all swept keys but `free` have the values of the first such row, and
    these values as text."""
    held = [name for name in table.axes if name not in free]
    mask = table["outcome"] == "ok"
    first = int(np.argmax(mask))
    for name in held:
        mask = mask & (table[name] == table[name][first])
    return mask, ", ".join(f"{name} = {table[name][first]}" for name in held)


def at_most(values: np.ndarray, count: int) -> np.ndarray:
    """So many of the values, evenly spaced, first and last among them; all where there are no more."""
    return values[np.unique(np.linspace(0, values.size - 1, min(values.size, count)).round().astype(int))]


def on_grid(
    table: SweepTable, axes: Sequence[str], rows: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of these rows over the first two keys: ticks to the right (m,) and upwards (n,), values (n, m), NaN where
    a point is missing."""
    x, y = (ticks_of(table, key)[rows] for key in axes[:2])
    right, up = np.unique(x), np.unique(y)
    grid = np.full((up.size, right.size), np.nan)
    grid[np.searchsorted(up, y), np.searchsorted(right, x)] = values[rows]
    return right, up, grid


def _harris(table: SweepTable, path: Path) -> Path:
    rows, _ = fixed(table, [TORQUE])
    some = np.flatnonzero(rows)[np.argsort(table[TORQUE][rows])]
    chosen = at_most(some, MOST_CURVES)
    parts = [{name: v[table.curves["point"] == row] for name, v in table.curves.items()} for row in chosen]
    ends = ("te_um", "mesh_stiffness_N_per_um", "stage_stiffness_N_per_um")
    te, mesh, stage = ([part[n] for n in table.curves if n.endswith(end) for part in parts] for end in ends)
    none, count = np.zeros((0, 0, 0)), len(parts)
    curves = 1e-6 * np.array(te[:count]), 1e6 * np.array(mesh[:count]), 1e6 * np.array(stage[:count])
    write_plot(TeResult(table[TORQUE][chosen], parts[0]["position"], *curves, none, none, ("",) * count), path)
    return path


def _orders(table: SweepTable, path: Path) -> Path:
    rows, title = fixed(table, [TORQUE])
    names = [name for name in table.columns if "te_order_" in name]
    with styled():
        figure, (axis,) = panels((3.2,))
        for name in names:
            axis.plot(table[TORQUE][rows], table[name][rows], marker=".", label=_order_label(name))
        axis.set(xlabel=LABELS[TORQUE], ylabel="transmission error, rms in µm", title=title, ylim=(0, None))
        axis.legend(title="mesh order", ncols=len(names))
        written(figure, path)
    return path


def _order_label(name: str) -> str:
    mesh, _, rest = name.partition("te_order_")
    return f"{mesh.rstrip('_')} {rest.removesuffix('_um')}".strip()


def _levels(table: SweepTable, axes: list[str], path: Path) -> Path:
    rows, title = fixed(table, axes[:2])
    names = [name for name in table.columns if name.endswith("_rms_ac_N")]
    with styled():
        figure, panes = panels((2.4,) * len(names) if len(axes) > 1 else (3.2,))
        if len(axes) > 1:
            for axis, name in zip(panes, names, strict=True):
                _map(figure, axis, table, rows, axes, name)
        else:
            for name in names:
                x = ticks_of(table, axes[0])[rows]
                panes[0].plot(x, level(table[name][rows]), marker=".", label=_plain(name))
            panes[0].set_ylabel("level in dB re 1 N")
            panes[0].legend()
        panes[0].set_title(title)
        panes[-1].set_xlabel(label_of(axes[0]))
        written(figure, path)
    return path


def _map(figure: Figure, axis: Axes, table: SweepTable, rows: np.ndarray, axes: list[str], name: str) -> None:
    """One colour map: the first key to the right, the second upwards."""
    right, up, grid = on_grid(table, axes, rows, level(table[name]))
    image = axis.pcolormesh(right, up, grid, shading="nearest")
    axis.grid(False)
    axis.set_ylabel(label_of(axes[1]))
    figure.colorbar(image, ax=axis, label=f"{_plain(name)}\ndB re 1 N")


def numeric_axes(table: SweepTable) -> list[str]:
    """The swept keys that are numbers; speed to the right and torque upwards where both are swept."""
    axes = [name for name in table.axes if table[name].dtype.kind in "if"]
    order = {SPEED: -1, TORQUE: 1}
    return sorted(axes, key=lambda name: order.get(name, 0)) if {SPEED, TORQUE} <= set(axes) else axes


def ticks_of(table: SweepTable, name: str) -> np.ndarray:
    """(n,) values of a swept key in the unit that is shown."""
    return table[name] * RPM if name == SPEED else table[name]


def label_of(name: str) -> str:
    """A swept key with its unit, for an axis."""
    return LABELS.get(name, name)


def _plain(name: str) -> str:
    """ "bearing pinion" of "bearing_pinion_rms_ac_N"."""
    return name.removesuffix("_rms_ac_N").replace("_", " ")
