"""What a planet pin in the wrong place does to the load of the planets.

The scene `planetary_paper` for 5 ms at level rigid (bodies yield, but do not vibrate by themselves), once with all
pins in place and once with one 12 µm too far on. Run: python examples/planetary_sharing.py
"""

from __future__ import annotations

import numpy as np

from gearfmu.body import load_bodies
from gearfmu.cosim.scene_run import in_drivetrain, run_once
from gearfmu.cosim.source import Source
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble

SHIFT = 12e-6  # m, tangential
scene = load_scene("planetary_paper")
rigid = scene.stage.model_copy(update={"level": "rigid"})
scene = scene.model_copy(update={"duration": 5e-3, "settle": 0.0, "stage": rigid})
spec = load_stage(scene.stage.name)
bodies = load_bodies(spec)

for errors in ({}, {0: (0.0, SHIFT)}):
    own = spec.model_copy(update={"set": spec.set.model_copy(update={"pin_errors": errors})})
    trace = run_once(scene, Source(assemble(in_drivetrain(scene, own), bodies))).trace
    late = trace.time > 2e-3
    forces = [abs(trace[f"sun_planet{k}.force_mean"][late].mean()) for k in (1, 2, 3, 4)]
    shares = ", ".join(f"{force / np.mean(forces):.3f}" for force in forces)
    print(f"pin of planet 1 off by {1e6 * errors[0][1] if errors else 0:.0f} µm: shares of the planets {shares}")
