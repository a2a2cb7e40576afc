"""Loaded transmission error with and without tip relief: what relief does to the excitation, and a Harris map.

Run: python examples/loaded_te.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from gearfmu.body import reduce_stage
from gearfmu.report.te import write_plot
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble, loaded_te

TORQUE = 302.0  # N·m on the pinion
MAP = (10.0, 80.0, 150.0, TORQUE, 450.0, 600.0)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)
for name in ("fzg_c", "fzg_c/stage_relief"):
    spec = load_stage(name)
    model = assemble(spec, reduce_stage(spec))
    result = loaded_te(model, torques=MAP, positions=64)
    write_plot(result, folder / f"harris_{spec.name}.png")
    te = 1e6 * result.te[MAP.index(TORQUE)]
    harmonics = np.abs(np.fft.rfft(te)[1:4]) * np.sqrt(2) / te.size
    print(
        f"{spec.name}: mean {te.mean():.2f} µm, peak to peak {np.ptp(te):.2f} µm, "
        f"first three mesh harmonics, rms: {', '.join(f'{h:.3f}' for h in harmonics)} µm"
    )
