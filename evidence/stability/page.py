"""docs/stability.md from the table: python -m evidence.stability.page TABLE docs/stability.md."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from evidence.stability.case import CASES
from evidence.stability.checks import ENERGY
from evidence.stability.planetary import PlanetSet
from evidence.stability.scenes import SCENES
from evidence.stability.suite import Row, read
from gearfmu.files import write_text

HEAD = """# Hard cases

For users who ask how much a stage survives, and for developers who change the kernel. With this page you can run a \
hard case, read its row and judge a failure.

The suite has {scenes} scenes: lost contact, overload, jammed teeth, clutch dumps, pin errors, rollbacks and very long \
runs. An event is written once and drawn over pairs, trains and planetary sets. Each scene runs at level `fast` with \
the kernel's default step, half and a quarter of it, and at `standard` and `full` with the default step.

```
python -m evidence.stability --list                                         # every scene: event and checks
python -m evidence.stability --level fast --h default                       # what continuous integration runs
python -m evidence.stability --scene set_rollbacks --h "5 us" --out my.csv  # one scene, another step
make stability                                                              # everything: table and this page
```

The exit code is the number of failures.

## What counts as a failure

- At the default step a scene that stops early fails. At other steps a named outcome with its last good time \
(`penetration@0.0123`) is an answer.
- At every step a scene fails when one of its checks fails. All outputs must be finite, no step may stay unsolved, the \
energy balance must close, and teeth may overlap only by their elastic deflection.
- Limits of the energy residual: {energy:g} for pairs and trains, {overload:g} in `pair_overload`, {sets:g} for \
planetary sets, {jammed:g} for the jammed set. Under 6000 N·m the balance drifts by 2e-4 at every step and level, so \
the drift belongs to the model, not to the step.
- Overlap limit: the deflection of the softest tooth pair under the largest force of the communication step, plus \
7.5 µm for tip relief.
- Chaotic scenes are judged by statistics: share of lost contact, impact rate, band levels, impulse.

Scenes that begin with `set_` run on `planetary54` with three pins out of place (12 µm ahead, 6 µm outward, 8 µm \
behind). Equal planets on ideal pins would hide the modes of sun and carrier. Runs of a set last hundredths of a \
second; 10 s, 1e7 steps and 10⁴ rollbacks ran through on 2026-11-27. No scene gives sets pitch errors.

## Results

"""
TABLE_HEAD = """
CPU seconds per simulated second are those of level `fast` at the default step on a shared machine, with all outputs \
read.

| stage | scenes | cases run | failed | largest energy residual of the others | CPU s/s, median | most |
|---|---|---|---|---|---|---|
"""
TAIL = """
The rows were made <!-- made: stability --><!-- -->. A step whose energy balance has no root is solved without it and \
counts as unsolved ([theory](theory.md)); the rest shows in the energy residual.

## The table

[stability.csv](../evidence/stability/stability.csv) has a row for each case; `stability.json` beside it has the \
statistics of each run. The site draws the table below.

| column | meaning |
|---|---|
| `h_s` | internal step, s |
| `outcome` | `completed`; the kernel's outcome @ last good time, s; `failed`: the end was reached, a check failed |
| `energy_residual` | largest change of stored energy − work + dissipation, over port energy (sum of magnitudes) plus \
largest stored energy |
| `penetration_m` | largest overlap of undeformed involutes at communication points, m: elastic approach under load |
| `realtime_factor` | CPU seconds per simulated second |

The default step is the largest at which γ stays 1 ([theory](theory.md), 3.5). At its half and quarter γ may be \
lowered, which costs accuracy but no energy; bit 8 of `status` in the statistics reports it.

<!-- csv: evidence/stability/stability.csv -->
"""
KINDS = {"pair": "gear pair", "train": "train of two meshes", "set": "planetary set"}


def page(rows: Sequence[Row]) -> str:
    """The page as Markdown: how to run, rules of failure, one line for each kind of stage, columns of the table."""
    own = {name: SCENES[f"{kind}_{name}"].numbers["energy"] for kind, name in (("pair", "overload"), ("set", "jammed"))}
    head = HEAD.format(scenes=len(SCENES), energy=ENERGY, sets=PlanetSet.energy, **own)
    lines = [head, _summary(rows), TABLE_HEAD]
    lines += [_line(said, [row for row in rows if row.scene.startswith(kind)]) for kind, said in KINDS.items()]
    return "".join([*lines, TAIL])


def _summary(rows: Sequence[Row]) -> str:
    failed = [row for row in rows if row.failed]
    names = "".join(f"\n- {r.scene}, {r.case.level}, {r.case.step}: {'; '.join(r.finding.complaints)}" for r in failed)
    return f"{len(rows)} of {len(SCENES) * len(CASES)} cases run, {len(failed)} failed.{names}\n"


def _line(kind: str, rows: Sequence[Row]) -> str:
    scenes = {row.scene for row in rows}
    residual = max(row.finding.energy_residual for row in rows if not row.failed)
    default = [row for row in rows if (row.case.level, row.case.step) == ("fast", "default")]
    prices = sorted(row.finding.realtime_factor for row in default)
    failed = sum(row.failed for row in rows)
    counts = f"{len(scenes)} | {len(rows)} | {failed} | {residual:.1e}"
    return f"| {kind} | {counts} | {prices[len(prices) // 2]:.2g} | {prices[-1]:.2g} |\n"


if __name__ == "__main__":
    write_text(Path(sys.argv[2]), page(read(Path(sys.argv[1]))))
