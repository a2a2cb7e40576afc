"""The documentation keeps its word: links lead somewhere, tests it names exist, commands it shows are real."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gearfmu import cli

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "reduced_models").rglob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    broken = [t for t in targets if "://" not in t and not (page.parent / t).exists()]
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_tests_it_names_exist(page: Path) -> None:
    named = re.findall(r"`(tests/[\w/]+(?:\.py)?)(?:::(\w+))?`", page.read_text(encoding="utf-8"))
    missing = [f"{file}::{test}" for file, test in named if not _exists(ROOT / file, test)]
    assert not missing


def _exists(path: Path, test: str) -> bool:
    return path.exists() and (not test or f"def {test}(" in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_verbs_it_shows_are_real(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    shown = re.findall(r"(?:^|`)gearfmu ([a-z]+)\b", text, flags=re.MULTILINE)
    assert not set(shown) - set(cli.VERBS)


def test_every_tick_names_what_shows_it() -> None:
    """A ticked sentence of docs/status.md ends with "→" and existing tests, files or commands."""
    lines = (ROOT / "docs" / "status.md").read_text(encoding="utf-8").splitlines()
    ticked = [line for line in lines if line.startswith("- [x] ")]
    assert len(ticked) > 90
    for line in ticked:
        shown = re.findall(r"`([^`]+)`", line.rpartition("→")[2])
        assert shown, f"nothing shows: {line}"
        for name in shown:
            path, _, test = name.partition("::")
            assert name.startswith("make ") or _exists(ROOT / path, test), f"{name} does not exist: {line}"


def test_make_targets_named_in_the_readme_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for page in PAGES:
        for target in re.findall(r"`make ([a-z-]+)`", page.read_text(encoding="utf-8")):
            assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), f"{page.name}: make {target}"
