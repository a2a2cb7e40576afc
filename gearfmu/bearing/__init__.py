"""Rolling bearings after ISO/TS 16281: one potential of the displacement between the rings, forces, stiffness."""

from gearfmu.bearing.catalogue import Filled, filled_ball, filled_roller
from gearfmu.bearing.law import Balls, Rollers, Rolling, Row
from gearfmu.bearing.rest import NoRestError, Rest, pass_orders, pass_swing, rest

__all__ = [
    "Balls",
    "Filled",
    "NoRestError",
    "Rest",
    "Rollers",
    "Rolling",
    "Row",
    "filled_ball",
    "filled_roller",
    "pass_orders",
    "pass_swing",
    "rest",
]
