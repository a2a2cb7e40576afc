"""Drawing of planted defects, and the table of those that were judged."""

from __future__ import annotations

from collections import Counter
from itertools import islice
from pathlib import Path

import pytest
from copies import Copy, nearest
from draw import ROOT, SKIPPED, Defect, drawn, edits, files
from table import CAUGHT, EQUIVALENT, HARMLESS, HOLE, OPEN, count, read

LEAST = 0.85  # of the defects that change anything


@pytest.mark.parametrize(
    ("line", "becomes"),
    [
        ("a = b - c * d", {"a = b + c * d", "a = b", "a = b - c"}),
        (
            "x[i] = 0.5 * y[k + 1];",
            {"x[i + 1] = 0.5 * y[k + 1];", "x[i] = 0.525 * y[k + 1];", "x[i] = 0.5 * y[k + 2];"},
        ),
        ("for (int i = 0; i < n; i++)", {"for (int i = 1; i < n; i++)", "for (int i = 0; i <= n; i++)"}),
        ("    if a and b.c:", {"    if False:", "    if a:"}),
        ("if (p && !q) return 0;", {"if (0) return 0;"}),
        ("turn = np.cos(angle)", {"turn = np.sin(angle)"}),
        ("p = f(a, b.c)", {"p = f(b.c, a)"}),
        ("e += -x", {"e -= -x", "e += x"}),
    ],
)
def test_a_line_offers_these_defects(line: str, becomes: set[str]) -> None:
    offered = {line[:start] + new + line[end:] for _, start, end, new in edits(line)}
    assert becomes <= offered and line not in offered


@pytest.mark.parametrize("line", ["const double *row, *other;", "def f(a: int = 1) -> int:", "x = y", "value = call()"])
def test_a_line_without_arithmetic_offers_none(line: str) -> None:
    assert SKIPPED.match(line) or not edits(line)


def test_a_seed_draws_the_same_defects_of_every_kind_in_both_languages() -> None:
    first, again, other = (list(islice(drawn(seed), n)) for seed, n in ((43, 200), (43, 50), (44, 50)))
    assert first[:50] == again != other
    assert {d.kind for d in first} == {"sign", "index", "constant", "comparison", "term", "swapped", "guard"}
    c = Counter(Path(d.file).suffix == ".py" for d in first)
    assert 60 < c[True] < 140, "about half of the lines are Python"
    assert len(files()) > 200


@pytest.mark.full
@pytest.mark.parametrize(
    ("file", "before", "after", "judge"),
    [
        (
            "gearfmu/geometry/involute.py",
            "return math.atan(t)",
            "return math.tan(t)",
            "tests/geometry/test_involute.py",
        ),
        ("gearfmu/kernel/src/base/gk_math.c", "return sum;", "return -sum;", "tests/kernel/test_math.py"),
    ],
)
def test_a_planted_defect_is_caught_by_a_test_that_is_sound(file: str, before: str, after: str, judge: str) -> None:
    """The tool itself: it builds, plants, runs a test that knows better, and puts the source back."""
    copy = Copy("selftest")
    assert not copy.build() and not copy.run([judge], 60.0).failed
    with copy.planted(Defect(file, 1, "chosen", before, after)) as changed:
        assert changed and copy.run([judge], 60.0).failed.startswith(judge)
    assert not copy.run([judge], 60.0).failed


def test_every_defect_of_the_table_stands_in_the_sources() -> None:
    """A survivor has a verdict with its reason; a defect that was caught names the test."""
    for row in read():
        lines = (ROOT / row.file).read_text(encoding="utf-8").splitlines()
        assert nearest(lines, row.defect), row
        assert row.verdict in (CAUGHT, EQUIVALENT, HARMLESS, HOLE, OPEN, ""), row
        if row.verdict:
            assert (row.verdict == CAUGHT) == bool(row.caught_by), row
        assert row.why or row.verdict not in (EQUIVALENT, HARMLESS, HOLE), row


def test_the_page_states_the_count_of_the_table() -> None:
    """What is promised holds for a whole table: while defects wait for their judges the page says how many are left."""
    drawn_rows, chosen_rows = ([row for row in read() if (row.kind == "chosen") == pick] for pick in (False, True))
    verdicts = Counter(row.verdict for row in drawn_rows)
    stated = (
        f"of {len(drawn_rows)} defects drawn at random from the sources {len(drawn_rows) - verdicts['']} are judged: "
        f"{verdicts[CAUGHT]} caught, {verdicts[EQUIVALENT]} equivalent, {verdicts[HARMLESS]} harmless, "
        f"{verdicts[HOLE]} holes, {verdicts[OPEN]} open; of {len(chosen_rows)} chosen ones {count(chosen_rows).judged} "
        f"are judged and {count(chosen_rows).caught} caught"
    )
    assert stated in (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    assert verdicts[""] + verdicts[OPEN] or count(drawn_rows).share >= LEAST
