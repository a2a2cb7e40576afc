"""A Chart as elements of the page and as numbers for its script."""

from __future__ import annotations

from dataclasses import asdict, astuple
from html import escape
from typing import Any

import numpy as np

from gearfmu.report.chart import Chart, Curve, Panel, described
from gearfmu.report.names import plain
from gearfmu.report.packed import Pack, reduced

COLOURS = 8  # of the page's palette


def chart_element(name: str, chart: Chart) -> str:
    """The places of a chart's panels, which the script fills; what they show stands in a label for screen readers."""
    panels = "".join(_panel_element(f"{name}.{number}", panel) for number, panel in enumerate(chart.panels))
    label = escape(described(chart), quote=True)
    style = f' style="--across:{chart.across}"' if chart.across > 1 else ""
    return f'<div class="chart" role="img" aria-label="{label}"{style}>{panels}</div>'


def chart_numbers(chart: Chart, pack: Pack) -> list[dict[str, Any]]:
    """What the script needs to draw each panel: numbers of arrays in the pack instead of the arrays."""
    found = [_panel_numbers(chart, panel, pack) for panel in chart.panels]
    for above, below in zip(found[:-1], found[1:], strict=True) if chart.across == 1 else ():
        above["x"] = above["x"] if above["x"] != below["x"] else ""
    return found


def colours_of(panel: Panel) -> list[int]:
    """Number of the palette's colour for every curve."""
    return [(k if curve.colour is None else curve.colour) % COLOURS for k, curve in enumerate(panel.curves)]


def _panel_element(name: str, panel: Panel) -> str:
    keys = "".join(
        f'<button type="button" class="key {curve.look}" data-curve="{k}" style="--c:var(--c{colour})">'
        f"{_named(curve.name)}</button>"
        for k, (curve, colour) in enumerate(zip(panel.curves, colours_of(panel), strict=True))
        if curve.name
    )
    kinds = dict.fromkeys(span.kind for span in panel.spans)
    keys += "".join(f'<span class="key span {kind}">{SPAN_WORDS[kind]}</span>' for kind in kinds)
    return (
        f'<div class="panel"><div class="keys"><b>{escape(panel.label)}</b>{keys}</div>'
        f'<div class="plot" id="{escape(name, quote=True)}" style="height:{panel.height + 30}px"></div></div>'
    )


SPAN_WORDS = {
    "open": "teeth apart",
    "coast": "coast flanks carry",
    "both": "both flanks touch",
    "locked": "clutch locked",
}


def _named(name: str) -> str:
    words = plain(name)
    return f"{escape(words)} <code>{escape(name)}</code>" if words else escape(name)


def _panel_numbers(chart: Chart, panel: Panel, pack: Pack) -> dict[str, Any]:
    found: dict[str, Any] = {
        "label": panel.label,
        "x": panel.x_label or chart.x_label,
        "group": chart.group,
        "curves": [_curve(curve, colour, pack) for curve, colour in zip(panel.curves, colours_of(panel), strict=True)],
        "marks": [asdict(mark) for mark in panel.marks],
        "spans": [astuple(span) for span in panel.spans],
    }
    limits = panel.x_limits or chart.x_limits
    if limits is not None:
        found["xLimits"] = list(limits)
    if panel.limits is not None:
        found["yLimits"] = list(panel.limits)
    if panel.heat is not None:
        heat = panel.heat
        values = pack.add_map(heat.values, heat.low, heat.high)
        found["heat"] = {"x": pack.add(heat.x), "y": pack.add(heat.y), "z": values, "unit": heat.unit}
        found["heat"] |= {"low": heat.low, "high": heat.high, "scale": heat.scale}
    if panel.ticks:
        found["ticks"] = list(panel.ticks)
    if panel.dots is not None:
        found["dots"] = [pack.add(values) for values in panel.dots]
    return found


def _curve(curve: Curve, colour: int, pack: Pack) -> dict[str, Any]:
    x, y = np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float)
    ascending = x.size < 2 or bool(np.all(np.diff(x) >= 0))
    x, y = reduced(x, y) if ascending else (x, y)
    words = plain(curve.name) or curve.name
    return {
        "x": pack.add(x),
        "y": pack.add(y),
        "name": words,
        "unit": curve.unit,
        "look": curve.look,
        "colour": colour,
        "ascending": ascending,
    }
