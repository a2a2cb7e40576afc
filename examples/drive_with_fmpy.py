"""An elastic gear pair in a Python host that knows nothing of gearfmu but its FMU: torque on the pinion, wheel held.

The pinion winds up against the held wheel and rings; with its damping it settles at the static transmission error.
Run: python examples/drive_with_fmpy.py [fzg_c.fmu]
"""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy

import gearfmu as gf

fmu = Path(sys.argv[1] if len(sys.argv) > 1 else "fzg_c.fmu")
if not fmu.exists():
    gf.export(gf.assemble("fzg_c", ports={"pinion": "torque", "wheel": "fixed"}), fmu)

result = fmpy.simulate_fmu(
    str(fmu),
    stop_time=0.02,
    output_interval=1e-4,
    start_values={"pinion.tau": 302.0},
    output=["mesh.te", "mesh.force", "wheel.tau"],
)
te, force, torque = (float(result[name][-1]) for name in ("mesh.te", "mesh.force", "wheel.tau"))
print(f"transmission error {1e6 * te:.2f} µm, mesh force {force:.0f} N, torque at the held wheel {torque:.1f} N·m")
