"""Golden runs: a refactoring of the kernel must not change one bit of them, and where a change is meant, eight numbers
beside each hash show how far it went.

Every integrator, kind of stage, effect and calculation once (golden_stages.py), in single and double build:

    PYTHONPATH=. python tests/kernel/golden.py            what moved, by how much
    PYTHONPATH=. python tests/kernel/golden.py --write    stores what this kernel gives, in a commit that says why

The stored models of golden_stages.py are written by --write-models (golden_models.py), which changes their runs too.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from golden_models import write_models
from golden_stages import cases
from probes import build

FILE = Path(__file__).parents[1] / "reference" / "golden_runs.json"
REALS = ("float", "double")

Results = dict[str, dict[str, Any]]  # run → "bits" and its numbers


def results(library: Path | None = None, part: str = "") -> Results:
    """Of the runs with this build of the kernel; part: of their names."""
    return {name: answer(library).result for name, answer in cases() if part in name}


def stored(real: str = "float", part: str = "") -> Results:
    """What the file says of a build ("float", "double")."""
    known = json.loads(FILE.read_text(encoding="utf-8"))[real]
    return {name: run for name, run in known.items() if part in name}


def moved(known: Results, found: Results) -> list[str]:
    """A line for every run with other bits: the numbers that differ in six digits, before and after."""
    lines = []
    for name in sorted(known.keys() | found.keys()):
        old, new = known.get(name, {}), found.get(name, {})
        if old != new:
            numbers = [key for key in old.keys() | new.keys() if key != "bits" and old.get(key) != new.get(key)]
            said = [f"{key} {old.get(key, '-')} → {new.get(key, '-')}" for key in sorted(numbers)]
            lines.append(f"{name}: {', '.join(said) or 'beyond six digits'}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description="Golden runs of the kernel.")
    parser.add_argument("--write", action="store_true", help="store what this kernel gives")
    parser.add_argument("--library", type=Path, help="compare this build of the kernel")
    parser.add_argument("--only", default="", help="a part of the names of runs to compare")
    parser.add_argument("--real", choices=REALS, default="float", help="its type of modal rows and states")
    parser.add_argument("--write-models", action="store_true", help="make and store the small models, nothing else")
    chosen = parser.parse_args()
    if chosen.write_models:
        return write_models()
    found = {}
    for real in [chosen.real] if chosen.library else REALS:
        with tempfile.TemporaryDirectory() as folder:
            found[real] = results(chosen.library or build(Path(folder), real=real), chosen.only)
    if chosen.write and not chosen.library and not chosen.only:
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        return
    other = [f"{real} {line}" for real in found for line in moved(stored(real, chosen.only), found[real])]
    print(f"{sum(map(len, found.values()))} runs, {len(other)} moved", *other, sep="\n  ")
    sys.exit(min(len(other), 99))


if __name__ == "__main__":
    main()
