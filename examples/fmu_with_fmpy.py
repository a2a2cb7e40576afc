"""A clutch closes: the FMU stepped by hand with fmpy, nothing of gearfmu in the loop.

Engine at constant speed – [clutch, compiled into the FMU's pinion port] – gear pair – port spring – load inertia,
integrated here. The host gives the load's motion and takes the mean torque of the step back. Run: python
examples/fmu_with_fmpy.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy
import matplotlib
import numpy as np
from fmpy.fmi2 import FMU2Slave

import gearfmu as gf

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

ENGINE, LOAD_INERTIA = 100.0, 0.2  # rad/s, kg·m²
H, END = 1e-4, 0.2  # s
CLUTCH = {"inertia": 0.15, "disc_inertia": 2e-3, "shaft_k": 15e3, "shaft_c": 1.0}  # SI
INPUTS = ("pinion.phi", "pinion.w", "pinion.clutch.capacity", "wheel.phi", "wheel.w")
SHOWN = ("pinion.clutch.tau", "pinion.clutch.slip", "mesh.force", "wheel.tau_mean", "pinion.clutch.locked")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)

stage = gf.load("fzg_c/stage_relief", {f"ports.pinion.chain.{name}": value for name, value in CLUTCH.items()})
fmu = gf.export(stage, folder / "clutch.fmu")

description = fmpy.read_model_description(str(fmu))
reference = {v.name + ("" if v.causality != "input" else " in"): v.valueReference for v in description.modelVariables}
slave = FMU2Slave(guid=description.guid, unzipDirectory=fmpy.extract(str(fmu)), instanceName="pair",
                  modelIdentifier=description.coSimulation.modelIdentifier)  # fmt: skip
slave.instantiate()
slave.setInteger([reference["level"]], [1])  # fast
slave.setupExperiment(startTime=0.0)
slave.enterInitializationMode()
slave.setReal([reference["pinion.w in"]], [ENGINE])
slave.exitInitializationMode()

angle, speed, rows = 0.0, 0.0, []
for n in range(round(END / H)):
    time = n * H
    capacity = 120.0 * min(1.0, max(0.0, time - 0.01) / 0.05)  # N·m, closes within 50 ms
    slave.setReal([reference[name + " in"] for name in INPUTS], [ENGINE * time, ENGINE, capacity, angle, speed])
    slave.doStep(currentCommunicationPoint=time, communicationStepSize=H)
    values = [slave.getReal([reference[name]])[0] for name in SHOWN[:-1]] + slave.getBoolean([reference[SHOWN[-1]]])
    speed += values[3] / LOAD_INERTIA * H
    angle += speed * H
    rows.append((time + H, *values))
slave.terminate()
slave.freeInstance()

table = np.array(rows, dtype=float)
figure, axes = plt.subplots(3, 1, sharex=True, figsize=(8, 7), layout="constrained")
for axis, column, label in zip(
    axes, (1, 2, 3), ("clutch torque in N·m", "slip in rad/s", "mesh force in N"), strict=True
):
    axis.plot(1e3 * table[:, 0], table[:, column], lw=0.8)
    axis.set_ylabel(label)
axes[-1].set_xlabel("time in ms")
figure.savefig(folder / "clutch.png", dpi=150)
locked = np.flatnonzero(table[:, 5] > 0.5)
print(f"the clutch locks after {1e3 * table[locked[0], 0]:.1f} ms; speed of the load at the end {speed:.2f} rad/s")
