"""Loaded transmission error with and without tip relief: what relief does to the excitation, and a Harris map.

Run: python examples/loaded_te.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import gearfmu as gf
from gearfmu.report.te import write_plot

TORQUE = 302.0  # N·m on the pinion
MAP = (10.0, 80.0, 150.0, TORQUE, 450.0, 600.0)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
for name in ("fzg_c", "fzg_c/stage_relief"):
    model = gf.assemble(name)
    result = gf.te(model, MAP, positions=64)
    write_plot(result, folder / f"harris_{model.name}.png")
    at = MAP.index(TORQUE)
    te, harmonics = 1e6 * result.te[at], 1e6 * result.harmonics(3)[at]
    print(
        f"{model.name}: mean {te.mean():.2f} µm, peak to peak {np.ptp(te):.2f} µm, "
        f"first three mesh harmonics, rms: {', '.join(f'{h:.3f}' for h in harmonics)} µm"
    )
