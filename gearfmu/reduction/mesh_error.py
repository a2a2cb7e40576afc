"""What the mesh of a carrier costs: its free frequencies against those of a mesh 1.6 times finer.

A finer mesh of a small carrier is made. That of a large one would take four times the memory of all else; its
frequencies are extrapolated from a coarser mesh: their distance falls with the third power of the element's length.
Observed between 0.5, 0.75, 1, 1.25 and 1.6 times the mesh of two carriers: powers 3.0 to 3.8, so that an estimate lies
an eighth above the distance to the finer mesh itself. Source: Roache, J. Fluids Eng. 116 (1994) 405 (extrapolation).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gearfmu.fem import hex20
from gearfmu.fem.cyclic import Sector, SectorSpace, sector_spaces
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.reduction.carrier import FINER, carrier_full_order, compared_scale, cyclic_carrier, scaled_sector
from gearfmu.reduction.elastic import Elastic
from gearfmu.stagefile.forms.planetary import CarrierBody

COMPARED = 20  # lowest elastic modes
_POWER = 3  # of the element's length


def carrier_mesh_error(carrier: CarrierBody) -> dict[str, Any]:
    """How far the lowest free frequencies of a carrier, coupled as the file says, lie above those
    of a finer mesh: plain facts, largest of the relative errors. `compared`: scale of the mesh that was made beside its
    own. Raises MeshError."""
    scale = compared_scale(carrier)
    own, other = (free_frequencies(carrier, each, COMPARED) for each in (1.0, scale))
    nodes, others = (len(scaled_sector(carrier, each).nodes) for each in (1.0, scale))
    ratio = (nodes / others) ** (1 / 3)  # of lengths, counts being rounded
    error = own / other - 1 if scale > 1 else extrapolated(other / own - 1, ratio)
    largest = float(error.max())
    return {"finer": FINER, "compared": scale, "modes": len(error), "to_Hz": float(own[-1]), "max_error": largest}


def extrapolated(coarser: np.ndarray, ratio: float) -> np.ndarray:
    """Relative distance of frequencies to those of a mesh `FINER`, from how far those of a mesh with elements `ratio`
    times as long lie above them."""
    return coarser * (1 - FINER**-_POWER) / (ratio**_POWER - 1)


def free_frequencies(carrier: CarrierBody, scale: float, count: int) -> np.ndarray:
    """The `count` lowest elastic frequencies (Hz) of the free carrier; `scale`: factor on all element counts.

    By one sector where bolts are evenly spaced and coupled alike, by the whole body else. Raises MeshError.
    """
    if not cyclic_carrier(carrier):
        squared, _ = Elastic(carrier_full_order(carrier, scale)).modes(count)
        return np.sqrt(squared) / (2 * np.pi)
    space = _space(carrier, scale)
    families = []
    for index in range(space.teeth // 2 + 1):
        harmonic = space.harmonic(index)
        found, _ = lowest_modes(harmonic, -(-count // (1 if harmonic.is_real else 2)))
        families.append(found if harmonic.is_real else np.repeat(found, 2))
    return np.sqrt(np.sort(np.concatenate(families))[:count]) / (2 * np.pi)


def _space(carrier: CarrierBody, scale: float) -> SectorSpace:
    """The fields of one bolt's sector."""
    mesh = scaled_sector(carrier, scale)
    matrices = hex20.assemble(mesh.nodes, mesh.elements, carrier.material)
    bore = mesh.sets["bore"] if carrier.coupling_of("bore") == "rigid" else None
    bolt = mesh.sets["bolt"] if carrier.coupling_of("bolt0") == "rigid" else None
    (space,) = sector_spaces(
        Sector(mesh.nodes, mesh.elements, *matrices, mesh.teeth, mesh.cut_minus, mesh.cut_plus, True, bore, bolt)
    )
    return space
