"""One calm look for every figure, and how a figure becomes part of a page."""

from __future__ import annotations

import base64
import io
import re
from contextlib import AbstractContextManager
from typing import Any

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from PIL import Image

COLOURS = ("#1f5a92", "#c8642b", "#3f8f5f", "#8a5a9e", "#9a8a2f", "#4c4f56", "#b23a48", "#2f9aa0")
INK, MUTED, GRID, OPEN, COAST = "#23262b", "#6a7079", "#e3e6ea", "#f3d9c8", "#d8e4f2"
WIDTH = 9.6
MOST_POINTS, COLUMNS = 16000, 2000  # of a curve in an <svg>; columns that a longer one is shown by
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


def panels(heights: tuple[float, ...], share: bool = True) -> tuple[Figure, list[matplotlib.axes.Axes]]:
    """A figure of stacked panels with the given heights in inches and, when `share`, one common horizontal axis."""
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.55), layout="constrained")
    axes = figure.subplots(len(heights), 1, sharex=share, squeeze=False, height_ratios=heights)[:, 0]
    return figure, list(axes)


def svg(figure: Figure, name: str) -> str:
    """`figure` as an <svg> element of a page, the same bytes every time: takes the page's width and names no outside
    address; `name` keeps its ids apart from other figures'."""
    for axis in figure.axes:
        for line in axis.lines:
            line.set_data(*envelope(*line.get_data()))
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    return _without_unused_ids(_bare_head(text))


def envelope(x: Any, y: Any) -> tuple[np.ndarray, np.ndarray]:
    """A curve over ascending x (n,) with more points than a page can show: the lowest and the highest of every column
    of the page; others as they are."""
    x, y = np.asarray(x), np.asarray(y)
    if x.size <= MOST_POINTS:
        return x, y
    starts = np.linspace(0, x.size, COLUMNS, endpoint=False).astype(int)
    ends = np.stack([np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)], axis=1)
    return np.repeat(x[starts], 2), ends.ravel()


def png(figure: Figure) -> str:
    """`figure` as an <img> element that holds its PNG (256 colours), for pictures of many cells."""
    raw, packed = io.BytesIO(), io.BytesIO()
    figure.savefig(raw, format="png", dpi=170)
    Image.open(raw).convert("RGB").quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        packed, "PNG", optimize=True
    )
    return f'<img alt="" src="data:image/png;base64,{base64.b64encode(packed.getvalue()).decode()}">'


def _bare_head(text: str) -> str:
    """Drop namespaces (HTML knows them) and the fixed size from the <svg> tag."""
    head, body = text.split(">", 1)
    head = re.sub(r'\s(xmlns(:\w+)?|version|width|height)="[^"]*"', "", head)
    return f'{head} role="img">{body}'


def _without_unused_ids(text: str) -> str:
    """Several figures share a page: keep only the ids that are referred to (those carry the figure's salt)."""
    used = set(re.findall(r"#(\w+)", text))
    return re.sub(r' id="([^"]*)"', lambda match: match.group(0) if match.group(1) in used else "", text)
