"""The README's chart of error against time, from the study's tables: python -m evidence.study.cost_chart [FOLDER]"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib import rc_context

from evidence.study.sets import SetRow, ladder
from gearfmu.files import written_whole
from gearfmu.report.study import draw
from gearfmu.report.style import COLOURS, panels, styled
from gearfmu.study.table import Row, read_rows

HERE = Path(__file__).resolve().parent
PICTURE = HERE.parents[1] / "docs" / "pictures" / "cost.svg"
SCENE, SLICES = "pair_loaded", 5
SET, PLANETS, LEVELS = "planetary_paper", 4, {"fast": "-", "full": ":"}

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
rows = [row for row in read_rows(folder / "study.csv", Row) if row.scene == SCENE and row.slices == SLICES]
of_set = ladder([row for row in read_rows(folder / "sets.csv", SetRow) if row.scene == SET], PLANETS)
if not (rows and of_set):
    sys.exit(f"{folder} has no rows of {SCENE} or {SET}: make study")
with styled(), rc_context({"svg.hashsalt": "cost"}):
    figure, axes = panels((2.6, 2.2))
    for name, panel in zip(("te", "force"), axes, strict=True):
        draw(panel, rows, SLICES, name)
        for level, dashes in LEVELS.items():
            line = sorted((row for row in of_set if row.level == level and row.te_error < 1), key=lambda row: row.h_s)
            error = [100 * getattr(row, f"{name}_error") for row in line]
            time = [row.realtime_factor for row in line]
            panel.plot(
                time,
                error,
                dashes,
                color=COLOURS[-1],
                marker="D",
                markersize=4.0,
                linewidth=1.2,
                label=f"planetary set, {level}",
            )
    axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes[-1].set_xlabel("processor time of the stage per simulated second")
    with written_whole(PICTURE) as temporary:
        figure.savefig(temporary, format="svg", metadata={"Date": None})
