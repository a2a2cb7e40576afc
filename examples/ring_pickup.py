"""What a pickup on the rim of a standing ring would measure, from the recorded forces of its meshes.

The ring's own modes carry the forces of all planets, whose places go round with the carrier:
    q'' + 2 ζ ω q' + ω² q = − Σ_i N(ψ_i) F_i,   v = P q',
N(ψ) the mode's row at the middle of a flank at the angle ψ, P the radial row of the rim's patch on +x. What the ring
moves as a whole in its mounts is not in it. Each mode is integrated exactly for forces that are linear between samples.

    python examples/ring_pickup.py TRACE      a run of planetary54, for example of the scene planetary_runup
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.signal import lfilter

import gearfmu as gf
from gearfmu.body import load_bodies
from gearfmu.stage import Trace

NYQUIST_PART = 0.8  # of it: modes above this part are left out
PLANETS = 4


def rim_velocity(
    ring: Any, step: float, forces: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Radial velocity (n,) m/s of the rim on +x. ring: its body; step: s, between samples; forces (n,) N, drive
    flanks positive, at the angles (n,) rad, by mesh."""
    flank = 0 if sum(force.mean() for force in forces.values()) >= 0 else 1
    rows = ring.flank.rows[flank, ring.flank.rows.shape[1] // 2, 0]
    radial, velocity = ring.sensors.rows[0], np.zeros(len(next(iter(forces.values()))))
    for k in np.flatnonzero((ring.frequency < NYQUIST_PART * 0.5 / step) & (ring.flank.part != 2)).tolist():
        pair = ring.flank.part[k] == 1
        factors = [(rows[k], -rows[k + 1]), (rows[k + 1], rows[k])] if pair else [(rows[k], 0.0)]
        turned = {mesh: ring.flank.diameter[k] * angle for mesh, angle in angles.items()}
        for member, (a, b) in enumerate(factors, k):
            modal = -sum((a * np.cos(t) + b * np.sin(t)) * np.abs(forces[mesh]) for mesh, t in turned.items())
            omega = 2 * np.pi * ring.frequency[k]
            velocity += radial[member] * modal_velocity(modal, step, omega, ring.damping_ratio[k])
    return velocity


def modal_velocity(force: np.ndarray, step: float, omega: float, zeta: float) -> np.ndarray:
    """q' (n,) of one mode of unit mass under a force that is linear between samples; at rest under the first."""
    root = complex(-zeta * omega, omega * np.sqrt(1 - zeta**2))
    decay = np.exp(root * step)
    ahead = (decay - 1 - root * step) / (root**2 * step)  # of the force at the end of the step
    behind = (decay - 1) / root - ahead
    y = lfilter([ahead, behind], [1, -decay], np.asarray(force - force[0], complex))
    return np.asarray((root * y).imag / root.imag)


if __name__ == "__main__":
    trace = Trace.load(sys.argv[1])
    ring = load_bodies(gf.load("planetary54"))[2]
    meshes = [f"ring_planet{k + 1}" for k in range(PLANETS)]
    angles = {mesh: trace["carrier.gear.phi"] + 2 * np.pi * k / PLANETS for k, mesh in enumerate(meshes)}
    forces = {mesh: trace[f"{mesh}.force"] for mesh in meshes}
    found = rim_velocity(ring, float(trace.time[1] - trace.time[0]), forces, angles)
    print(f"rim on +x: {1e3 * found.std():.3g} mm/s rms, {1e3 * np.abs(found).max():.3g} mm/s at most")
