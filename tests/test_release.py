"""What a stranger gets: the page of the package, what it installs."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest
import setuptools

from gearfmu.report import page

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"(!?)\[[^\[\]]*\]\(([^)\s]+)\)")


def test_links_of_the_package_page_are_addresses_of_files_that_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    runpy.run_path(str(ROOT / "setup.py"))
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    source, version = (re.search(rf'^{key} = "(.+)"$', project, re.M) for key in ("Source", "version"))
    assert source and version
    ours, theirs = (ROOT / "README.md").read_text(encoding="utf-8"), given["long_description"]
    assert LINK.sub("", ours) == LINK.sub("", theirs), "nothing else of the page changes"
    links = LINK.findall(theirs)
    assert len(links) == len(LINK.findall(ours)) > 40 and all("://" in link for _, link in links)
    for mark, link in links:
        if not link.startswith(source[1]):
            continue
        kind = "raw" if mark else "blob"
        place = re.fullmatch(rf"{re.escape(source[1])}/{kind}/v{re.escape(version[1])}/([^#?]+)([#?].*)?", link)
        assert place and (ROOT / place[1]).exists(), link


def test_plotly_is_needed_to_build_and_not_to_run() -> None:
    """61 MB of which reports carry one file; its licence lies beside it."""
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    needed = project.partition("\ndependencies = [")[2].partition("\n]")[0]
    assert "plotly" not in needed and "plotly" in project.partition("\n[project]")[0]
    web = Path(page.__file__).with_name("web")
    assert (web / "plotly.min.js").stat().st_size > 1e6
    assert "MIT" in (web / "plotly.LICENSE").read_text(encoding="utf-8")
