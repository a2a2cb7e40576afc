"""docs/stability.md from the table: `python -m gearfmu.stability.page benchmarks/stability.csv docs/stability.md`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from gearfmu.files import write_text
from gearfmu.stability.case import LEVELS, STEPS
from gearfmu.stability.checks import ENERGY
from gearfmu.stability.loads import OVERLOAD_ENERGY
from gearfmu.stability.scenes import SCENES, what
from gearfmu.stability.set_bench import SET_ENERGY
from gearfmu.stability.set_loads import JAMMED_ENERGY
from gearfmu.stability.suite import COLUMNS, Row, in_order, read

HEAD = """# Hard cases

This page is made from the table that `make stability` writes, by `python -m gearfmu.stability.page`. `make
evidence-check` says whether it is of the present kernel; `make stability` runs only the rows that are not.

```
gearfmu stability                                            # everything; two hours of one core
gearfmu stability --level fast --h default                   # what continuous integration runs
gearfmu stability --scene rollbacks --h "5 us" --out my.csv  # one scene, another step; a later call goes on with my.csv
```

Levels `fast`, `standard`, `full`; internal steps: the kernel's default, half and a quarter of it. Exit code: the
number of failures. At the default step every scene must run through; at other steps a named outcome with its last good
time (`penetration@0.0123`) is an answer too. What a scene complains of is a failure at every step.

| column | meaning |
|---|---|
| `h_s` | internal step in use, s |
| `outcome` | `completed`; the kernel's outcome @ last good time, s; `failed`: reached its end, but not as it must |
| `energy_residual` | largest change in the run of stored energy − work + dissipation, over the energy that passed \
through the ports (sum of magnitudes) plus the largest stored energy |
| `penetration_m` | largest overlap of the undeformed involutes at the positions of the bore nodes, at communication \
points: the elastic approach under load; what the contact law itself lets through is zero |
| `realtime_factor` | CPU seconds per simulated second on a shared machine, reading of all outputs included |

Every scene is asked that all outputs be finite, that the energy balance close to {energy:g} ({overload:g} in
`overload`: under 6000 N·m the balance drifts by 2e-4 at every step and level, so it is the model's and not the
scheme's), and that flanks overlap at no sample by more than what the largest force of its communication step
presses the softest tooth pair, plus 7.5 µm for tip relief. In planetary sets overlap is taken between the places of
planets, sun and ring, and their balance must close to {sets:g} ({jammed:g} jammed). Chaotic scenes are judged by
statistics: contact-loss share, impact rate, band levels, impulse.

The kernel's default is the largest step that needs no lowered γ (theory, 3.5); at its half and quarter γ may be lowered
(bit 8 of the `status` under Statistics), which costs accuracy and no energy. Bit 1: local law beyond its range.

Scenes that begin with `set_` run on `planetary54` with three of its pins out of place (12 µm ahead, 6 µm outward, 8 µm
behind): equal planets on ideal pins hide the modes of sun and carrier. A step of them takes 0.2 to 0.5 ms, so that they
last hundredths of a second, 0.1 s at standstill, 2e4 steps and 400 rollbacks; 10 s, 1e7 and 10⁴ are runs of their own
at level `fast`: `benchmarks/set_endurance.py`. No scene gives sets pitch errors; their pins take that place.

## Scenes

| scene | what happens, and what must be seen |
|---|---|
"""


def page(rows: Sequence[Row]) -> str:
    """The page as Markdown: how to run, the scenes, the table, statistics of the runs."""
    lines = [HEAD.format(energy=ENERGY, overload=OVERLOAD_ENERGY, sets=SET_ENERGY, jammed=JAMMED_ENERGY)]
    lines += [f"| `{name}` | {what(name)} |\n" for name in SCENES]
    lines += ["\n## Table\n\n", _summary(rows), "\n| " + " | ".join(COLUMNS) + " |\n", "|---" * len(COLUMNS) + "|\n"]
    lines += [_line(row) for row in in_order(rows)]
    lines += ["\n## Statistics\n\n| scene | level | h_s | statistics |\n|---|---|---|---|\n"]
    for row in in_order(rows):
        facts = ", ".join(f"{name} {value:.4g}" for name, value in row.finding.facts.items())
        lines.append(f"| {row.scene} | {row.case.level} | {row.finding.h:.3g} | {facts} |\n")
    return "".join(lines)


def _summary(rows: Sequence[Row]) -> str:
    failed = [row for row in rows if row.failed]
    names = "".join(f"\n- {r.scene}, {r.case.level}, {r.case.step}: {'; '.join(r.finding.complaints)}" for r in failed)
    every = len(SCENES) * len(LEVELS) * len(STEPS)
    return f"{len(rows)} of {every} cases run, {len(failed)} failed.{names}\n"


def _line(row: Row) -> str:
    f = row.finding
    numbers = f"{f.energy_residual:.1e} | {f.penetration:.2e} | {f.realtime_factor:.2g}"
    return f"| {row.scene} | {row.case.level} | {f.h:.3g} | {f.outcome} | {numbers} |\n"


if __name__ == "__main__":
    write_text(Path(sys.argv[2]), page(read(Path(sys.argv[1]))))
