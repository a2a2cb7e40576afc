"""What a pickup on the rim of a standing ring would measure, from the recorded forces of its meshes.

The ring's own modes carry the forces of all planets, whose places go round with the carrier:
    q'' + 2 ζ ω q' + ω² q = − Σ_i N(ψ_i) F_i,   v = P q',
N(ψ) the mode's row at the middle of a flank at the angle ψ, P the radial row of the rim's patch on +x. These are the
ring's elastic modes as the kernel has them; what the ring moves as a whole in its mounts is not in it. Each mode is
integrated exactly for forces that are linear between samples.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.signal import lfilter

from gearfmu.body import ReducedBody
from gearfmu.report import metrics
from gearfmu.report.plots_set import PlanetSet, mean_or_sample
from gearfmu.spec.forms.expand import as_general
from gearfmu.stage.run.touching import GEAR_PHI
from gearfmu.stage.run.trace import Trace

NYQUIST_PART = 0.8  # of it: modes above this part are left out
RING = "ring"


def rim_velocity(trace: Trace, own: PlanetSet, spec: Any, bodies: Sequence[Any]) -> np.ndarray | None:
    """Radial velocity (n,) m/s of the standing ring's rim on +x; None where the ring turns or a channel is missing."""
    stage = as_general(spec)
    ring = next((body for body in bodies if isinstance(body, ReducedBody) and body.rim is not None), None)
    meshes = own.meshes.get(RING, {})
    turning = f"{own.carrier}{GEAR_PHI}"
    needed = [turning, *(f"{mesh}.force" for mesh in meshes.values())]
    if ring is None or not meshes or not stage.rotors[RING].stands or any(name not in trace for name in needed):
        return None
    places = {mesh: math.atan2(*reversed(stage.rotors[planet].axis)) for planet, mesh in meshes.items()}
    forces = {mesh: mean_or_sample(trace, f"{mesh}.force") for mesh in meshes.values()}
    angles = {mesh: trace[turning] + place for mesh, place in places.items()}
    return velocity_of(ring, metrics.sample_step(trace.time), forces, angles)


def velocity_of(
    ring: Any, step: float, forces: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Radial velocity (n,) m/s of the rim on +x. ring: ReducedBody; step: s, between samples; forces (n,) N, drive
    flanks positive, at the angles (n,) rad, by mesh."""
    flank = 0 if sum(force.mean() for force in forces.values()) >= 0 else 1
    rows = ring.flank_rows[flank, ring.flank_rows.shape[1] // 2, 0]
    radial, velocity = ring.rim.patch_rows[0], np.zeros(len(next(iter(forces.values()))))
    for k in np.flatnonzero((ring.frequency < NYQUIST_PART * 0.5 / step) & (ring.part != 2)).tolist():
        members = [k, k + 1] if ring.part[k] == 1 else [k]
        if not np.any(rows[members]) or not np.any(radial[members]):
            continue
        turned = {mesh: ring.nodal_diameter[k] * angle for mesh, angle in angles.items()}
        for member, (a, b) in zip(members, _members(rows, k, len(members)), strict=True):
            modal = -sum((a * np.cos(t) + b * np.sin(t)) * np.abs(forces[mesh]) for mesh, t in turned.items())
            velocity += radial[member] * _modal_velocity(modal, step, 2 * np.pi * ring.frequency[k], ring, k)
    return velocity


def _members(rows: np.ndarray, k: int, count: int) -> list[tuple[float, float]]:
    """Factors of cos νψ and sin νψ in the row at the angle ψ, of each member of a pair (docs/architecture.md)."""
    return [(rows[k], -rows[k + 1]), (rows[k + 1], rows[k])] if count == 2 else [(rows[k], 0.0)]


def _modal_velocity(force: np.ndarray, step: float, omega: float, ring: Any, k: int) -> np.ndarray:
    """q' (n,) of one mode of unit mass under a force that is linear between samples; at rest under the first."""
    zeta = ring.damping_ratio[k]
    root = complex(-zeta * omega, omega * math.sqrt(1 - zeta**2))
    decay = np.exp(root * step)
    ahead = (decay - 1 - root * step) / (root**2 * step)  # of the force at the end of the step
    behind = (decay - 1) / root - ahead
    loaded = np.asarray(force - force[0], complex)
    y = lfilter([ahead, behind], [1, -decay], loaded)
    return np.asarray((root * y).imag / root.imag)
