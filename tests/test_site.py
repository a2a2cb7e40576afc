"""The documentation as a site: built without a warning, complete in itself."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r'<(\w+)\b([^>]*?)\b(?:href|src)="?([^" >]+)')
NOT_FETCHED = ("canonical", "prev", "next")


@pytest.mark.full
@pytest.mark.needs("material")
def test_links_of_the_site_lead_to_a_place_in_it_and_nothing_is_fetched_from_elsewhere(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {page: page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html") if page.name != "404.html"}
    assert len(pages) > 25
    wrong = []
    for page, text in pages.items():
        for tag, before, link in LINK.findall(text):
            parts = urlsplit(link)
            outside = bool(parts.scheme) or link.startswith("//")
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            target = target / "index.html" if target.is_dir() else target
            anchor = f'id="{unquote(parts.fragment)}"' if parts.fragment and target in pages else ""
            if outside and tag != "a" and not any(f'rel="{word}"' in before for word in NOT_FETCHED):
                wrong.append(f"{page.name} fetches {link}")
            if not outside and (not target.is_file() or anchor not in pages.get(target, "")):
                wrong.append(f"{page.name}: {link}")
    assert not wrong
