"""Picture of a loaded transmission error: each torque about its mean, its harmonics, mesh stiffness and load over the
width; of a planetary set the shares of its planets. Picture of flanks that are not nominal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearfmu.report.style import COLOURS, MUTED, WIDTH, styled, written
from gearfmu.stage.assembly.teeth import FlankField
from gearfmu.stage.run.te import TeResult
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_shape

NOISE = 1e-10  # m
HARMONICS = 6
Drawn: TypeAlias = tuple[str, float, np.ndarray, np.ndarray, np.ndarray]
# colour, torque, position (P,), te (P,) m and harmonics (HARMONICS,) m of a curve
LEGEND: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.2}


def write_plot(result: TeResult, path: Path, unloaded: TeResult | None = None) -> None:
    """Write a result as PNG or as the suffix says. unloaded: a result at 0 N·m, drawn in grey where `result` has no
    such torque. Below the error: sharing at the largest torque and load factor of a set; else stiffness of the mesh and
    load over the width, or stiffness of the stage and peak to peak where the result has none."""
    result = result.found
    drawn, unit = _drawn(result, unloaded), "mesh periods" if result.centrals else "pitches"
    with styled():
        figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
        (upper, bars), (lower, right) = figure.subplots(2, 2, width_ratios=(1.75, 1))
        _about_mean(upper, drawn, unit)
        _harmonics(bars, drawn)
        if result.centrals:
            _sharing(lower, result)
            _load_factor(right, result)
        else:
            _stiffness(lower, result)
            _over_width(right, result)
        lower.set(xlabel=f"position in {unit}", xlim=upper.get_xlim())
        written(figure, path)


def _sharing(axis: Axes, result: TeResult) -> None:
    """Of every planet at the largest torque: at the sun in full lines, at the ring in broken ones."""
    most = int(abs(result.torque).argmax())
    for planet in range(result.sharing.shape[3]):
        at_sun, at_ring = result.sharing[most, :, :, planet].T
        axis.plot(result.position, at_sun, f"C{planet}", label=f"planet {planet + 1}")
        axis.plot(result.position, at_ring, f"C{planet}--")
    axis.legend(ncols=6, **LEGEND)
    axis.set_ylabel(f"force over mean, {result.torque[most]:.4g} N·m\nsun —  ring - -")
    _show_at_least(axis, 0.98, 1.02)


def _load_factor(axis: Axes, result: TeResult) -> None:
    order = np.argsort(result.torque)
    for gear, line, column in zip(result.centrals, ("o-", "s--"), result.load_factor.T, strict=True):
        axis.plot(result.torque[order], column[order], line, color=MUTED, ms=4, label=gear)
    axis.set(xlabel="torque in N·m", ylabel="mesh load factor K_γ")
    _show_at_least(axis, 0.98, 1.1)
    axis.legend(ncols=2, **LEGEND)


def _stiffness(axis: Axes, result: TeResult) -> None:
    mesh = result.mesh_stiffness.size > 0
    for colour, torque, stiffness in _coloured(result, result.mesh_stiffness if mesh else result.stage_stiffness):
        if torque:
            axis.plot(result.position, 1e-6 * stiffness, color=colour)
    axis.set_ylabel(f"stiffness of the {'mesh' if mesh else 'stage'} in N/µm")


def peak_to_peak(te: np.ndarray) -> str:
    """ "0.69 µm peak to peak" of one torque's te (P,) m."""
    return f"{_micrometres(np.ptp(te)):.3g} µm peak to peak"


def _micrometres(length: float) -> float:
    """In µm; rounding noise of statics is 0."""
    return 1e6 * length if abs(length) > NOISE else 0.0


def _drawn(result: TeResult, unloaded: TeResult | None = None) -> list[Drawn]:
    """Every curve; without load in grey."""
    parts = [result] if unloaded is None or np.any(result.torque == 0) else [result, unloaded]
    return [
        (colour, torque, part.position, te, line)
        for part in parts
        for (colour, torque, te), line in zip(_coloured(part, part.te), part.harmonics(HARMONICS), strict=True)
    ]


def _coloured(result: TeResult, rows: np.ndarray) -> list[tuple[str, float, np.ndarray]]:
    """Colour, torque and row of every torque; the unloaded one in grey."""
    return [
        (COLOURS[k % len(COLOURS)] if torque else MUTED, float(torque), row)
        for k, (torque, row) in enumerate(zip(result.torque, rows, strict=True))
    ]


