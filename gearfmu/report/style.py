"""One calm look for every figure, and how a figure becomes part of a page."""

from __future__ import annotations

import base64
import io
import math
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from PIL import Image

from gearfmu.files import written_whole

COLOURS = ("#1f5a92", "#c8642b", "#3f8f5f", "#8a5a9e", "#9a8a2f", "#4c4f56", "#b23a48", "#2f9aa0")
STEEL = LinearSegmentedColormap.from_list("steel", ["#d6dce3", "#a3bfd8", "#4f88b8", "#e2a63e", "#bb3a26"])
INK, MUTED, GRID = "#23262b", "#6a7079", "#e3e6ea"
WIDTH = 9.6
RC = {
    "font.family": "sans-serif",
    "font.sans-serif": ["Helvetica Neue", "Arial", "Liberation Sans", "DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.5,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.8,
    "legend.handlelength": 1.6,
    "svg.fonttype": "none",
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "image.cmap": "magma",
}


def styled() -> AbstractContextManager[None]:
    """Context in which figures take this look; leaves the caller's matplotlib settings alone."""
    look: dict[Any, Any] = {**RC, "axes.prop_cycle": cycler(color=COLOURS)}
    return matplotlib.rc_context(look)


def panels(heights: tuple[float, ...]) -> tuple[Figure, list[Axes]]:
    """A figure of stacked panels with the given heights in inches and one common horizontal axis."""
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.55), layout="constrained")
    axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    return figure, list(axes)


def png(figure: Figure) -> str:
    """`figure` as an <img> element that holds its PNG (256 colours), for pictures of many cells."""
    raw, packed = io.BytesIO(), io.BytesIO()
    figure.savefig(raw, format="png", dpi=170)
    Image.open(raw).convert("RGB").quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        packed, "PNG", optimize=True
    )
    return embedded(packed)


def embedded(image: io.BytesIO, look: str = "") -> str:
    """A PNG as an <img> element; look: its further attributes."""
    return f'<img alt=""{look} src="data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}">'


def written(figure: Figure, path: Path, dpi: float = 150, metadata: dict[str, Any] | None = None) -> None:
    """Write a figure as PNG or as the suffix says, whole or not at all."""
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=dpi, metadata=metadata)


def saved(figure: Figure, path: Path) -> list[Path]:
    """Write a figure as SVG and PNG; without a date, so that the same rows give the same bytes."""
    vectors, pixels = path.with_suffix(".svg"), path.with_suffix(".png")
    written(figure, vectors, 160, {"Date": None})
    written(figure, pixels, 160)
    return [vectors, pixels]


def plain_ticks(axes: Axes) -> None:
    """Label the ticks of both axes as plain numbers."""
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")


def round_scale(scale: float) -> float:
    """The largest of 1, 2, 5 times a power of ten below `scale`."""
    power = 10 ** math.floor(math.log10(scale))
    return float(next(step * power for step in (5, 2, 1) if step * power <= scale))
