"""Faults of a page's prose: sentences that are too long, words that the pages should do without.

`python tests/prose.py PAGE …` prints those of the named pages."""

from __future__ import annotations

import re
import sys
from pathlib import Path

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


def faults(text: str) -> list[str]:
    """Sentences of more than LONGEST words, numbers and symbols not counted; and every banned word."""
    long = [s for s in sentences(text) if sum(bool(re.search(r"[^\W\d_]{2}", word)) for word in s.split()) > LONGEST]
    return long + [match[0].lower() for match in BANNED.finditer(prose(text))]


if __name__ == "__main__":
    for given in map(Path, sys.argv[1:]):
        print(given, *faults(given.read_text(encoding="utf-8")), sep="\n- ")
