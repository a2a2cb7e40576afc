"""Modal truncation: the n lowest elastic eigenmodes K φ = ω² M φ.

Matched: the lowest poles with their residues. Not matched: static flexibility of the modes left out, which is added
only as static residual (`Oscillators.residual`). Theory, eq. 21. Source: Craig & Kurdila, Fundamentals
of Structural Dynamics (2006), ch. 11; paper section 2.
"""

from __future__ import annotations

import numpy as np

from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.moments import Size


def reduce(body: FullOrder, size: Size) -> np.ndarray:
    """The lowest elastic modes. Raises ModesError."""
    return elastic(body).modes(size.count)[1]
