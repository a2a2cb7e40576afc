"""Counts over the Python code that may only fall: tests/ratchets.json.

`python tests/ratchets.py` lowers the limits to today's counts, raises none, and prints both."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMITS = Path(__file__).with_suffix(".json")
KINDS = (
    r"isinstance\([\w.]+, \(?(?:PlanetarySpec|StageSpec|Stage)\b"
    r"|\.kind [!=]= \"(?:planetary_set|general|external_pair)\""
)


def matches(pattern: str, paths: Iterable[Path]) -> int:
    """How often a pattern occurs in files."""
    return sum(len(re.findall(pattern, path.read_text(encoding="utf-8"))) for path in paths)


def counts() -> dict[str, int]:
    """Every count by its name."""
    product, spec = sorted((ROOT / "gearfmu").rglob("*.py")), ROOT / "gearfmu" / "stagefile"
    tests = [path for path in sorted((ROOT / "tests").rglob("*.py")) if path != Path(__file__)]
    return {
        "Any": matches(r"\bAny\b(?!,|$)", product),
        "getattr": matches(r"\bgetattr\(", product),
        "forks on the kind of a stage below spec": matches(KINDS, (p for p in product if spec not in p.parents)),
        "changes of sys.path in tests": matches(r"\bsys\.path\b", tests),
    }


def limits() -> dict[str, int]:
    """The counts that are allowed."""
    return dict(json.loads(LIMITS.read_text(encoding="utf-8")))


if __name__ == "__main__":
    now, before = counts(), limits() if LIMITS.exists() else {}
    for name, count in now.items():
        print(f"{name}: {count}, at most {before.get(name, count)}")
    lower = {name: min(count, before.get(name, count)) for name, count in now.items()}
    LIMITS.write_text(json.dumps(lower, indent=1) + "\n", encoding="utf-8")
