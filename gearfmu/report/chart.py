"""What a figure of the report shows, as numbers: panels of curves, maps and bars. `packed` stores them in the page, the
script `web/report.js` draws them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.report.names import shown

TIME = "time in s"
SPANS = {0: "open", -1: "coast", 2: "both"}  # kind of shading by the channel `contact`, +1: drive flanks


@dataclass(frozen=True)
class Curve:
    """y (n,) over x (n,), in the unit that is shown. name: a channel's or any words; look: "" a line, "dashed",
    "dotted", "bars"; colour: number of the palette, None for the next one."""

    x: np.ndarray
    y: np.ndarray
    name: str
    unit: str = ""
    look: str = ""
    colour: int | None = None


@dataclass(frozen=True)
class Heat:
    """A map: values (Y, X), shown from `low` to `high`, over x (X,) and y (Y,); unit: of the values; scale of colours:
    "magma" or "steel"."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    low: float
    high: float
    unit: str
    scale: str = "magma"


@dataclass(frozen=True)
class Mark:
    """A vertical line at x with a word; look: "" dotted, "side" light, "tick" only at the top, in a colour."""

    x: float
    text: str = ""
    look: str = ""
    colour: int | None = None


@dataclass(frozen=True)
class Span:
    """Part of the horizontal axis that is shaded: "open", "coast", "both" (contact) or "locked"."""

    start: float
    end: float
    kind: str


@dataclass(frozen=True)
class Panel:
    """One pair of axes. label: what the vertical axis shows, with its unit; height: px; limits: of the vertical axis;
    dots (x, y): circles on a map; ticks: names of 0, 1, 2 … of the horizontal axis."""

    label: str
    curves: tuple[Curve, ...] = ()
    heat: Heat | None = None
    marks: tuple[Mark, ...] = ()
    spans: tuple[Span, ...] = ()
    dots: tuple[np.ndarray, np.ndarray] | None = None
    limits: tuple[float, float] | None = None
    height: int = 180
    x_label: str = ""
    x_limits: tuple[float, float] | None = None
    ticks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Chart:
    """Panels below one another, or `across` of them side by side where there is room. group: charts of one group zoom
    together along x."""

    panels: tuple[Panel, ...]
    x_label: str = TIME
    group: str = ""
    across: int = 1
    x_limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Plot:
    """A figure of the report: file name of its data, title, caption, what is seen (a Chart, or an element that holds a
    picture), columns of its CSV."""

    name: str
    title: str
    caption: str
    picture: str | Chart
    columns: dict[str, np.ndarray]

    @property
    def empty(self) -> bool:
        """A chart without panels is left out of a page."""
        return isinstance(self.picture, Chart) and not self.picture.panels


def over_time(panels: Iterable[Panel], group: str = "time") -> Chart:
    """Panels over the time of the run; they zoom with all others of the page."""
    return Chart(tuple(panels), group=group)


def described(chart: Chart, most: int = 8) -> str:
    """What a figure shows, in words for those who do not see it: axes, and of every curve its range and mean."""
    words = []
    for panel in chart.panels:
        along = panel.x_label or chart.x_label
        if panel.heat is not None:
            words.append(f"Map of {panel.label} over {along}: {_of_map(panel.heat)}.")
        if panel.curves:
            told = [_of_curve(curve) for curve in panel.curves[:most]]
            more = len(panel.curves) - most
            told += [f"{more} more curves"] if more > 0 else []
            words.append(f"{panel.label} over {along}: {'; '.join(told)}.")
    return " ".join(words)


def _of_curve(curve: Curve) -> str:
    values = curve.y[np.isfinite(curve.y)]
    unit = f" {curve.unit}" if curve.unit else ""
    if not values.size:
        return f"{shown(curve.name)} without values"
    if curve.look == "bars":
        return f"{shown(curve.name)} {', '.join(f'{v:.3g}' for v in values[:6])}{unit}"
    low, high, mean = (float(f(values)) for f in (np.min, np.max, np.mean))
    return f"{shown(curve.name)} from {low:.4g} to {high:.4g}{unit}, mean {mean:.4g}"


def _of_map(heat: Heat) -> str:
    finite = np.where(np.isfinite(heat.values), heat.values, -np.inf)
    row, column = np.unravel_index(int(np.argmax(finite)), finite.shape)
    return f"largest value {finite[row, column]:.4g} {heat.unit} at {heat.x[column]:.4g}, {heat.y[row]:.4g}"


def level_limits(curves: Sequence[Curve], span: float = 90) -> tuple[float, float] | None:
    """Limits of a level axis: at most `span` dB below the highest value, so that a silent line does not squeeze the
    rest; None without finite values."""
    values = [curve.y[np.isfinite(curve.y)] for curve in curves]
    values = [v for v in values if v.size]
    if not values:
        return None
    top = float(np.ceil((max(v.max() for v in values) + 3) / 10) * 10)
    return max(float(np.floor((min(v.min() for v in values) - 3) / 10) * 10), top - span), top
