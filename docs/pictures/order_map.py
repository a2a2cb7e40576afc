"""docs/pictures/order_map.png from `gearfmu run pair_runup`: python docs/pictures/order_map.py out/pair_runup"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from make import HERE, WIDE, Browser

PART = "(b => [b.left + scrollX, b.top + scrollY, b.width, b.height])(document.querySelector('#orders_map').{rect})"

with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Browser(Path(profile), *WIDE) as browser:
    browser.open(Path(sys.argv[1]) / "report.html")
    browser.draw_all()
    browser.value("new Promise(done => setTimeout(done, 1500)).then(() => 1)")
    browser.picture(HERE / "order_map.png", tuple(browser.value(PART.format(rect="getBoundingClientRect()"))))
