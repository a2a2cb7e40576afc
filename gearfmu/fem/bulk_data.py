"""Text of mesh and matrix files, and Nastran's bulk data cards in it.

Source: bulk data formats as described in the Quick Reference Guides of Nastran.
"""

from __future__ import annotations

from pathlib import Path

from gearfmu.errors import MeshError


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
