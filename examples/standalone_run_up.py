"""Run-up of a loaded pair without FMU and co-simulation: where is the mesh resonance?

300 → 6000 rpm within half a second under 150 N·m, level `fast`. Run: python examples/standalone_run_up.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np

import gearfmu as gf

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

TORQUE, DURATION, STEP = 150.0, 0.5, 50e-6  # N·m, s, s
START, END = (rpm * np.pi / 30 for rpm in (300, 6000))  # rad/s
RATE = (END - START) / DURATION

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)
model = gf.assemble("fzg_c/stage_relief")
wound = gf.wound_up(model, TORQUE, START)(0.0)
ratio = -1 / model.shafts.ratio


def inputs(time: float) -> dict[str, float]:
    """Both shaft ends turn through the same angle of the pinion, wound up by the torque."""
    turned, speed = START * time + RATE * time**2 / 2, START + RATE * time
    return {
        "pinion.phi": wound["pinion.phi"] + turned,
        "pinion.w": speed,
        "pinion.a": RATE,
        "wheel.phi": wound["wheel.phi"] - ratio * turned,
        "wheel.w": -ratio * speed,
        "wheel.a": -ratio * RATE,
    }


trace = gf.drive(model, inputs, DURATION, STEP, level="fast")
rpm, force = trace["pinion.gear.w"] * 30 / np.pi, trace["mesh.force"]
window = round(0.01 / STEP)
mean = np.convolve(force, np.ones(window) / window, "same")
swing = np.sqrt(np.convolve((force - mean) ** 2, np.ones(window) / window, "same"))
inside = slice(2 * window, -window)
peak = np.argmax(swing[inside]) + inside.start

figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
axis.plot(rpm[inside], force[inside], lw=0.3)
axis.plot(rpm[inside], mean[inside] + np.sqrt(2) * swing[inside], lw=1)
axis.set(xlabel="pinion speed in rpm", ylabel="mesh force in N")
figure.savefig(folder / "run_up.png", dpi=150)
trace.save(folder / "run_up.h5")
print(f"mean mesh force {force[inside].mean():.0f} N; largest swing {swing[peak]:.0f} N rms at {rpm[peak]:.0f} rpm")