def _about_mean(axis: Axes, drawn: Sequence[Drawn], unit: str) -> None:
    for colour, torque, position, te, _ in drawn:
        label = f"{f'{torque:.4g} N·m' if torque else 'without load'}: {peak_to_peak(te)}"
        label += f", mean {_micrometres(te.mean()):.4g} µm".replace("-", "−")
        axis.plot(position, 1e6 * (te - te.mean()), color=colour, ls="-" if torque else ":", label=label)
    axis.set(xlabel=f"position in {unit}", ylabel="transmission error\nabout its mean in µm")
    axis.set_xlim(0, math.ceil(drawn[0][2][-1]))
    figure = axis.get_figure()
    assert isinstance(figure, Figure)
    figure.legend(handles=axis.lines, loc="outside upper left", ncols=2)


def _harmonics(axis: Axes, drawn: Sequence[Drawn]) -> None:
    """Bars side by side; harmonics that the positions do not resolve are left out."""
    width = 0.8 / len(drawn)
    for number, (colour, _, _, _, line) in enumerate(drawn):
        at = np.arange(1, line.size + 1) + (number - (len(drawn) - 1) / 2) * width
        axis.bar(at, 1e6 * np.nan_to_num(line), width, color=colour)
    axis.set(xlabel="harmonic of the mesh", ylabel="rms in µm", xticks=range(1, HARMONICS + 1), ylim=(0, None))
    axis.grid(visible=False, axis="x")


def _over_width(axis: Axes, result: TeResult) -> None:
    """Load per width over its mean, from the middle of every slice to that of the next; where that is not known, peak
    to peak over the torque."""
    if not result.over_width.size:
        axis.plot(result.torque, 1e6 * np.ptp(result.te, axis=1), color=MUTED, marker=".")
        axis.set(xlabel="torque in N·m", ylabel="peak to peak in µm", ylim=(0, None))
        return
    for colour, torque, row in _coloured(result, result.over_width):
        place = (np.arange(row.size) + 0.5) / row.size - 0.5
        axis.plot(place, row, color=colour, marker="o", ms=3, ls="-" if torque else ":")
    axis.set(xlabel="place over face width, −½ … ½", ylabel="load per width over its mean", xlim=(-0.5, 0.5))
    _show_at_least(axis, 0.9, 1.1)


def _show_at_least(axis: Axes, low: float, high: float) -> None:
    """Widen the vertical axis, so that rounding noise does not fill it."""
    lowest, highest = axis.get_ylim()
    axis.set_ylim(min(low, lowest), max(high, highest))


ROW = 2.2  # inches of a gear


def write_flanks(stage: Stage, path: Path) -> bool:
    """Write a picture with one row for every gear whose flanks are not nominal: material over the length of roll at
    mid-width and over the face width at the middle roll, all teeth, and index deviations by tooth; left flanks in
    full lines, right ones in broken ones. False, and no file, where all are nominal."""
    fields = [field for gear in stage.gears if (field := FlankField(gear, gear_shape(gear))).any]
    if not fields:
        return False
    with styled():
        figure = Figure(figsize=(WIDTH, ROW * len(fields) + 0.3), layout="constrained")
        rows = figure.subplots(len(fields), 3, squeeze=False)
        for axes, field in zip(rows, fields, strict=True):
            _draw(axes, field)
        written(figure, path)
    return True


def _draw(axes: Sequence[Axes], field: FlankField) -> None:
    """One gear."""
    along, across, by_tooth = axes
    z = np.linspace(-0.5, 0.5, 33) * field.gear.face_width
    material, rolls = field.whole(z), field.rolls
    index = np.broadcast_to(field.index(), (2, field.gear.teeth))
    for flank, style in ((0, "-"), (1, "--")):
        along.plot(1e3 * rolls, 1e6 * material[:, flank, z.size // 2].T, style, color=COLOURS[flank], lw=0.7)
        across.plot(1e3 * z, 1e6 * material[:, flank, :, rolls.size // 2].T, style, color=COLOURS[flank], lw=0.7)
        by_tooth.plot(1e6 * index[flank], style, color=COLOURS[flank], marker=".", ms=3)
    along.set(xlabel="length of roll in mm", ylabel=f"{field.gear.name}: material in µm")
    across.set(xlabel="place across the face width in mm")
    by_tooth.set(xlabel="tooth", ylabel="index deviation in µm")
