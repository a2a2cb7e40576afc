"""What meshio does not read of a Nastran bulk data file: SET cards, and coordinate systems, which are refused."""

from __future__ import annotations

import re
from pathlib import Path

from gearfmu.fem.bulk_data import card_fields, mesh_text

_SET = re.compile(r"\s*SET\s+(\w+)\s*=\s*(.*)", re.IGNORECASE)
_RANGE = re.compile(r"(\d+)\s+THRU\s+(\d+)", re.IGNORECASE)


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
