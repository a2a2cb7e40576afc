"""The documentation keeps its word: links lead somewhere, tests it names exist, commands it shows are real."""

from __future__ import annotations

import functools
import importlib
import json
import re
from pathlib import Path

import prose
import pytest

from evidence.pages import variables
from evidence.pages.effects import effects_page
from gearfmu import cli

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "reduced_models").rglob("*.md")])
TODAY = [page for page in PAGES if page.name != "CHANGELOG.md"]  # which names verbs and options of its time


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


@pytest.mark.parametrize("page", TODAY, ids=lambda p: str(p.relative_to(ROOT)))
def test_verbs_it_shows_are_real(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    shown = re.findall(r"(?:^|`)gearfmu ([a-z]+)\b", text, flags=re.MULTILINE)
    assert not set(shown) - set(cli.VERBS)


@pytest.mark.parametrize("page", TODAY, ids=lambda p: str(p.relative_to(ROOT)))
def test_options_it_shows_are_those_of_their_verb(page: Path) -> None:
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


@pytest.mark.parametrize("page", [p for p in PAGES if "docs" in p.relative_to(ROOT).parts], ids=lambda p: p.name)
def test_a_page_begins_with_its_reader(page: Path) -> None:
    assert re.match(r"# .+\n\nFor ", page.read_text(encoding="utf-8"))


def _claims() -> list[tuple[str, str]]:
    """Claims of docs/validation.md and what shows them; the list of dated tables is another one."""
    text = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8").partition("## When the tables were made")[0]
    return re.findall(r"^\| (.+) \| (.+) \|$", text, re.M)


def _program(command: str) -> str:
    """A command that begins with its file: `python -m evidence.price.phases` with evidence/price/phases.py."""
    module, _, rest = command.removeprefix("python -m ").partition(" ")
    return f"{module.replace('.', '/')}.py {rest}" if command.startswith("python -m evidence.") else command


def test_every_claim_names_what_shows_it() -> None:
    """The right column of docs/validation.md names tests, files of benchmarks or commands that exist."""
    rows = _claims()
    claims = [(claim, shown) for claim, shown in rows if (claim, shown) != ("claim", "shown by")]
    assert len(claims) > 90
    for claim, shown in claims:
        names = re.findall(r"`([^`]+)`", shown)
        paths = [_program(name).split()[0].partition("::") for name in names]
        files = [(path, test) for path, _, test in paths if path.startswith(("tests/", "evidence/", "."))]
        known = [_exists(ROOT / path, test) for path, test in files]
        assert all(known) and (known or names and names[0].startswith(("make ", "gearfmu "))), claim


def test_a_tolerance_of_a_claim_stands_in_its_test() -> None:
    """`within 2.5e-4` in docs/validation.md is a number of a test file named beside it."""
    rows = _claims()
    checked = 0
    for claim, shown in rows:
        wanted = {float(number) for number in re.findall(r"within (\d[\d.]*e-\d+)", claim)}
        files = re.findall(r"`(tests/[\w/]+\.py)", shown)
        if not files or not wanted:
            continue
        text = "".join((ROOT / name).read_text(encoding="utf-8") for name in files)
        assert wanted <= {float(number) for number in re.findall(r"\b\d[\d.]*e-\d+", text)}, claim
        checked += len(wanted)
    assert checked >= 3


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_functions_of_the_kernel_that_it_names_exist(page: Path) -> None:
    """`gk_flank.c`, with or without names of its functions in brackets."""
    sources = {path.name: path for path in (ROOT / "gearfmu" / "kernel" / "src").rglob("gk_*.*")}
    text = page.read_text(encoding="utf-8").replace("`", "")
    named = re.findall(r"\b(gk_\w+\.(?:c|h|inc))\b(?: \(([\w, ]+)\))?", text)
    missing = [file for file, _ in named if file not in sources]
    functions = [(file, name) for file, names in named if file in sources for name in names.split(", ") if "_" in name]
    missing += [f"{file}: {name}" for file, name in functions if name not in sources[file].read_text(encoding="utf-8")]
    assert not missing


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


def test_every_page_is_in_the_site() -> None:
    """The navigation of mkdocs.yml holds the pages of docs/, and those that the site takes from outside."""
    listed = re.findall(r"- ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), flags=re.MULTILINE)
    pages = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert len(listed) == len(set(listed))
    assert set(listed) == pages | {"index.md", "changelog.md", "contributing.md"}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_anchors_of_links_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#:]*)#([^)]+)\)", text)
    broken = [f"{t}#{anchor}" for t, anchor in links if anchor not in _anchors(page.parent / t if t else page)]
    assert not broken


def _anchors(page: Path) -> set[str]:
    """Anchors that headings get: small letters, what is no letter or digit left out, spaces as hyphens."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_version_and_date_are_the_same_everywhere() -> None:
    """pyproject.toml has the version; the newest release of the changelog and CITATION.cff say the same."""
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), flags=re.M)
    released = re.search(r"^## \[(\d.+)\] - (\S+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.M)
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert version and released and version[1] == released[1]
    assert f"\nversion: {version[1]}\n" in cited and f"\ndate-released: {released[2]}\n" in cited


def test_make_targets_named_in_the_readme_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for page in PAGES:
        for target in re.findall(r"`make ([a-z-]+)`", page.read_text(encoding="utf-8")):
            assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), f"{page.name}: make {target}"


def test_prose_gets_no_worse() -> None:
    """Long sentences and banned words of a page: tests/prose.json may only fall."""
    limits = json.loads(prose.LIMITS.read_text(encoding="utf-8"))
    worse = []
    for page in prose.PAGES:
        found, most = prose.counts(page), limits.get(prose.name(page), [0, 0])
        if found[0] > most[0] or found[1] > most[1]:
            worse.append(
                f"{prose.name(page)}: {found} instead of {most}; see `python tests/prose.py {prose.name(page)}`"
            )
    assert not worse, "\n".join(worse)


def test_prose_is_counted() -> None:
    long = "A sentence " + "of words " * 20 + "ends."
    text = (
        f"# What a head\n\n{long} It is short.\n\n- it [goes on](what.md) `what`\n\n```\nwhat\n```\n| what | {long} |\n"
    )
    assert [s.split()[0] for s in prose.too_long(text)] == ["A", "A"]
    assert prose.banned(text) == ["goes on", "what"]


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


def test_the_way_of_a_number_names_what_there_is() -> None:
    """The first drawing of docs/architecture.md: every function, class and file is in the package before its colon, and
    every value is a class."""
    drawing = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").split("```")[1]
    places = re.findall(r"([a-z/]+): (\w[\w., ]+)", "\n".join(line[50:] for line in drawing.splitlines()))
    missing = []
    for package, names in places:
        files = list((ROOT / "gearfmu" / package).rglob("*.py"))
        text = "".join(path.read_text(encoding="utf-8") for path in files)
        for name in re.findall(r"[\w.]+", names):
            defined = re.search(rf"^(?:def|class) {name}\b|^{name}(?:: | = )", text, flags=re.MULTILINE)
            missing += [] if defined or name in {path.name for path in files} else [f"{package}: {name}"]
    values = {name for line in drawing.splitlines()[2:] for name in re.findall(r"\b[A-Z]\w*[a-z]\w*\b", line[24:50])}
    every = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "gearfmu").rglob("*.py"))
    missing += [name for name in values if not re.search(rf"^class {name}\b", every, flags=re.MULTILINE)]
    assert len(places) > 15 and len(values) > 10 and not missing


def test_pages_are_those_of_the_tables() -> None:
    for name, text in (("variables", variables.variables_page()), ("effects", effects_page())):
        assert (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8") == text, "run: make docs"


def test_every_row_of_the_kernels_table_is_read() -> None:
    source = (ROOT / "gearfmu" / "kernel" / "src" / "model" / "gk_variables.inc").read_text(encoding="utf-8")
    found = variables.rows()
    assert len(found) == len(re.findall(r"GK_(?:REAL|INTEGER|BOOLEAN|ENUM), GK_", source))
    assert all(row.description and row.exists in variables.WHEN for row in found)
