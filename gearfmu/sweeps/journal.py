"""Results of a sweep's points, kept in order of arrival: JSON lines, one a point, so that an interrupted sweep is
continued."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from gearfmu.report.results import strict
from gearfmu.sweeps.points import Outcome


class Journal:
    """The file points.jsonl of a folder. Lines that end in the middle, of a process that was killed, are left out."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known = dict(_lines(path))
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file() and not path.read_bytes().endswith(b"\n"):
            with path.open("a", encoding="utf-8") as file:
                file.write("\n")

    def get(self, identity: str) -> Outcome | None:
        """Outcome of a point, None where it was not computed."""
        return self._known.get(identity)

    def add(self, identity: str, outcome: Outcome) -> None:
        """One more point; its trace is not kept here."""
        known = self._known[identity] = replace(outcome, trace=None)
        plain = asdict(known)
        del plain["trace"]
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"identity": identity, **strict(plain)}, ensure_ascii=False) + "\n")


def _lines(path: Path) -> list[tuple[str, Outcome]]:
    found = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            entry = json.loads(line)
            found.append((entry.pop("identity"), Outcome(**_with_nan(entry))))
        except (ValueError, KeyError, TypeError):
            continue
    return found


def _with_nan(entry: dict[str, Any]) -> dict[str, Any]:
    """The inverse for the numbers of a row and a curve."""
    row = {key: math.nan if value is None else value for key, value in entry["row"].items()}
    curve = {key: [math.nan if v is None else v for v in values] for key, values in entry["curve"].items()}
    return entry | {"row": row, "curve": curve}
