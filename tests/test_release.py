"""What a stranger gets: the page of the package, what it installs, the files of the forge."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest
import setuptools
import yaml

from gearfmu.cli import VERBS
from gearfmu.report import page

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"(!?)\[[^\[\]]*\]\(([^)\s]+)\)")


@pytest.fixture
def handed_to_setup(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The arguments that setup.py gives to setuptools."""
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    runpy.run_path(str(ROOT / "setup.py"))
    return given


def test_links_of_the_package_page_are_addresses_of_files_that_exist(handed_to_setup: dict[str, Any]) -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    source, version = (re.search(rf'^{key} = "(.+)"$', project, re.M) for key in ("Source", "version"))
    assert source and version
    links = LINK.findall(handed_to_setup["long_description"])
    own = [(mark, link) for mark, link in links if link.startswith(source[1])]
    assert len(links) >= len(LINK.findall((ROOT / "README.md").read_text(encoding="utf-8"))) == len(links) > 40
    for _, link in links:
        assert "://" in link
    for mark, link in own:
        kind = "raw" if mark else "blob"
        place = re.fullmatch(rf"{re.escape(source[1])}/{kind}/v{re.escape(version[1])}/([^#?]+)([#?].*)?", link)
        assert place and (ROOT / place[1]).exists(), link


def test_a_link_that_the_checkout_does_not_answer_is_left_alone(handed_to_setup: dict[str, Any]) -> None:
    """Addresses stay as they are, and nothing else of the page changes."""
    ours, theirs = (ROOT / "README.md").read_text(encoding="utf-8"), handed_to_setup["long_description"]
    assert LINK.sub("", ours) == LINK.sub("", theirs)


def test_plotly_is_needed_to_build_and_not_to_run() -> None:
    """61 MB of which reports carry one file; its licence lies beside it."""
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    needed = project.partition("\ndependencies = [")[2].partition("\n]")[0]
    assert "plotly" not in needed and "plotly" in project.partition("\n[project]")[0]
    web = Path(page.__file__).with_name("web")
    assert (web / "plotly.min.js").stat().st_size > 1e6
    assert "MIT" in (web / "plotly.LICENSE").read_text(encoding="utf-8")


def test_commands_of_the_workflow_exist() -> None:
    """Targets of the Makefile and verbs; the forge alone can show that they end well on its machines."""
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8"))
    lines = [step["run"] for job in workflow["jobs"].values() for step in job["steps"] if "run" in step]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = [line.split()[1] for line in lines if line.startswith("make ")]
    assert set(targets) >= {"test", "wheel"} and all(f"\n{target}: " in makefile for target in targets)
    assert {line.split()[1] for line in lines if line.startswith("gearfmu ")} == {"demo", "te", "export", "validate"}
    assert {"demo", "te", "export", "validate"} <= set(VERBS)


@pytest.mark.parametrize("form", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("[!c]*.yml")), ids=lambda p: p.stem)
def test_forms_of_issues_are_whole(form: Path) -> None:
    content = yaml.safe_load(form.read_text(encoding="utf-8"))
    fields = [field for field in content["body"] if field["type"] != "markdown"]
    assert content["name"] and content["description"] and len({field["id"] for field in fields}) == len(fields) >= 3
    assert all(field["attributes"]["label"] for field in fields)
    assert any(field.get("validations", {}).get("required") for field in fields)
