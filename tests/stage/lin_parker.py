"""The planar model of a planetary set on paper: J. Lin, R. G. Parker, Analytical characterization of the unique
properties of planetary gear free vibration, J. Vib. Acoust. 121 (1999) 316–321. No code of the product.

Three freedoms a body, x, y and u = r θ (r: base radius; of the carrier that of the bolts), in the axes of the carrier
at rest: carrier, ring, sun, then planets with x radial and y tangential at their places ψ. Without gyroscopic terms.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg as sl

CARRIER, RING, SUN, PLANETS = 0, 3, 6, 9
REFERENCE = Path(__file__).parents[1] / "reference" / "lin_parker_1999.json"


def published() -> dict[str, Any]:
    """Parameters of their Table 1 and natural frequencies (Hz) of their Table 2, by number of planets."""
    found: dict[str, Any] = json.loads(REFERENCE.read_text(encoding="utf-8"))
    return found


def springs(angles: Sequence[float], alpha: float) -> dict[str, np.ndarray]:
    """(N, 9 + 3N) elongation of every spring of a kind: sun and ring meshes, pins along radius and tangent."""
    count = len(angles)
    found = {name: np.zeros((count, PLANETS + 3 * count)) for name in ("sun", "ring", "radial", "tangential")}
    for n, psi in enumerate(angles):
        planet = slice(PLANETS + 3 * n, PLANETS + 3 * n + 3)
        s, r = psi - alpha, psi + alpha
        found["sun"][n, SUN : SUN + 3] = -math.sin(s), math.cos(s), 1
        found["sun"][n, planet] = -math.sin(alpha), -math.cos(alpha), 1
        found["ring"][n, RING : RING + 3] = -math.sin(r), math.cos(r), 1
        found["ring"][n, planet] = math.sin(alpha), -math.cos(alpha), -1
        found["radial"][n, CARRIER : CARRIER + 3] = math.cos(psi), math.sin(psi), 0
        found["radial"][n, planet] = -1, 0, 0
        found["tangential"][n, CARRIER : CARRIER + 3] = -math.sin(psi), math.cos(psi), 1
        found["tangential"][n, planet] = 0, -1, 0
    return found


def matrices(known: Mapping[str, Any], angles: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """M and K, kg and N/m. k_sun: radial stiffness of the sun's bearing where it is another than that of the others."""
    rows = springs(angles, math.radians(known["alpha_deg"]))
    bodies = [known[name] for name in ("carrier", "ring", "sun")] + [known["planet"]] * len(angles)
    mass = np.diag([value for body in bodies for value in (body["m"], body["m"], body["I_r2"])])
    bearing = known["k_bearing"]
    sun = known.get("k_sun", bearing)
    held = [bearing, bearing, known["k_cu"], bearing, bearing, known["k_ru"], sun, sun, known["k_su"]]
    stiffness = np.diag([*held, *[0.0] * (3 * len(angles))])
    for name, k in (("sun", known["k_mesh"]), ("ring", known["k_mesh"]), ("radial", bearing), ("tangential", bearing)):
        stiffness += k * rows[name].T @ rows[name]
    return mass, stiffness


def modes(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Natural frequencies (Hz, ascending) and mass-normalised shapes in columns."""
    squared, shapes = sl.eigh(stiffness, mass)
    return np.sqrt(np.clip(squared, 0, None)) / (2 * math.pi), shapes


def class_of(shape: np.ndarray, planets: int) -> str:
    """rotational, translational or planet: what moves of sun, ring and carrier."""
    central = shape[:PLANETS].reshape(3, 3) / np.abs(shape).max()
    turns, moves = np.abs(central[:, 2]).max() > 1e-6, np.abs(central[:, :2]).max() > 1e-6
    return {(True, False): "rotational", (False, True): "translational", (False, False): "planet"}.get(
        (bool(turns), bool(moves)), "mixed"
    )


def mesh_forces(
    known: Mapping[str, Any], angles: Sequence[float], torque: float, pins: Mapping[int, tuple[float, float]]
) -> np.ndarray:
    """(2, N) N: static forces in the sun's and the ring's meshes, the sun held and the force torque/r on the carrier.

    pins: deviation of single pins, radial and tangential (m). torque: over the radius of the bolts, N; its sign decides
    which flanks carry, here those of `springs`.
    """
    rows = springs(angles, math.radians(known["alpha_deg"]))
    _, stiffness = matrices(known, angles)
    load = np.zeros(len(stiffness))
    load[CARRIER + 2] = torque
    for planet, error in pins.items():
        for name, e in zip(("radial", "tangential"), error, strict=True):
            load -= known["k_bearing"] * rows[name][planet] * e
    free = np.delete(np.arange(len(load)), SUN + 2)
    x = np.zeros(len(load))
    x[free] = np.linalg.solve(stiffness[np.ix_(free, free)], load[free])
    return known["k_mesh"] * np.stack([rows["sun"] @ x, rows["ring"] @ x])
