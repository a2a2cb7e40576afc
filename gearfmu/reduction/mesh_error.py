"""What the mesh of a carrier costs: its free frequencies against those of a mesh 1.6 times finer."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearfmu.fem import hex20
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.reduction.carrier import FINER, carrier_full_order
from gearfmu.reduction.elastic import Elastic

COMPARED = 20  # lowest elastic modes


def carrier_mesh_error(spec: Any) -> dict[str, Any]:
    """How far the lowest free frequencies of the carrier of a PlanetarySpec, coupled as the file says, lie above those
    of a finer mesh: plain facts, relative errors of the largest and of every mode. Raises MeshError."""
    own, fine = (free_frequencies(spec, scale, COMPARED) for scale in (1.0, FINER))
    error = own / fine - 1
    return {"finer": FINER, "modes": len(error), "to_Hz": float(own[-1]), "max_error": float(error.max())}


def free_frequencies(spec: Any, scale: float, count: int) -> np.ndarray:
    """The `count` lowest elastic frequencies (Hz) of the free carrier; `scale`: factor on all element counts.

    By one sector where bolts are evenly spaced and coupled alike, by the whole body else. Raises MeshError.
    """
    geometry, carrier = CarrierGeometry.of(spec), spec.carrier
    kinds = {carrier.coupling_of(f"bolt{k}") for k in range(geometry.planets)}
    even = np.allclose(geometry.angles, 2 * np.pi * np.arange(geometry.planets) / geometry.planets, atol=1e-9)
    if not even or len(kinds) > 1 or geometry.planets < 3:
        squared, _ = Elastic(carrier_full_order(spec, scale)).modes(count)
        return np.sqrt(squared) / (2 * np.pi)
    mesh = carrier_sector(geometry, carrier.mesh.model_copy(update={"scale": carrier.mesh.scale * scale}))
    matrices = hex20.assemble(mesh.nodes, mesh.elements, carrier.material)
    bore = mesh.sets["bore"] if carrier.coupling_of("bore") == "rigid" else None
    bolt = mesh.sets["bolt"] if kinds == {"rigid"} else None
    (space,) = sector_spaces(
        Sector(mesh.nodes, mesh.elements, *matrices, mesh.teeth, mesh.cut_minus, mesh.cut_plus, True, bore, bolt)
    )
    families = []
    for index in range(mesh.teeth // 2 + 1):
        harmonic = space.harmonic(index)
        found, _ = lowest_modes(harmonic, -(-count // (1 if harmonic.is_real else 2)))
        families.append(found if harmonic.is_real else np.repeat(found, 2))
    return np.sqrt(np.sort(np.concatenate(families))[:count]) / (2 * np.pi)
