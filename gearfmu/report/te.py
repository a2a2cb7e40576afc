"""Picture of a loaded transmission error: each torque about its mean, its harmonics, mesh stiffness and load over the
width; of a planetary set how its planets share the load."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearfmu.files import written_whole
from gearfmu.report.style import COLOURS, MUTED, WIDTH, styled

NOISE = 1e-10  # m
HARMONICS = 6
LEGEND = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.2}


def write_plot(result: Any, path: Path, unloaded: Any = None) -> None:
    """Write a TeResult as PNG or what the suffix says. unloaded: a TeResult at 0 N·m, drawn in grey where `result` has
    no such torque. Without mesh_stiffness that of the stage is drawn, without over_width the peak to peak."""
    result = result.found
    drawn = _drawn(result, unloaded)
    with styled():
        figure, ((upper, bars), (lower, width)) = _panes()
        _about_mean(upper, drawn, "pitches")
        _harmonics(bars, drawn)
        mesh = getattr(result, "mesh_stiffness", None)
        for colour, torque, stiffness in _coloured(result, result.stage_stiffness if mesh is None else mesh):
            if torque:
                lower.plot(result.position, 1e-6 * stiffness, color=colour)
        lower.set_ylabel(f"stiffness of the {'stage' if mesh is None else 'mesh'} in N/µm")
        lower.set(xlabel="position in pitches", xlim=upper.get_xlim())
        _over_width(width, result)
        _save(figure, path)


def write_set_plot(result: Any, path: Path) -> None:
    """Write a SetTeResult as PNG or what the suffix says. Sharing is that at the largest torque, at the sun in full
    lines, at the ring in broken ones."""
    result = result.found
    most, drawn = int(abs(result.torque).argmax()), _drawn(result)
    with styled():
        figure, ((upper, bars), (lower, factors)) = _panes()
        _about_mean(upper, drawn, "mesh periods")
        _harmonics(bars, drawn)
        for planet in range(result.sharing.shape[3]):
            at_sun, at_ring = result.sharing[most, :, :, planet].T
            lower.plot(result.position, at_sun, f"C{planet}", label=f"planet {planet + 1}")
            lower.plot(result.position, at_ring, f"C{planet}--")
        lower.legend(ncols=6, **LEGEND)
        lower.set_ylabel(f"force over mean, {result.torque[most]:.4g} N·m\nsun —  ring - -")
        lower.set(xlabel="position in mesh periods", xlim=upper.get_xlim())
        _show_at_least(lower, 0.98, 1.02)
        order = np.argsort(result.torque)
        for gear, line, column in zip(("sun", "ring"), ("o-", "s--"), result.load_factor.T, strict=True):
            factors.plot(result.torque[order], column[order], line, color=MUTED, ms=4, label=gear)
        factors.set(xlabel="torque in N·m", ylabel="mesh load factor K_γ")
        _show_at_least(factors, 0.98, 1.1)
        factors.legend(ncols=2, **LEGEND)
        _save(figure, path)


def peak_to_peak(te: np.ndarray) -> str:
    """ "0.69 µm peak to peak" of one torque's te (P,) m."""
    return f"{_micrometres(np.ptp(te)):.3g} µm peak to peak"


def _micrometres(length: float) -> float:
    """In µm; rounding noise of statics is 0."""
    return 1e6 * length if abs(length) > NOISE else 0.0


def _panes() -> tuple[Figure, Any]:
    figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
    return figure, figure.subplots(2, 2, width_ratios=(1.75, 1))


def _drawn(result: Any, unloaded: Any = None) -> list[tuple[str, float, np.ndarray, np.ndarray, np.ndarray]]:
    """Colour, torque, position (P,), te (P,) m and harmonics (HARMONICS,) m of every curve; without load in grey."""
    found = []
    parts = [result] if unloaded is None or np.any(result.torque == 0) else [result, unloaded]
    for part in parts:
        lines = part.harmonics(HARMONICS)
        for (colour, torque, te), line in zip(_coloured(part, part.te), lines, strict=True):
            found.append((colour, torque, part.position, te, line))
    return found


def _coloured(result: Any, rows: np.ndarray) -> list[tuple[str, float, np.ndarray]]:
    """Colour, torque and row of every torque; the unloaded one in grey."""
    return [
        (COLOURS[k % len(COLOURS)] if torque else MUTED, float(torque), row)
        for k, (torque, row) in enumerate(zip(result.torque, rows, strict=True))
    ]


def _about_mean(axis: Axes, drawn: Sequence[Any], unit: str) -> None:
    for colour, torque, position, te, _ in drawn:
        label = f"{f'{torque:.4g} N·m' if torque else 'without load'}: {peak_to_peak(te)}"
        label += f", mean {_micrometres(te.mean()):.4g} µm".replace("-", "−")
        axis.plot(position, 1e6 * (te - te.mean()), color=colour, ls="-" if torque else ":", label=label)
    axis.set(xlabel=f"position in {unit}", ylabel="transmission error\nabout its mean in µm")
    axis.set_xlim(0, math.ceil(drawn[0][2][-1]))
    figure = axis.get_figure()
    assert isinstance(figure, Figure)
    figure.legend(handles=axis.lines, loc="outside upper left", ncols=2)


def _harmonics(axis: Axes, drawn: Sequence[Any]) -> None:
    """Bars side by side; harmonics that the positions cannot tell apart are left out."""
    width = 0.8 / len(drawn)
    for number, (colour, _, _, _, line) in enumerate(drawn):
        at = np.arange(1, line.size + 1) + (number - (len(drawn) - 1) / 2) * width
        axis.bar(at, 1e6 * np.nan_to_num(line), width, color=colour)
    axis.set(xlabel="harmonic of the mesh", ylabel="rms in µm", xticks=range(1, HARMONICS + 1), ylim=(0, None))
    axis.grid(visible=False, axis="x")


def _over_width(axis: Axes, result: Any) -> None:
    """Load per width over its mean, from the middle of every slice to that of the next; where that is not known, peak
    to peak over the torque."""
    over_width = getattr(result, "over_width", None)
    if over_width is None:
        axis.plot(result.torque, 1e6 * np.ptp(result.te, axis=1), color=MUTED, marker=".")
        axis.set(xlabel="torque in N·m", ylabel="peak to peak in µm", ylim=(0, None))
        return
    for colour, torque, row in _coloured(result, over_width):
        place = (np.arange(row.size) + 0.5) / row.size - 0.5
        axis.plot(place, row, color=colour, marker="o", ms=3, ls="-" if torque else ":")
    axis.set(xlabel="place over face width, −½ … ½", ylabel="load per width over its mean", xlim=(-0.5, 0.5))
    _show_at_least(axis, 0.9, 1.1)


def _show_at_least(axis: Axes, low: float, high: float) -> None:
    """Widen the vertical axis, so that rounding noise does not fill it."""
    lowest, highest = axis.get_ylim()
    axis.set_ylim(min(low, lowest), max(high, highest))


def _save(figure: Figure, path: Path) -> None:
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=150)
