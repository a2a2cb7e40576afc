"""What the site takes from outside docs/: the README as its first page, the changelog, and every file that a page links
to. Links are those of the checkout; here they are turned into those of the site."""

from __future__ import annotations

import csv
import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
OUTER_PAGES = {"README.md": "index.md", "CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
OUTSIDE = "checkout/"  # folder of the site for what lies outside docs/
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")
CSV = re.compile(r"<!-- csv: (\S+) -->")
LIST_OR_TABLE = re.compile(r"(- |\d+\. |\|)")


def on_files(files: Files, config: Any) -> Files:
    """Adds the outer pages and the linked files of the checkout."""
    for name, page in OUTER_PAGES.items():
        if (ROOT / name).is_file():
            files.append(File.generated(config, page, content=(ROOT / name).read_text(encoding="utf-8")))
    pages = list(files.documentation_pages())
    while pages:
        for target in _targets(pages.pop()):
            place = _in_site(target)
            if place not in OUTER_PAGES.values() and files.get_file_from_path(place) is None:
                linked = File.generated(config, place, content=(ROOT / target).read_bytes())
                files.append(linked)
                pages += [linked] if linked.is_documentation_page() else []
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links as the site has them, named CSV files as tables; lists and tables begin after an empty line, which GitHub
    does not ask for."""
    folder = _folder(page.file)
    markdown = CSV.sub(lambda match: _table(ROOT / match[1]), markdown)
    return _spaced(LINK.sub(lambda match: _relinked(match, folder, page.file.src_uri), markdown))


def _table(path: Path) -> str:
    """A CSV file as a Markdown table."""
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def _relinked(match: re.Match[str], folder: PurePosixPath, page: str) -> str:
    text, link, anchor = match.groups()
    target = None if "://" in link else _target(folder, link)
    if target is None:
        return match[0]
    if (ROOT / target).is_dir():  # a site has no folders to look into
        return f"{text} (`{target}`)"
    return f"[{text}]({_up(page)}{_in_site(target)}{anchor or ''})"


def _targets(file: File) -> list[str]:
    """Files of the checkout that a page links to."""
    links = [link for _, link, _ in LINK.findall(file.content_string) if "://" not in link]
    found = (_target(_folder(file), link) for link in links)
    return [target for target in found if target is not None and (ROOT / target).is_file()]


def _folder(file: File) -> PurePosixPath:
    """The folder in the checkout of the file that a page is made from."""
    if file.src_uri in OUTER_PAGES.values():
        return PurePosixPath(".")
    outside = file.src_uri.removeprefix(OUTSIDE)
    return PurePosixPath(outside if outside != file.src_uri else f"docs/{outside}").parent


def _target(folder: PurePosixPath, link: str) -> str | None:
    """The linked place as a path in the checkout; None outside it."""
    try:
        return (ROOT / folder / link).resolve().relative_to(ROOT).as_posix()
    except ValueError:
        return None


def _in_site(target: str) -> str:
    if target in OUTER_PAGES:
        return OUTER_PAGES[target]
    inside = target.removeprefix("docs/")
    return inside if inside != target else OUTSIDE + target


def _up(page: str) -> str:
    return "../" * page.count("/")


def _spaced(markdown: str) -> str:
    lines, code, before = [], False, ""
    for line in markdown.splitlines():
        code ^= line.startswith("```")
        if not code and LIST_OR_TABLE.match(line) and before.strip() and not re.match(r"\s|- |\d+\. |\|", before):
            lines.append("")
        lines.append(line)
        before = line
    return "\n".join(lines) + "\n"
