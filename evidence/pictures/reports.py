"""Pictures of the README and docs from runs (its chart of error against time: evidence/study/cost_chart.py).

    python -m evidence.pictures.reports DEMO SET COMPARISON HOUSED_RUN_UP HOUSED_SET    # reports or their folders

Needs Chromium.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from evidence.pictures.browser import Browser

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "pictures"
WIDE, NARROW = (1200, 1000), (420, 900)
FRAME = 62  # of the turning view


def shot(page: Path, name: str, size: tuple[int, int], element: str | None = None, before: str = "1") -> None:
    """A picture <name>.png of the top of a page, or of the part of it that a selector names; before: script."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Browser(Path(profile), *size) as browser:
        browser.open(page)
        browser.wait("complete")
        browser.value("new Promise(done => setTimeout(done, 1500)).then(() => 1)")
        browser.value(f"if (gearfmuPage.stage) gearfmuPage.stage.show({FRAME}); {before}")
        if element is None:
            return browser.picture(PICTURES / f"{name}.png")
        browser.value(f"document.querySelector({element!r}).scrollIntoView()")
        browser.value("new Promise(done => setTimeout(done, 1500)).then(() => 1)")
        corner = f"(b => [b.left + scrollX, b.top + scrollY, b.width, b.height])(document.querySelector({element!r})"
        x, y, width, height = browser.value(f"{corner}.getBoundingClientRect())")
        browser.picture(PICTURES / f"{name}.png", (x, y, width, height))
        return None


def main(demo: Path, planets: Path, comparison: Path, housed: Path, housed_set: Path) -> None:
    """Every picture of the given runs."""
    shot(demo / "report.html", "report", WIDE)
    shot(demo / "report.html", "report_420", NARROW)
    shot(demo / "report.html", "report_mesh", WIDE, "#mesh")
    shot(demo / "report.html", "report_contact", WIDE, "#contact")
    shot(
        demo / "report.html", "deformed_pair", WIDE, "#stage figure canvas", "document.querySelector('.closer').click()"
    )
    shot(planets / "report.html", "report_set", WIDE)
    shot(comparison, "report_comparison", (1200, 1300))
    shot(housed / "report.html", "housed_stage", WIDE, "#stage")
    shot(housed / "report.html", "sound_waterfall", WIDE, "#housing_waterfall")
    shot(housed_set / "report.html", "housed_set", WIDE, "#stage")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
