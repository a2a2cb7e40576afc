"""Chapter on the plan of a planned run: effects with their error and price, the work–precision chart, tripwires, spot
checks. Everything comes from the trace's meta "plan" (gearfmu/planning/run.py); nothing is computed here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator

from gearfmu.report import page
from gearfmu.report.style import COLOURS, WIDTH, plain_ticks, png, styled

LEAST = 1e-3  # budgets: the smallest error on the chart
MOST_SHOWN = 4.0  # budgets: the longest bar
TICKS = tuple(digit * 10.0**power for power in range(-3, 4) for digit in (1, 2, 5))
HEADER = ("effect", "error if dropped, budgets", "saves", "verdict", "why")


def plan_sections(plan: Mapping[str, Any] | None) -> list[str]:
    """A section for every segment of the plan; none for a run without one."""
    return [_section(segment, plan) for segment in plan["segments"]] if plan else []


def _section(segment: Mapping[str, Any], plan: Mapping[str, Any]) -> str:
    own = [
        _told(item, kind)
        for kind in ("trips", "checks")
        for item in plan[kind]
        if item["segment"] == segment["name"] and not item.get("kept", False)
    ]
    shown = [
        page.note(f"Asked for: {asked(plan['request'])}. 1 is as much as that."),
        page.table(HEADER, [_row(line) for line in segment["lines"]], text=(0, 3, 4)),
        f"<figure>{_chart(segment)}</figure>",
        page.note(
            "Left: work–precision of every set tried; dashed: the allowed error. Middle: change by a step down of an "
            "effect. Right: its share of a step of the stage."
        ),
        page.table(("", "budgets"), _numbers(segment, plan["checks"])),
    ]
    return page.section(f"Plan: {segment['name']}, {segment['start']:g} … {segment['end']:g} s", *shown, *own)


def asked(request: Mapping[str, Any]) -> str:
    """The request in words."""
    budgets = " and ".join(str(request[key]) for key in ("budget", "waveform") if key in request)
    return f"{budgets} of {', '.join(request['outputs'])} in {' … '.join(request['band'])}"


def _row(line: Mapping[str, Any]) -> tuple[str, ...]:
    share = "" if line["share"] is None or line["share"] < 0 else f"{100 * line['share']:.0f} %"
    return line["effect"], _number(line["error"]), share, line["verdict"], f"{line['by']}: {line['reason']}"


def _numbers(segment: Mapping[str, Any], checks: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Predicted error and bound, spot checks, noise floor."""
    own = [check for check in checks if check["segment"] == segment["name"]]
    return [
        ("predicted error", _number(segment["error"])),
        (f"bound, times {segment['safety']:g} at most 1", _number(segment["bound"])),
        *((f"spot check at {c['start']:.4g} s", _number(c["error"]) or "the full model fails") for c in own),
        ("noise of the full model", _number(segment["noise"])),
    ]


def _told(item: Mapping[str, Any], kind: str) -> str:
    if kind == "trips":
        return page.warning(
            f"Tripwire at {item['time']:.4g} s, {item['wire']}: {item['message']}; on with {item['answer']}."
        )
    text = f"Spot check at {item['start']:.4g} s: {_number(item['error'])} budgets, {item['allowed']:.2g} allowed."
    after = f": the run went back to where the check began, and on with {item['answer']}" if item.get("answer") else ""
    return page.warning(f"{text} The budget is missed there{after}.")


def _number(value: float | None) -> str:
    """None: of a failed run, or an unknown number."""
    return "" if value is None else f"{value:.2g}"


def _chart(segment: Mapping[str, Any]) -> str:
    """Work–precision with the plan on it, and bars of error and price by effect."""
    with styled():
        figure = Figure(figsize=(WIDTH, 3.55), layout="constrained")
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.5, 1.0, 0.7))
        _precision(left, segment)
        _bars(middle, right, segment["lines"])
        return png(figure).replace(
            'alt=""', 'alt="Error bound over price of every set tried; error and price by effect"'
        )


def _precision(panel: Axes, segment: Mapping[str, Any]) -> None:
    for point in segment["points"]:
        chosen, full = point["chosen"], point["words"].startswith("full model")
        place = (point["price"], max(point["bound"], LEAST))
        panel.loglog(*place, "o" if chosen else ".", color=COLOURS[1 if chosen else 0], markersize=8 if chosen else 5)
        if chosen or full:
            side: dict[str, Any] = {"xytext": (-6, 6), "ha": "right"} if full else {"xytext": (0, -16), "ha": "center"}
            text = "full model, error 0" if full else "the plan"
            panel.annotate(text, place, textcoords="offset points", fontsize=8, **side)
    panel.axhline(1.0 / segment["safety"], color=COLOURS[1], linewidth=0.8, linestyle="--")
    prices = [point["price"] for point in segment["points"]]
    panel.xaxis.set_major_locator(FixedLocator([tick for tick in TICKS if min(prices) / 2 < tick < max(prices) * 2]))
    plain_ticks(panel)
    panel.set_xlabel("processor time over that of level fast")
    panel.set_ylabel("error bound, budgets")


def _bars(left: Axes, right: Axes, lines: Sequence[Mapping[str, Any]]) -> None:
    """Errors and savings of the choices."""
    known = [line for line in lines if line["error"] is not None or line["effect"] in ("modes", "slices", "step")]
    places = list(range(len(known)))
    error = [min(line["error"] or 0.0, MOST_SHOWN) for line in known]
    share = [100.0 * max(0.0, line["share"] or 0.0) for line in known]
    left.barh(places, error, 0.6, color=COLOURS[0])
    left.axvline(1.0, color=COLOURS[1], linewidth=0.8)
    left.set_yticks(places, [line["effect"] for line in known])
    left.set_xlabel(f"error, budgets (at most {MOST_SHOWN:g} shown)")
    right.barh(places, share, 0.6, color="#9aa0a6")
    right.set_yticks(places, [""] * len(places))
    right.set_xlim(0.0, 100.0)
    right.set_xlabel("saves, % of the price")
    for panel in (left, right):
        panel.invert_yaxis()
