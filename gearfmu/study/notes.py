"""What the numbers of a study alone do not say."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

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
            found = [(row.h_s, getattr(row, f"{name}_error")) for row in line]
            growth, large, small = max(
                ((small[1] / large[1], large, small) for large, small in combinations(found, 2) if large[1] > 0),
                default=(0.0, (0.0, 0.0), (0.0, 0.0)),
            )
            if growth > GROWTH:
                yield (
                    f"{level} ({integrator}), {slices} slices: {name} error grows from {100 * large[1]:.2g} % at "
                    f"{1e6 * large[0]:.3g} µs to {100 * small[1]:.2g} % at {1e6 * small[0]:.3g} µs: the errors of time "
                    "and of modes cancel in part at the larger step, or γ is lowered at the smaller one"
                )
    for r in references:
        if not r.reached:
            yield (
                f"reference, {r.slices} slices: at {1e6 * r.h_s:.3g} µs it still moves by "
                f"{100 * r.te_moved:.2g} % (te), {100 * r.force_moved:.2g} % (force), more than a fifth of the "
                "smallest error of level full"
            )
        doubtful = [row for row in rows if row.slices == r.slices and row.te_error < 5 * r.te_moved]
        if doubtful:
            yield f"reference, {r.slices} slices: {len(doubtful)} errors are smaller than five times what it moved"
