"""Law of cylindrical roller bearings: every roller in slices (ISO/TS 16281:2008, 5.3).

Slice k of roller j, at x_k along the roller, with the profile P of the standard,

    δ_jk = (x c + y s + x_k (θy c − θx s) − ½ s_r − 2 P(x_k))₊,    u = 9/19 c_L δ^19/9 / n_s
    c_L = 35948 L^8/9    (N, mm)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearfmu.bearing.hertz import line_pressure
from gearfmu.bearing.law import Elements

SLICES = 30  # the standard asks for at least as many
_LINE = 35948.0  # N/mm^(10/9) of a roller 1 mm long, steel
_MM = 1e-3
_SHORT = 2.5  # length over diameter up to which the whole roller is profiled


@dataclass(frozen=True)
class Rollers:
    """diameter, length: of the rollers, m, without their chamfers; pitch_diameter: m; clearance: radial, in operation,
    m, negative: interference. They carry across the axis only."""

    count: int
    diameter: float
    pitch_diameter: float
    length: float
    clearance: float = 0.0
    contact_angle: float = 0.0

    @property
    def stiffness(self) -> float:
        """c_L, N/m^(10/9)."""
        return _LINE * (self.length / _MM) ** (8 / 9) / _MM ** (10 / 9)

    @cached_property
    def places(self) -> np.ndarray:
        """(n_s,) m: middles of the slices along the roller."""
        return self.length * ((np.arange(SLICES) + 0.5) / SLICES - 0.5)

    @cached_property
    def profile(self) -> np.ndarray:
        """(n_s,) m: P, how far the roller's surface lies below its cylinder."""
        straight = max(self.length - _SHORT * self.diameter, 0.0)
        part = np.maximum(2 * np.abs(self.places) - straight, 0.0) / (self.length - straight)
        factor = 0.0005 if straight else 0.00035
        return -factor * self.diameter * np.log(1 - part**2)

    def springs(self, d: np.ndarray, angles: np.ndarray, push: float) -> Elements:
        """See `law.Law`. n_s springs an element, the slices of one side by side."""
        c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
        of_slices = np.zeros((angles.size, SLICES, 5))
        of_slices[..., 0], of_slices[..., 1] = c, s
        of_slices[..., 3], of_slices[..., 4] = -self.places * s, self.places * c
        slope = of_slices.reshape(-1, 5)
        lost = np.tile(self.clearance / 2 + 2 * self.profile, angles.size)
        delta = np.maximum(slope @ d - lost, 0.0)
        c_slice = self.stiffness / SLICES
        return Elements(
            load=c_slice * delta ** (10 / 9),
            rate=10 / 9 * c_slice * delta ** (1 / 9),
            slope=slope,
            curl=None,
            energy=float(9 / 19 * c_slice * (delta ** (19 / 9)).sum()),
        )

    def loads(self, springs: Elements) -> np.ndarray:
        """See `law.Law`."""
        return springs.load.reshape(-1, SLICES).sum(axis=1)

    def pressure(self, springs: Elements) -> float:
        """See `law.Law`. On the inner ring, where the relative radius is smaller."""
        gamma = self.diameter / self.pitch_diameter
        most = float(springs.load.max(initial=0.0)) * SLICES / self.length
        return line_pressure(most, self.diameter / 2 * (1 - gamma))
