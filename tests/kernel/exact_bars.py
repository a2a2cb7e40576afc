"""Two coaxial elastic bars in impact: exact solution by waves, and modal data of a free–free bar in closed form.

Waves: a bar of impedance Z = ρcA carries d'Alembert waves; a free end reflects velocity unchanged, bars in contact
share the velocity of the touching ends, and they part when the force would become tension (Saint-Venant 1867; Graff,
Wave Motion in Elastic Solids, 1975, §2.4). All lengths here are whole numbers of cells: exact on the grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Bar:
    """length m, radius m, youngs_modulus Pa, density kg/m³."""

    length: float
    radius: float = 0.01
    youngs_modulus: float = 210e9
    density: float = 7850.0

    @property
    def area(self) -> float:
        """Cross-section, m²."""
        return np.pi * self.radius**2

    @property
    def mass(self) -> float:
        """kg."""
        return self.density * self.area * self.length

    @property
    def speed(self) -> float:
        """Wave speed c = √(E/ρ), m/s."""
        return float(np.sqrt(self.youngs_modulus / self.density))

    def frequencies(self, n: int) -> np.ndarray:
        """Angular frequencies ω_k = kπc/L (n,) of the first n elastic modes √(2/m) cos(kπx/L), rad/s."""
        return np.arange(1, n + 1) * np.pi * self.speed / self.length

    def end_row(self, n: int) -> np.ndarray:
        """Displacement of the end x = 0 per mass-normalised mode (n + 1,), the rigid mode first, 1/√kg."""
        return np.concatenate([[1.0], np.full(n, np.sqrt(2.0))]) / np.sqrt(self.mass)

    def static_compliance(self) -> float:
        """Elastic displacement of an end per force on it with inertia relief, mean-axis gauge: L/(3EA), m/N."""
        return self.length / (3 * self.youngs_modulus * self.area)

    def residual(self, n: int) -> float:
        """What the first n elastic modes leave of the static compliance, m/N: Σ_{k>n} 2/(m ω_k²)."""
        return self.static_compliance() - float(np.sum(2 / (self.mass * self.frequencies(n) ** 2)))


@dataclass(frozen=True)
class Impact:
    """force/(ρcAv) while it lasts; times in c t / L1; velocities of the centres of mass over v; e: of restitution."""

    force: float
    force_end: float
    first_separation: float
    v1: float
    v2: float
    e: float


def impact(cells1: int, cells2: int) -> Impact:
    """Bar 1 (`cells1` long) hits bar 2 (`cells2`) of the same section at rest with unit velocity; exact, in units of
    ρcA = c = 1.

    Followed until both bars have shed every wave that could close the gap again. Each bar keeps its waves as velocities
    f (to the right) and g (to the left) per cell, v = f + g, compressive force = f − g (bar 1 on the left)."""
    f1, g1 = np.full(cells1, 0.5), np.full(cells1, 0.5)
    f2, g2 = np.zeros(cells2), np.zeros(cells2)
    touching, gap, forces, separation = True, 0.0, [], None
    for step in range(8 * (cells1 + cells2)):
        arriving1, arriving2 = f1[-1], g2[0]
        force = arriving1 - arriving2 if touching else 0.0
        end1, end2 = (arriving1 + arriving2,) * 2 if force > 0 else (2 * arriving1, 2 * arriving2)
        gap += end2 - end1
        if gap > 0 and separation is None:
            separation = step
        touching = gap <= 0
        gap = max(gap, 0.0)
        forces.append(max(force, 0.0))
        left1, left2 = g1[0], f2[-1]
        f1, g1 = np.concatenate([[left1], f1[:-1]]), np.concatenate([g1[1:], [end1 - arriving1]])
        f2, g2 = np.concatenate([[end2 - arriving2], f2[:-1]]), np.concatenate([g2[1:], [left2]])
    ends = max(k for k, value in enumerate(forces) if value > 0) + 1
    v1, v2 = float(np.mean(f1 + g1)), float(np.mean(f2 + g2))
    return Impact(forces[0], ends / cells1, separation / cells1, v1, v2, v2 - v1)
