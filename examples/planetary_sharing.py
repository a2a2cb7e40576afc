"""What a planet pin in the wrong place does to the load of the planets.

The scene `planetary_paper` for 5 ms at level rigid (bodies yield, but do not vibrate by themselves), once with all
pins in place and once with one 12 µm too far on. Run: python examples/planetary_sharing.py
"""

from __future__ import annotations

import numpy as np

import gearfmu as gf

SHIFT = 12e-6  # m, tangential
shorter = {"duration": "5 ms", "settle": "0 s", "stage.level": "rigid", "deformation": None}
scene = gf.load_scene("planetary_paper", shorter)

for shift in (0.0, SHIFT):
    stage = gf.load(scene.stage.name, {"set.pin_errors.0": [0.0, shift]})
    trace = gf.run(scene, stage=stage, unit="kernel")
    late = trace.time > 2e-3
    forces = [abs(trace[f"sun_planet{k}.force_mean"][late].mean()) for k in (1, 2, 3, 4)]
    shares = ", ".join(f"{force / np.mean(forces):.3f}" for force in forces)
    print(f"pin of planet 1 off by {1e6 * shift:.0f} µm: shares of the planets {shares}")
