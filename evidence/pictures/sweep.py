"""docs/pictures/sweep_levels.png: levels of the shipped pair over torque and speed.

Run: python -m evidence.pictures.sweep [FOLDER]
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np

import gearfmu as gf
from gearfmu.sweeps.charts import write_charts

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/sweep_levels")
over = {
    "torque": np.linspace(50, 400, 8),
    "speed": [f"{rpm} rpm" for rpm in range(500, 6001, 500)],
    "level": "fast",
    "duration": 0.08,
}
table = gf.sweep("fzg_c/stage_relief", over, folder, progress=lambda part, text="": print(f"{part:4.0%} {text}"))
(picture,) = write_charts(table, folder)
shutil.copy(picture, Path(__file__).resolve().parents[2] / "docs" / "pictures" / "sweep_levels.png")
print(*table.failures, sep="\n")
