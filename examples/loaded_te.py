"""Loaded transmission error with and without tip relief: what relief does to the excitation at one load.

Run: python examples/loaded_te.py
"""

from __future__ import annotations

import numpy as np

from gearfmu.body import reduce_stage
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble, loaded_te

TORQUE = 302.0  # N·m on the pinion

for name in ("fzg_c", "fzg_c/stage_relief"):
    spec = load_stage(name)
    model = assemble(spec, reduce_stage(spec))
    te = 1e6 * loaded_te(model, torques=[TORQUE], positions=64).te[0]
    harmonics = np.abs(np.fft.rfft(te)[1:4]) * np.sqrt(2) / te.size
    print(
        f"{spec.name}: mean {te.mean():.2f} µm, peak to peak {np.ptp(te):.2f} µm, "
        f"first three mesh harmonics, rms: {', '.join(f'{h:.3f}' for h in harmonics)} µm"
    )
