"""Linearised mesh mode of a stage and the contact damping that gives it 3 % of critical: rigid gears on their bearings,
the tangent mesh stiffness of `te` averaged over a pitch, with modal damping in the flexible part and the dashpots
across the contacts' own paths (residual beyond all stored modes and local law, docs/theory.md 2.5).

    python tests/modes/mesh_mode.py [STAGE] [TORQUE_NM]
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.linalg import eig
from scipy.optimize import brentq

from gearfmu.body import load_bodies
from gearfmu.stage import assemble, loaded_te
from gearfmu.stagefile.stage import load_stage
from tests.stage.dashpot import own_path

RATIO = 0.03
CLOSING = np.array([-1.0, -1.0, 1.0, -1.0])  # along the line of action: pinion's axis, r_b φ; wheel's axis, r_b φ


def mesh_mode(stage: str, torque: float) -> dict[str, float]:
    """Frequency (Hz), mesh stiffness (N/m), compliance of a contact's own path (m/N) and the dashpot (N·s/m²) for
    RATIO."""
    spec = load_stage(stage)
    bodies = load_bodies(spec)
    model = assemble(spec, bodies)
    result = loaded_te(model, [torque], positions=64, **{"effect.bearings": 0.0})
    stiffness, pairs = result.mesh_stiffness.mean(), (result.shares > 1e-3).sum(axis=2).mean()
    gears = spec.written.geometry.gears
    path = own_path(model, torque)
    mass = np.array([v for b, g in zip(bodies, gears, strict=True) for v in (b.total_mass, b.inertia[2, 2] / g.r_b**2)])
    width = min(gear.face_width for gear in spec.gears)

    def mode(damping: float) -> complex:
        """Eigenvalue (1/s) of the mode with most mesh deflection."""
        s = 1j * np.sqrt(stiffness / mass.min())
        for _ in range(40):
            omega = abs(s)
            flexible = (1 / stiffness - path / pairs) / (1 + 2 * spec.gears[0].modal_damping * s / omega)
            closing = 1 / (flexible + path / pairs / (1 + s * damping * width * path))
            matrix = closing * np.outer(CLOSING, CLOSING).astype(complex)
            for i, (gear, body) in enumerate(zip(spec.written.gears, bodies, strict=True)):
                c = 2 * gear.bearing.damping_ratio * np.sqrt(gear.bearing.stiffness * body.total_mass)
                matrix[2 * i, 2 * i] += gear.bearing.stiffness + s * c
            values, shapes = eig(matrix, np.diag(mass))
            share = np.abs(CLOSING @ (shapes / np.sqrt(np.einsum("ij,i,ij->j", shapes.conj(), mass, shapes)))) ** 2
            s = 1j * np.sqrt(values[np.argmax(share * (np.abs(values) > 1e6))])
            s = s if s.imag > 0 else -s
        return complex(s)

    def ratio(damping: float) -> float:
        s = mode(damping)
        return -s.real / abs(s)

    damping = brentq(lambda c: ratio(c) - RATIO, 0.0, 1e6)
    return {
        "frequency": abs(mode(damping)) / (2 * np.pi),
        "stiffness": stiffness,
        "path": path,
        "without": ratio(0.0),
        "damping": damping,
    }


if __name__ == "__main__":
    chosen, load = (sys.argv[1:] + ["fzg_c", "302"][len(sys.argv) - 1 :])[:2]
    found = mesh_mode(chosen, float(load))
    print(
        f"{chosen} at {load} N·m: mesh mode {found['frequency'] / 1e3:.2f} kHz, mean mesh stiffness "
        f"{found['stiffness'] * 1e-6:.1f} N/µm, own path of a contact {1e-6 / found['path']:.0f} N/µm; damping ratio "
        "without "
        f"contact dashpots {found['without']:.2%}; contact damping for {RATIO:.0%} of critical {found['damping']:.3g} "
        "N·s/m²"
    )
