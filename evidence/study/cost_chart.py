"""The README's chart of error against time, from the study's tables: python -m evidence.study.cost_chart"""

from __future__ import annotations

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

rows = [row for row in read_rows(HERE / "study.csv", Row) if row.scene == SCENE and row.slices == SLICES]
of_set = ladder([row for row in read_rows(HERE / "sets.csv", SetRow) if row.scene == SET], PLANETS)
with styled(), rc_context({"svg.hashsalt": "cost"}):
    figure, axes = panels((2.6, 2.2))
    for name, panel in zip(("te", "force"), axes, strict=True):
        draw(panel, rows, SLICES, name)
        for level, dashes in LEVELS.items():
            line = sorted((row for row in of_set if row.level == level and row.te_error < 1), key=lambda row: row.h_s)
            time = [row.realtime_factor for row in line]
            error = [100 * getattr(row, f"{name}_error") for row in line]
            marked = {"marker": "D", "markersize": 4.0, "linewidth": 1.2}
            panel.plot(time, error, dashes, color=COLOURS[-1], label=f"planetary set, {level}", **marked)
    axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes[-1].set_xlabel("processor time of the stage per simulated second")
    with written_whole(PICTURE) as temporary:
        figure.savefig(temporary, format="svg", metadata={"Date": None})
