"""Spectrum and mesh orders of a bearing force from a trace, without the report.

Run: gearfmu simulate fzg_c --torque "302 N*m" --speed "2000 rpm" --set level=fast --out out/steady
     python examples/read_a_trace.py out/steady/trace.h5
"""

from __future__ import annotations

import sys

import gearfmu as gf
from gearfmu.report.metrics import amplitude_spectrum, level, mesh_angle, order_cuts, sample_step

trace = gf.Trace.load(sys.argv[1])
settled = trace.window(0.02)
force = settled["bearing.pinion.fy"]

spectrum = amplitude_spectrum(force, sample_step(settled.time))
top = int(spectrum.amplitude.argmax())
print(f"highest line: {level(spectrum.amplitude[top]):.1f} dB re 1 N at {spectrum.frequency[top]:.0f} Hz")

rotor, teeth = trace.meta["meshes"]["mesh"]
angle = mesh_angle(settled.time, settled[f"{rotor}.gear.w"], teeth)
cuts = order_cuts(settled.time, force, angle, orders=5)
for order, amplitude in zip(cuts.orders, cuts.amplitude, strict=True):
    print(
        f"mesh order {order}: {level(amplitude.mean()):6.1f} dB re 1 N at {cuts.mesh_frequency.mean() * order:.0f} Hz"
    )
