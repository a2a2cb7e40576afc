"""Counts of a page's prose: sentences that are too long, words that the pages should do without.

`python tests/prose.py [PAGE …]` lowers the limits of tests/prose.json to today's counts, raises none, and prints the
faults of the named pages."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMITS = ROOT / "tests" / "prose.json"
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LONGEST = 30  # words a sentence
BANNED = re.compile(  # private jargon, people's verbs for things, clauses with "what" as subject or object
    r"\b(what|rooms?|squeezes?(?! film)|dash|ledgers?|owed?|owes|massless(?!-boundary)|rounds|strips?|troubles?|speaks?"
    r"|knows?|knew|told|tells?|(?:cyclic|two|same|this) roads?|stands?|stood|at once|lets? go|goes on|go on"
    r"|the same of|nothing of this)\b",
    flags=re.IGNORECASE,
)
CODE_BLOCK = re.compile(r"^```.*?^```", flags=re.MULTILINE | re.DOTALL)
NOT_PROSE = re.compile(r"<!--.*?-->|^\$\$.*?\$\$|^\|[-|: ]+\|$|^#[^\n]*$|^ {4}[^\n]*$", flags=re.MULTILINE | re.DOTALL)


def prose(text: str) -> str:
    """The text without code blocks, equations, headings and comments; a code span is one word, a link its text."""
    text = NOT_PROSE.sub("", CODE_BLOCK.sub("", text))
    text = re.sub(r"`[^`\n]+`", "code", text)
    return re.sub(r"!?\[([^\[\]]*)\]\([^)]*\)", r"\1", text)


def sentences(text: str) -> list[str]:
    """Sentences of running text, list items and table cells."""
    pieces = re.split(r"\n\s*\n|\n(?=\s*(?:[-*|]|\d+\.) )|(?<=\|)\n", prose(text))
    cells = [cell for piece in pieces for cell in (piece.split("|") if piece.startswith("|") else [piece])]
    return [sentence for cell in cells for sentence in re.split(r"(?<=[.?!])[)*”\"]*\s+", cell) if sentence.strip()]


def too_long(text: str) -> list[str]:
    """Sentences of more than LONGEST words; numbers and symbols do not count."""
    return [s for s in sentences(text) if sum(bool(re.search(r"[^\W\d_]{2}", word)) for word in s.split()) > LONGEST]


def banned(text: str) -> list[str]:
    """Every banned word of the prose."""
    return [match[0].lower() for match in BANNED.finditer(prose(text))]


def counts(page: Path) -> tuple[int, int]:
    """Sentences that are too long, banned words."""
    text = page.read_text(encoding="utf-8")
    return len(too_long(text)), len(banned(text))


def name(page: Path) -> str:
    """A page's path in the checkout."""
    return page.relative_to(ROOT).as_posix()


def lowered(limits: dict[str, list[int]]) -> dict[str, list[int]]:
    """Limits of pages as they are or as today's counts, whichever is lower; pages without a fault have no line."""
    found = {name(page): list(counts(page)) for page in PAGES}
    lower = {k: [min(pair) for pair in zip(found[k], limit, strict=True)] for k, limit in limits.items() if k in found}
    return {key: value for key, value in (lower or found).items() if any(value)}


if __name__ == "__main__":
    kept = json.loads(LIMITS.read_text(encoding="utf-8")) if LIMITS.exists() else {}
    lines = ",\n".join(f"  {json.dumps(key)}: {value}" for key, value in lowered(kept).items())
    LIMITS.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
    for given in map(Path, sys.argv[1:]):
        content = given.read_text(encoding="utf-8")
        print(given, *too_long(content), ", ".join(banned(content)), sep="\n- ")
