"""What the numbers of a study alone do not say."""

from __future__ import annotations

from collections.abc import Iterator

from gearfmu.study.table import ReferenceRow, Row

GROWTH = 1.1  # an error that grows by more than this factor as the step shrinks is told


def notes(rows: tuple[Row, ...], references: tuple[ReferenceRow, ...]) -> Iterator[str]:
    """What the numbers alone do not say: errors that grow as the step shrinks, references that are not fine enough."""
    lines: dict[tuple, list[Row]] = {}
    for row in rows:
        lines.setdefault((row.level, row.integrator, row.slices), []).append(row)
    for (level, integrator, slices), line in lines.items():
        line.sort(key=lambda row: -row.h_s)
        for name in ("te", "force", "bearing"):
            least = min(line, key=lambda row: getattr(row, f"{name}_error"))
            last, low = getattr(line[-1], f"{name}_error"), getattr(least, f"{name}_error")
            if last > GROWTH * low:
                yield (
                    f"{level} ({integrator}), {slices} slices: {name} error grows from {100 * low:.2g} % at "
                    f"{1e6 * least.h_s:.3g} µs to {100 * last:.2g} % at {1e6 * line[-1].h_s:.3g} µs: the errors of "
                    "time and of modes cancel in part"
                )
    for r in references:
        if not r.reached:
            yield (
                f"reference, {r.slices} slices: at {1e6 * r.h_s:.3g} µs it still moves by "
                f"{100 * r.te_moved:.2g} % (te), {100 * r.force_moved:.2g} % (force), more than a fifth of the smallest error of level full"
            )
        small = [row for row in rows if row.slices == r.slices and row.te_error < 5 * r.te_moved]
        if small:
            yield f"reference, {r.slices} slices: {len(small)} errors are smaller than five times what it moved"
