"""The FZG type C pair as plain numbers, for tests of geometry and mesh."""

from __future__ import annotations

import math

from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.geometry.shifts import distance_of_shifts

MODULE = 4.5e-3
ALPHA = math.radians(20)


def gear(teeth: int, shift: float, tip_diameter: float, bore: float, module: float = MODULE) -> GearGeometry:
    """A gear of the rack 1.0/1.25/0.38 with a tip edge of 0.2 mm."""
    return GearGeometry(
        z=teeth, m=module, alpha=ALPHA, x=shift, r_a=tip_diameter / 2, r_bore=bore / 2, tip_edge=2e-4,
        h_fp=1.25 * module, rho_fp=0.38 * module,
    )  # fmt: skip


PINION = gear(16, 0.1817, 82.46e-3, 30e-3)
WHEEL = gear(24, 0.1715, 118.36e-3, 40e-3)
PAIR = PairGeometry((PINION, WHEEL), 91.5e-3, 1e-4)


def tip_circle_contact_ratio(pair: PairGeometry) -> float:
    """Transverse contact ratio of the tip circles, edge roundings left away (the number that catalogues state)."""
    return (pair.gears[0].s_a + pair.gears[1].s_a - pair.length) / pair.base_pitch


def without_backlash(pair: PairGeometry) -> float:
    """Centre distance (m) at which the nominal teeth would have no backlash."""
    a, b = pair.gears
    return distance_of_shifts(a.m, a.alpha, a.beta, a.z + b.z, a.x + b.x)
