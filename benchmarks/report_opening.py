"""How long reports take to open in Chromium without a window, and how large they are:
python benchmarks/report_opening.py PAGE…

Seconds from the call until the first figures are drawn, best of RUNS, by the wall clock and in processor time of the
browser and all its processes (what counts on a machine that does other things meanwhile).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from browser import Browser

RUNS = 5


def opened(page: Path) -> tuple[float, float, float]:
    """Seconds by the wall clock until ready, until the first text, and of processor time."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Browser(Path(profile)) as browser:
        before = browser.processor_time()
        wall = browser.open(page)
        spent = browser.processor_time() - before
        first = browser.value("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN")
        assert browser.errors == [], browser.errors
        return wall, 1e-3 * first, spent


def main(pages: list[Path]) -> None:
    """A row a page."""
    print("page,MB,ready_s,first_text_s,processor_s")
    for page in pages:
        best = [min(column) for column in zip(*(opened(page) for _ in range(RUNS)), strict=True)]
        print(f"{page.parent.name}/{page.name},{page.stat().st_size / 1e6:.2f}," + ",".join(f"{b:.2f}" for b in best))


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
