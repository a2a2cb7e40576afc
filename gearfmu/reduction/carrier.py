"""The carrier before reduction: its bolts, six inputs each, and the bore, which is the ground when it is judged; and
what its mesh costs: its free frequencies against those of a mesh 1.6 times finer.

A finer mesh of a small carrier is made. That of a large one would take four times the memory of all else; its
frequencies are extrapolated from a coarser mesh: their distance falls with the third power of the element's length.
Observed between 0.5, 0.75, 1, 1.25 and 1.6 times the mesh of two carriers: powers 3.0 to 3.8, so that an estimate lies
an eighth above the distance to the finer mesh itself. Source: Roache, J. Fluids Eng. 116 (1994) 405 (extrapolation).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearfmu.fem import hex20
from gearfmu.fem.cyclic import Sector, SectorSpace, sector_spaces
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.repeated import Parts
from gearfmu.femesh.carrier import carrier_sector, whole_carrier
from gearfmu.femesh.mesh import FeMesh
from gearfmu.reduction.couplings import Coupling, Elements, full_order
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.carrier import imported_carrier
from gearfmu.reduction.memory import CARRIER_FACTORS, Need, modes_need, parts_need, whole_need
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import carrier_geometry

FINER = 1.6  # factor on all element counts of the mesh that a carrier is judged by
_COARSER = 0.75  # … of the mesh from which that one's frequencies are extrapolated where it is large
_LARGE = 1e9  # bytes
COMPARED = 20  # lowest elastic modes
_POWER = 3  # of the element's length


def carrier_full_order(carrier: CarrierBody, scale: float = 1.0) -> FullOrder:
    """A carrier with interfaces bolt0 … bolt<N−1> and bore, each coupled as the file says.

    scale : factor on all element counts (1: about 150 000 unknowns); an imported carrier has none and is taken as it
    is. Rotations count with the bolt circle's radius. Raises MeshError.
    """
    if carrier.imported is not None:
        return imported_carrier(carrier)[0]
    sector = scaled_sector(carrier, scale)
    full = full_order("carrier", *carrier_elements(carrier, sector), ("bore",), carrier.circle)
    return replace(full, parts=_equal_parts(full, sector)) if cyclic_carrier(carrier) else full


def carrier_need(carrier: CarrierBody) -> Need:
    """Memory that the reduction of a carrier meshed here takes, from its counts, the mesh beside it by which its error
    is known among it (`compared_scale`)."""
    own, bolts = _sector_size(carrier)
    size, vectors, scale = own * bolts, 3 * carrier.modes, max(1.0, compared_scale(carrier))
    need = parts_need(size, bolts, vectors) if cyclic_carrier(carrier) else whole_need(size, vectors, CARRIER_FACTORS)
    return Need(size, max(need.memory, _modes_memory(carrier, scale)))


def compared_scale(carrier: CarrierBody) -> float:
    """Factor on all element counts of the mesh that the error of a carrier is known by: finer where that is no large
    one, else coarser."""
    return FINER if _modes_memory(carrier, FINER) < _LARGE else _COARSER


def _sector_size(carrier: CarrierBody) -> tuple[int, int]:
    """Unknowns of a bolt's sector, and bolts."""
    sector = scaled_sector(carrier, 1.0)
    return 3 * (len(sector.nodes) - len(sector.cut_plus)), sector.teeth


def _modes_memory(carrier: CarrierBody, scale: float) -> float:
    """Bytes that the lowest modes take, by one sector or by all where they must be taken together."""
    own, bolts = _sector_size(carrier)
    if cyclic_carrier(carrier):
        return modes_need(round(own * scale**3)).memory
    return whole_need(round(own * scale**3 * bolts), 0, 1).memory


def cyclic_carrier(carrier: CarrierBody) -> bool:
    """Are the bolts of a carrier evenly spaced and coupled alike, and enough for cuts?"""
    count = len(carrier.bolts)
    kinds = {carrier.coupling_of(f"bolt{k}") for k in range(count)}
    return evenly_spaced(carrier) and len(kinds) == 1 and count >= 3


def evenly_spaced(carrier: CarrierBody) -> bool:
    """Are the bolts of a carrier evenly spaced?"""
    return np.allclose(carrier.bolts, np.arange(len(carrier.bolts)) / len(carrier.bolts), atol=1e-9)


def scaled_sector(carrier: CarrierBody, scale: float) -> FeMesh:
    """One bolt's sector of a carrier meshed here. scale : factor on all element counts."""
    counts = carrier.mesh
    return carrier_sector(carrier_geometry(carrier), counts.model_copy(update={"scale": counts.scale * scale}))


def carrier_elements(carrier: CarrierBody, sector: FeMesh) -> tuple[Elements, list[Coupling]]:
    """Finite elements of a carrier of these sectors, and the couplings of its bolts and bore."""
    geometry = carrier_geometry(carrier)
    whole = whole_carrier(geometry, sector)
    body = Elements(whole.nodes, whole.elements, *hex20.assemble(whole.nodes, whole.elements, carrier.material))
    couplings = [
        Coupling(
            f"bolt{k}",
            carrier.coupling_of(f"bolt{k}"),
            sector.sector_nodes(k)[sector.sets["bolt"]],
            geometry.bolt_axis(k),
        )
        for k in range(geometry.planets)
    ]
    couplings.append(Coupling("bore", carrier.coupling_of("bore"), whole.sets["bore"], geometry.bore_centre))
    return body, couplings


def _equal_parts(full: FullOrder, sector: FeMesh) -> Parts:
    """What belongs to each bolt: its sector and master; cuts and the bore's master are shared."""
    kinds = [interface.kind for interface in full.interfaces]
    masters = sector.teeth * (len(sector.nodes) - len(sector.cut_plus))  # nodes from here on are masters
    cuts = np.concatenate([sector.cut_minus, sector.cut_plus])
    inside = np.setdiff1d(np.arange(len(sector.nodes)), cuts)
    bore = [full.node_of_dof[-1]] if kinds[-1] == "rigid" else []
    inner, border = [], []
    for bolt in range(sector.teeth):
        index = sector.sector_nodes(bolt)
        own = [masters + bolt] if kinds[bolt] == "rigid" else []
        inner.append(_unknowns(full, np.append(index[inside], own)))
        border.append(_unknowns(full, np.append(index[cuts], bore)))
    return Parts(np.array(inner), np.array(border))


def _unknowns(full: FullOrder, nodes: np.ndarray) -> np.ndarray:
    """Unknowns of these nodes in their order, none where a master stands for a node."""
    first, last = (np.searchsorted(full.node_of_dof, nodes, side) for side in ("left", "right"))
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)])


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
