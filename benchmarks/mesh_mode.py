"""Linearised mesh mode of a stage and the contact damping that gives it 3 % of critical: rigid gears on their bearings, tangent mesh stiffness of `te` averaged over a pitch.

    python benchmarks/mesh_mode.py [STAGE] [TORQUE_NM]
"""
from __future__ import annotations

import sys

import numpy as np
from scipy.linalg import eigh

from gearfmu.body import load_body
from gearfmu.geometry import PairGeometry
from gearfmu.spec.library import model_folder
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble, loaded_te

RATIO = 0.03


def mesh_mode(stage: str, torque: float) -> tuple[float, float, float]:
    """Frequency (Hz) of the mode with most mesh deflection, its mesh stiffness (N/m) and the dashpot (N·s/m²) per tooth pair and metre of face width."""
    spec = load_stage(stage)
    bodies = [load_body(model_folder(spec) / f"{gear.name}.h5") for gear in spec.gears]
    result = loaded_te(assemble(spec, bodies), [torque], positions=64, rigid_bearings=True)
    k, pairs = result.stiffness.mean(), (result.shares > 1e-3).sum(axis=2).mean()
    inertia = [body.inertia[2, 2] / gear.r_b**2 for body, gear in zip(bodies, PairGeometry.of(spec).gears, strict=True)]
    bearings = [gear.bearing.stiffness for gear in spec.gears]
    closing = np.array([-1.0, -1.0, 1.0, -1.0])  # along the line of action: pinion's axis, r_b φ; wheel's axis, r_b φ
    stiffness = k * np.outer(closing, closing) + np.diag([bearings[0], 0, bearings[1], 0])
    omega2, modes = eigh(stiffness, np.diag([bodies[0].mass, inertia[0], bodies[1].mass, inertia[1]]))
    deflection = (closing @ modes) ** 2
    mode = np.argmax(k * deflection / np.maximum(omega2, 1.0) * (omega2 > 1.0))
    omega = np.sqrt(omega2[mode])
    return omega / (2 * np.pi), k, 2 * RATIO * omega / deflection[mode] / (pairs * spec.gears[0].face_width)


if __name__ == "__main__":
    chosen, load = (sys.argv[1:] + ["fzg_c", "302"][len(sys.argv) - 1:])[:2]
    frequency, k_mesh, damping = mesh_mode(chosen, float(load))
    print(f"{chosen} at {load} N·m: mesh mode {frequency / 1e3:.2f} kHz, mean mesh stiffness {k_mesh * 1e-6:.1f} N/µm, "
          f"contact damping for {RATIO:.0%} of critical {damping:.3g} N·s/m²")
