"""The README's chart of error against time, from the study's table: python docs/pictures/cost.py [study.csv]"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib import rc_context

from gearfmu.files import written_whole
from gearfmu.report.study import draw
from gearfmu.report.style import panels, styled
from gearfmu.study import Row
from gearfmu.study.table import read_rows

HERE = Path(__file__).parent
SCENE, SLICES = "pair_loaded", 5

table = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE.parents[1] / "benchmarks" / "study" / "study.csv"
rows = [row for row in read_rows(table, Row) if row.scene == SCENE and row.slices == SLICES]
if not rows:
    sys.exit(f"{table} has no rows of {SCENE}: make study")
with styled(), rc_context({"svg.hashsalt": "cost"}):
    figure, axes = panels((2.6, 2.2))
    for name, panel in zip(("te", "force"), axes, strict=True):
        draw(panel, rows, SLICES, name)
    axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes[-1].set_xlabel("processor time of the stage per simulated second")
    with written_whole(HERE / "cost.svg") as temporary:
        figure.savefig(temporary, format="svg", metadata={"Date": None})
