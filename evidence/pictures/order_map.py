"""docs/pictures/order_map.png from `gearfmu run pair_runup`: python -m evidence.pictures.order_map out/pair_runup"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from evidence.pictures.browser import Browser
from evidence.pictures.reports import PICTURES, WIDE

PART = "(b => [b.left + scrollX, b.top + scrollY, b.width, b.height])(document.querySelector('#orders_map').{rect})"

with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Browser(Path(profile), *WIDE) as browser:
    browser.open(Path(sys.argv[1]) / "report.html")
    browser.draw_all()
    browser.value("new Promise(done => setTimeout(done, 1500)).then(() => 1)")
    browser.picture(PICTURES / "order_map.png", tuple(browser.value(PART.format(rect="getBoundingClientRect()"))))
