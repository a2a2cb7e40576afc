"""The planetary set for long: 10⁴ rollbacks, 10 s at standstill under 600 N·m and 1e7 internal steps at 85 rad/s, level
fast at its default step, judged as the hard cases `set_rollbacks`, `set_standstill` and `set_many_steps` are; the last
is sampled once in a mesh period. Minutes, minutes and most of an hour.

    python evidence/set_endurance.py [--rollbacks 10000] [--seconds 10] [--steps 10000000]
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from stability.case import Case, Finding
from stability.set_stepping import astray_for, standing_for, turning_for

from gearfmu.files import write_text

CASE = Case("fast", "default")


def told(name: str, finding: Finding) -> dict[str, object]:
    """Print a finding; what the table keeps of it."""
    line = {"run": name, **asdict(finding)}
    print(json.dumps(line, indent=1, default=str), flush=True)
    return line


def main() -> None:
    """Run all three, print and write what was found."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rollbacks", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--steps", type=int, default=10_000_000)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".json"))
    chosen = parser.parse_args()
    lines = []
    for name, found in (
        (f"{chosen.rollbacks} rollbacks", lambda: astray_for(chosen.rollbacks, CASE)),
        (f"{chosen.seconds:g} s at standstill", lambda: standing_for(chosen.seconds, CASE)),
        (f"{chosen.steps:.0e} internal steps", lambda: turning_for(chosen.steps, CASE, per_period=1)),
    ):
        lines.append(told(name, found()))
        write_text(chosen.out, json.dumps(lines, indent=1, default=str) + "\n")


if __name__ == "__main__":
    main()
