"""What a planned run tells of its plan: effects with their error and price, the work–precision chart, tripwires, spot
checks. Everything comes from the trace's meta "plan" (gearfmu/planning/run.py); nothing is computed here."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gearfmu.report import page
from gearfmu.report.style import COLOURS, panels, png, styled

LEAST = 1e-3  # budgets: the smallest error on the chart
HEADER = ("effect", "error if dropped, budgets", "share of a step", "verdict", "why")


def plan_sections(plan: Mapping[str, Any] | None) -> list[str]:
    """A section for every segment of the plan; none for a run without one."""
    if not plan:
        return []
    return [_section(segment, plan) for segment in plan["segments"]]


def _section(segment: Mapping[str, Any], plan: Mapping[str, Any]) -> str:
    own = [
        _told(item, kind) for kind in ("trips", "checks") for item in plan[kind] if item["segment"] == segment["name"]
    ]
    shown = [
        page.note(f"Asked for: {asked(plan['request'])}. 1 is as much as that."),
        page.table(HEADER, [_row(line) for line in segment["lines"]]),
        f"<figure>{_chart(segment)}</figure>",
        page.note(
            "Left: work–precision. Right: error that one step down makes (blue) and share of a step (grey), each over "
            "the budget and over the whole step."
        ),
        page.note(
            f"Predicted {_number(segment['error'])} budgets, bound {_number(segment['bound'])} times "
            f"{segment['safety']:g}; noise of the full model {_number(segment['noise'])}."
        ),
    ]
    return page.section(f"Plan: {segment['name']}, {segment['start']:g} … {segment['end']:g} s", *shown, *own)


def asked(request: Mapping[str, Any]) -> str:
    """The request in words."""
    budgets = " and ".join(str(request[key]) for key in ("budget", "waveform") if key in request)
    return f"{budgets} of {', '.join(request['outputs'])} in {' … '.join(request['band'])}"


def _row(line: Mapping[str, Any]) -> tuple[str, ...]:
    share = "" if line["share"] is None else f"{100 * line['share']:.1f} %"
    return line["effect"], _number(line["error"]), share, line["verdict"], f"{line['by']}: {line['reason']}"


def _told(item: Mapping[str, Any], kind: str) -> str:
    if kind == "trips":
        return page.warning(
            f"Tripwire at {item['time']:.4g} s, {item['wire']}: {item['message']}; on with {item['answer']}."
        )
    text = f"Spot check at {item['start']:.4g} s: {_number(item['error'])} budgets, {item['allowed']:.2g} allowed."
    if item["kept"]:
        return page.note(text)
    after = f": the run went back to where the check began, and on with {item['answer']}" if item.get("answer") else ""
    return page.warning(f"{text} The budget is missed there{after}.")


def _number(value: float | None) -> str:
    """None is what JSON has for a failed run or an unknown number."""
    return "" if value is None else f"{value:.2g}"


def _chart(segment: Mapping[str, Any]) -> str:
    """Work–precision with the plan on it, and bars of error and price by effect."""
    with styled():
        figure, axes = panels((3.0,), share=False)
        left = axes[0]
        left.remove()
        left, right = figure.subplots(1, 2)
        _precision(left, segment)
        _bars(right, segment["lines"])
        return png(figure).replace(
            'alt=""', 'alt="Error bound over price of every set tried; error and price by effect"'
        )


def _precision(panel: Any, segment: Mapping[str, Any]) -> None:
    for point in segment["points"]:
        chosen, full = point["chosen"], point["words"].startswith("full model")
        place = (point["price"], max(point["bound"], LEAST))
        panel.loglog(*place, "o" if chosen else ".", color=COLOURS[1 if chosen else 0], markersize=8 if chosen else 5)
        if chosen or full:
            side = {"xytext": (-6, 6), "ha": "right"} if full else {"xytext": (6, 6)}
            text = "full model, error 0" if full else point["words"]
            panel.annotate(text, place, textcoords="offset points", fontsize=8, **side)
    panel.axhline(1.0 / segment["safety"], color=COLOURS[1], linewidth=0.8)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    panel.set_xlabel("processor time over that of level fast")
    panel.set_ylabel("error bound, budgets")


def _bars(panel: Any, lines: Sequence[Mapping[str, Any]]) -> None:
    known = [line for line in lines if line["error"] is not None or line["effect"] in ("modes", "slices", "step")]
    names = [line["effect"] for line in known]
    error = [min(line["error"] or 0.0, 10.0) for line in known]
    share = [0.0 if line["share"] is None or math.isnan(line["share"]) else max(line["share"], 0.0) for line in known]
    places = list(range(len(names)))
    panel.barh([p - 0.2 for p in places], error, 0.38, color=COLOURS[0])
    panel.barh([p + 0.2 for p in places], share, 0.38, color="#9aa0a6")
    panel.set_yticks(places, names)
    panel.invert_yaxis()
    panel.set_xlabel("budgets (at most 10 shown), share")
