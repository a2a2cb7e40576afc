"""A plan on the terminal: effect, error if it is dropped, share of the time that this saves, verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gearfmu.planning.book import Line, Plan, Segment

HEADER = ("effect", "error if dropped", "by formula", "saves", "verdict", "why")


def plan_text(plan: Plan) -> str:
    """All segments, and what planning cost."""
    lines = [line for segment in plan.segments for line in _segment_text(segment)]
    lines += [*plan.notes]
    if not math.isnan(plan.cost):
        lines.append(f"planning: {plan.cpu:.3g} s of processor time, {plan.cost:.2g} runs of the full model's window")
    return "\n".join(lines)


def _segment_text(segment: Segment) -> Iterator[str]:
    span = f"{segment.start:g} … {segment.end:g} s"
    yield f"{segment.name} ({span}, {segment.kind.replace('_', ' ')}): {segment.choice.words}"
    yield from aligned([HEADER, *(cells(line) for line in segment.lines)])
    yield (
        f"predicted: {number(segment.error)} budgets, bound {number(segment.bound)} × {segment.safety:g} "
        f"{'≤ 1' if segment.kept else '> 1: the budget is NOT kept'}; noise of the full model {number(segment.noise)}"
    )
    yield (
        f"expected: {segment.realtime:.3g} s of processor time per second, 1/{segment.price_full / segment.price:.3g} "
        f"of the full model's, 1/{segment.price_default / segment.price:.3g} of the scene's own level, whose error is "
        f"{number(segment.error_default)} budgets{'' if segment.error_default <= 1 else ': it misses the budget'}"
    )
    yield from segment.notes


def cells(line: Line) -> tuple[str, ...]:
    """The cells of one effect."""
    share = "" if math.isnan(line.share) else f"{100 * max(line.share, 0.0):.0f} %"  # below 0: noise or harder steps
    return line.effect, number(line.error), number(line.formula), share, line.verdict, f"{line.by}: {line.reason}"


def number(value: float) -> str:
    """Budgets with two digits; "fails" where a run does not reach its end."""
    return "" if math.isnan(value) else "fails" if math.isinf(value) else f"{value:.2g}"


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns side by side, the first and the last two to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left = {0, len(widths) - 2, len(widths) - 1}
    return [
        "  ".join(
            c.ljust(w) if k in left else c.rjust(w) for k, (c, w) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def run_text(told: Mapping[str, Any]) -> str:
    """What became of a plan in its run: predicted error, tripwires, spot checks, noise."""
    lines = [
        f"{s['name']}: predicted {number(s['error'])} budgets, bound {number(s['bound'])}; noise of the full model "
        f"{number(s['noise'])}"
        for s in told["segments"]
    ]
    lines += [
        f"tripwire at {t['time']:.4g} s, {t['wire']}: {t['message']}: on with {t['answer']}" for t in told["trips"]
    ]
    for c in told["checks"]:
        far = "the full model fails" if c["error"] is None else f"{number(c['error'])} budgets"
        after = f": back to where it began, on with {c['answer']}" if c.get("answer") else ""
        missed = "" if c["kept"] else f": MISSED{after}"
        lines.append(f"spot check at {c['start']:.4g} s: {far}, {number(c['allowed'])} allowed{missed}")
    return "\n".join(lines)
