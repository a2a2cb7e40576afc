"""How long reports take to open in Chromium without a window, and how large they are:
python evidence/report_opening.py PAGE…

Seconds from the call, best of RUNS, by the wall clock and in processor time of the browser and all its processes (what
counts on a machine that does other things meanwhile): until the first text; until `ready`, all that is in the window
is drawn; until `complete`, a figure anywhere on the page is drawn as soon as it comes near the window.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from browser import Browser

RUNS = 5


def opened(page: Path) -> tuple[float, ...]:
    """Seconds by the wall clock until the first text, until ready and complete, and of processor time until both."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Browser(Path(profile)) as browser:
        before, begin = browser.processor_time(), time.monotonic()
        ready = browser.open(page)
        spent = browser.processor_time() - before
        browser.wait("complete")
        complete = time.monotonic() - begin
        spent_in_all = browser.processor_time() - before
        first = browser.value("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN")
        assert browser.errors == [], browser.errors
        return 1e-3 * first, ready, complete, spent, spent_in_all


def main(pages: list[Path]) -> None:
    """A row a page."""
    print("page,MB,first_text_s,ready_s,complete_s,ready_processor_s,complete_processor_s")
    for page in pages:
        best = [min(column) for column in zip(*(opened(page) for _ in range(RUNS)), strict=True)]
        print(f"{page.parent.name}/{page.name},{page.stat().st_size / 1e6:.2f}," + ",".join(f"{b:.2f}" for b in best))


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
