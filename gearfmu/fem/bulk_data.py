"""Text of mesh and matrix files, and Nastran's bulk data in it: cards, SET cards, and what meshio would read wrongly.

Source: bulk data formats as described in the Quick Reference Guides of Nastran.
"""

from __future__ import annotations

import re
from pathlib import Path

from gearfmu.errors import MeshError

_SET = re.compile(r"\s*SET\s+(\w+)\s*=\s*(.*)", re.IGNORECASE)
_RANGE = re.compile(r"(\d+)\s+THRU\s+(\d+)", re.IGNORECASE)


def mesh_text(path: Path) -> str:
    """The text of a file. MeshError where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise MeshError(f"{path}: the file cannot be read ({error.strerror}): check the path") from None


def bulk_cards(path: Path) -> list[list[str]]:
    """Bulk data cards as lists of fields, continuation lines joined (eight or four fields a line). MeshError for a file
    that cannot be read."""
    cards: list[list[str]] = []
    for line in mesh_text(path).splitlines():
        line = line.split("$")[0].rstrip()
        if not line:
            continue
        head, *body = card_fields(line)
        if head.startswith(("*", "+")) or not head:
            if cards:
                cards[-1] += body
        else:
            width = 8 if "*" not in head else 4
            cards.append([head.upper(), *(body + [""] * width)[:width]])
    return cards


def card_fields(line: str) -> list[str]:
    """Fields of a line of a card in free, small or large format; the first is the card's name."""
    if "," in line:
        return [field.strip() for field in line.split(",")[:9]]
    wide = 16 if "*" in line[:8] else 8
    return [line[:8].strip(), *(line[k : k + wide].strip() for k in range(8, 72, wide))]


def bulk_number(text: str) -> float:
    """A Nastran real: 1.5, 1.5D3, 1.5+3."""
    text = text.upper().replace("D", "E")
    for sign in "+-":
        place = text.rfind(sign)
        if place > 0 and text[place - 1] not in "E+-":
            text = f"{text[:place]}E{text[place:]}"
    return float(text)


def nastran_sets(path: Path) -> dict[str, list[int]]:
    """Node numbers of `SET n = 1, 2, 7 THRU 9` (case control) by the set's number as text: "n"."""
    sets: dict[str, list[int]] = {}
    lines = iter(mesh_text(path).splitlines())
    for line in lines:
        found = _SET.match(line.split("$")[0])
        if not found:
            continue
        body = found[2].strip()
        while body.endswith(","):
            body += next(lines, "").split("$")[0].strip()
        members: list[int] = []
        for item in body.split(","):
            if span := _RANGE.fullmatch(item.strip()):
                members += range(int(span[1]), int(span[2]) + 1)
            elif item.strip().isdigit():
                members.append(int(item))
        sets[found[1]] = members
    return sets


def nastran_problems(path: Path) -> str | None:
    """Why meshio would read this file wrongly, or None."""
    text = mesh_text(path)
    if "BEGIN BULK" not in text.upper():
        return f"{path}: there is no line BEGIN BULK: write the whole input file, not only the cards"
    if "ENDDATA" not in text.upper():
        return f"{path}: there is no line ENDDATA: the file ends early"
    for number, line in enumerate(text.splitlines(), start=1):
        if line.upper().startswith("GRID") and (system := [*card_fields(line), "", ""][2]) not in ("", "0"):
            return (
                f"{path}:{number}: a GRID in coordinate system {system}, which is not applied here: write the nodes in "
                "the basic system"
            )
        if line.upper().startswith("INCLUDE"):
            return f"{path}:{number}: INCLUDE is not followed: write one file"
    return None
