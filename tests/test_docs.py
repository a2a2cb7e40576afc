"""The documentation keeps its word: links lead somewhere, tests it names exist, commands it shows are real."""

from __future__ import annotations

import functools
import importlib
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import prose
import pytest
import setuptools

from evidence.pages import variables
from evidence.pages.effects import effects_page
from gearfmu import cli, report

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "reduced_models").rglob("*.md")])
TODAY = [page for page in PAGES if page.name != "CHANGELOG.md"]  # which names verbs and options of its time
KNOWN = {"file-formats.md": 2, "03-step.md": 1}  # words of the field, and of the file's own text


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]*)(?:#([^)]+))?\)", page.read_text(encoding="utf-8"))
    targets = [(page.parent / to if to else page, anchor) for to, anchor in links if "://" not in to]
    assert not [f"{to}#{anchor}" for to, anchor in targets if not to.exists() or anchor and anchor not in _anchors(to)]


def _anchors(page: Path) -> set[str]:
    """Anchors that headings get: small letters, what is no letter or digit left out, spaces as hyphens."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_what_it_names_exists(page: Path) -> None:
    """Tests; targets of make; files of the kernel, with or without names of their functions in brackets."""
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+(?:\.py)?)(?:::(\w+))?`", text)
    missing = [f"{file}::{test}" for file, test in named if not _exists(ROOT / file, test)]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    missing += [target for target in re.findall(r"`make ([a-z-]+)`", text) if f"\n{target}:" not in makefile]
    sources = {path.name: path for path in (ROOT / "gearfmu" / "kernel" / "src").rglob("gk_*.*")}
    for file, names in re.findall(r"\b(gk_\w+\.(?:c|h|inc))\b(?: \(([\w, ]+)\))?", text.replace("`", "")):
        source = sources[file].read_text(encoding="utf-8") if file in sources else ""
        missing += [f"{file} {name}" for name in names.split(", ") if not source or "_" in name and name not in source]
    assert not missing


def _exists(path: Path, test: str) -> bool:
    return path.exists() and (not test or f"def {test}(" in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", TODAY, ids=lambda p: str(p.relative_to(ROOT)))
def test_verbs_and_options_it_shows_are_real(page: Path) -> None:
    """In code blocks and code spans; remarks behind # and other commands of a line are no options."""
    shown = re.findall(
        r"(?:^|`|\$ )gearfmu ([a-z]+)\b([^`\n#|;]*)", page.read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    wrong = [(verb, option) for verb, rest in shown for option in _options(rest) if option not in _known(verb)]
    assert not wrong


def _options(text: str) -> list[str]:
    return re.findall(r"(?:^| )(--[a-z-]+)", re.sub(r'"[^"]*"', "", text))


@functools.cache
def _known(verb: str) -> set[str]:
    module, name = cli.VERBS[verb][0].split(":")
    command = getattr(importlib.import_module(module), name)
    return {"--help", *(option for param in command.params for option in param.opts)}


def _program(command: str) -> str:
    """A command that begins with its file: `python -m evidence.price.phases` with evidence/price/phases.py."""
    module, _, rest = command.removeprefix("python -m ").partition(" ")
    return f"{module.replace('.', '/')}.py {rest}" if command.startswith("python -m evidence.") else command


def test_every_claim_names_what_shows_it() -> None:
    """The right column of docs/validation.md names tests, files of benchmarks or commands that exist."""
    text = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8").partition("## When the tables were made")[0]
    claims = re.findall(r"^\| (?!claim)(.+) \| (.+) \|$", text, re.M)
    assert len(claims) > 90
    for claim, shown in claims:
        names = re.findall(r"`([^`]+)`", shown)
        paths = [_program(name).split()[0].partition("::") for name in names]
        files = [(path, test) for path, _, test in paths if path.startswith(("tests/", "evidence/", "."))]
        known = [_exists(ROOT / path, test) for path, test in files]
        assert all(known) and (known or names and names[0].startswith(("make ", "gearfmu "))), claim


def test_every_theme_of_decisions_is_listed_once_with_its_newest_record() -> None:
    """Likewise notes; and no decision has two records of the same heading."""
    text, headings = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8"), []
    rows = re.findall(r"^\| \[.+\]\((\S+)\) \| (\d+) \| ([\d-]+): (.+) \|$", text, flags=re.MULTILINE)
    pages = [path for folder in ("decisions", "notes") for path in (ROOT / "docs" / folder).glob("*.md")]
    assert sorted(row[0] for row in rows) == sorted(f"{page.parent.name}/{page.name}" for page in pages)
    for page, count, day, newest in rows:
        found = re.findall(r"^## (.+)\n\n\*([\d-]+)", (ROOT / "docs" / page).read_text(encoding="utf-8"), flags=re.M)
        assert (int(count), newest, day) == (len(found), *found[0]), page
        assert day == max(record for _, record in found), page
        headings += [heading for heading, _ in found]
    assert len(headings) == len(set(headings))


def test_version_and_date_are_the_same_everywhere() -> None:
    """pyproject.toml has the version; the newest release of the changelog and CITATION.cff say the same."""
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), flags=re.M)
    released = re.search(r"^## \[(\d.+)\] - (\S+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.M)
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert version and released and version[1] == released[1]
    assert f"\nversion: {version[1]}\n" in cited and f"\ndate-released: {released[2]}\n" in cited


@pytest.mark.parametrize("page", [p for p in PAGES if "reduced_models" not in p.parts], ids=lambda p: p.name)
def test_sentences_are_short_and_words_are_the_fields(page: Path) -> None:
    found = prose.faults(page.read_text(encoding="utf-8"))
    assert len(found) <= KNOWN.get(page.name, 0), "\n".join(found)


def test_prose_is_counted() -> None:
    long = "A sentence " + "of words " * 20 + "ends."
    text = (
        f"# What a head\n\n{long} It is short.\n\n- it [goes on](what.md) `what`\n\n```\nwhat\n```\n| what | {long} |\n"
    )
    assert [fault.split()[0] for fault in prose.faults(text)] == ["A", "A", "goes", "what"]


NUMBER = r"\d+(?:\.\d+)?[a-z]?[′″]?"  # of a section or an equation of the theory


def _listed() -> dict[str, str]:
    """Equations of every section by its heading, as docs/theory.md lists them."""
    text = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8").partition("## Sections and equations")[2]
    return dict(re.findall(r"^\| \[(\d.*)\]\(theory/\S+\) \| (.+) \|$", text, flags=re.MULTILINE))


def test_the_theory_lists_every_section_with_its_equations() -> None:
    """An equation ends its line with its number, which is given once; chapters without sections are one row."""
    found = {}
    for page in sorted((ROOT / "docs" / "theory").glob("*.md")):
        pieces = re.split(r"^##? (\d.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
        heads = list(zip(pieces[::2], pieces[1::2], strict=True))
        found |= dict(heads[1:] or heads)
    numbers = {
        head: re.findall(rf"^ {{4}}.* \(({NUMBER})\)$", text, flags=re.MULTILINE) for head, text in found.items()
    }
    listed = {head: re.findall(rf"\(({NUMBER})\)", row) for head, row in _listed().items()}
    assert listed == {head: sorted(row, key=lambda n: (int(re.split(r"\D", n)[0]), n)) for head, row in numbers.items()}
    every = [number for row in numbers.values() for number in row]
    assert len(every) == len(set(every)) > 90


def test_sections_and_equations_that_are_cited_exist() -> None:
    """`docs/theory.md, 3.4`, `theory, eqs. 7 and 8`: in sources, tests, programs of evidence and pages."""
    known = {number for head, row in _listed().items() for number in re.findall(rf"\(({NUMBER})\)", row)}
    known |= {part for head in _listed() for part in (head.split()[0], head.split(".")[0].split()[0])}
    one = rf"(?:eqs?\. )?\(?{NUMBER}\)?"
    cited = re.compile(rf"\btheory(?:\.md)?,? ({one}(?:(?:,| and) {one})*)")
    kinds = {"gearfmu": ("py", "c", "h", "inc"), "tests": ("py",), "evidence": ("py",)}
    paths = [path for folder, ends in kinds.items() for end in ends for path in (ROOT / folder).rglob(f"*.{end}")]
    missing, seen = [], 0
    for path in [*PAGES, *paths]:
        text = re.sub(r"\s+(?:[*#] )?", " ", path.read_text(encoding="utf-8"))
        for found in cited.findall(text):
            wrong = set(re.findall(NUMBER, found)) - known
            missing += [f"{path.relative_to(ROOT)}: {found}"] if wrong else []
            seen += 1
    assert seen > 100 and not missing


def test_pages_are_those_of_the_tables() -> None:
    for name, text in (("variables", variables.variables_page()), ("effects", effects_page())):
        assert (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") == text, "run: make docs"
    source = (ROOT / "gearfmu" / "kernel" / "src" / "model" / "gk_variables.inc").read_text(encoding="utf-8")
    rows = variables.rows()
    assert len(rows) == len(re.findall(r"GK_(?:REAL|INTEGER|BOOLEAN|ENUM), GK_", source)), "every row is read"
    assert all(row.description and row.exists in variables.WHEN for row in rows)


# ---- the site --------------------------------------------------------------------------------------------------------
SITE_LINK = re.compile(r'<(\w+)\b([^>]*?)\b(?:href|src)="?([^" >]+)')
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
        for tag, before, link in SITE_LINK.findall(text):
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


# ---- the page of the package -----------------------------------------------------------------------------------------
PACKAGE_LINK = re.compile(r"(!?)\[[^\[\]]*\]\(([^)\s]+)\)")


def test_links_of_the_package_page_are_addresses_of_files_that_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    runpy.run_path(str(ROOT / "setup.py"))
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    source, version = (re.search(rf'^{key} = "(.+)"$', project, re.M) for key in ("Source", "version"))
    assert source and version
    ours, theirs = (ROOT / "README.md").read_text(encoding="utf-8"), given["long_description"]
    assert PACKAGE_LINK.sub("", ours) == PACKAGE_LINK.sub("", theirs), "nothing else of the page changes"
    links = PACKAGE_LINK.findall(theirs)
    assert len(links) == len(PACKAGE_LINK.findall(ours)) > 40 and all("://" in link for _, link in links)
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
    web = Path(report.__file__).with_name("web")
    assert (web / "plotly.min.js").stat().st_size > 1e6
    assert "MIT" in (web / "plotly.LICENSE").read_text(encoding="utf-8")
