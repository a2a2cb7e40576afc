"""Relief: material taken off a flank towards one of its ends, normal to the involute."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Kind = Literal["linear", "parabolic", "arc"]


def relief_depth(kind: Kind, amount: float, length: float, share: np.ndarray) -> np.ndarray:
    """Depth (m) of a relief that grows from nothing at share u = 0 to `amount` (m) at u = 1 of its `length` (m).

    linear: C u; parabolic: C u²; arc: ρ − √(ρ² − (ℓ u)²), the arc of the radius ρ = (ℓ² + C²)/(2 C) that is tangent to
    the flank where it begins. It differs from the parabola by about C³/(4 ℓ²), less than a nanometre.
    """
    if kind == "linear":
        return amount * share
    if kind == "parabolic" or amount == 0.0:
        return amount * share**2
    radius, along = (length**2 + amount**2) / (2 * amount), length * share
    return along**2 / (radius + np.sqrt(radius**2 - along**2))


def relief_at(roll: ArrayLike, amount: float, start: float, end: float, kind: Kind = "parabolic") -> np.ndarray:
    """Relief δ (m), positive into the tooth, at rolls of any shape: `amount` (m) at the roll `end`, nothing before
    `start` (ISO 21771: tip relief C_a, root relief C_f), on either side of which `end` may lie. Shapes: `relief_depth`.
    """
    share = np.maximum((np.asarray(roll, float) - start) / (end - start), 0.0)
    return relief_depth(kind, amount, abs(end - start), share)
