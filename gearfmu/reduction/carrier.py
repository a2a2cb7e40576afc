"""The carrier before reduction: its bolts, six inputs each, and the bore, which is the ground when it is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearfmu.fem import hex20
from gearfmu.fem.repeated import Parts
from gearfmu.femesh.carrier import carrier_sector, whole_carrier
from gearfmu.femesh.mesh import FeMesh
from gearfmu.reduction.couplings import Coupling, Elements, full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.carrier import imported_carrier
from gearfmu.reduction.memory import CARRIER_FACTORS, Need, modes_need, parts_need, whole_need
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import carrier_geometry

FINER = 1.6  # factor on all element counts of the mesh that a carrier is judged by
_COARSER = 0.75  # … of the mesh from which that one's frequencies are extrapolated where it is large
_LARGE = 1e9  # bytes


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
    own, bolts = _sector_size(scaled_sector(carrier, 1.0))
    size, vectors, cyclic = own * bolts, 3 * carrier.modes, cyclic_carrier(carrier)
    need = parts_need(size, bolts, vectors) if cyclic else whole_need(size, vectors, CARRIER_FACTORS)
    scale = max(1.0, compared_scale(carrier))
    return Need(size, max(need.memory, _modes_memory(own * scale**3, 1 if cyclic else bolts)))


def compared_scale(carrier: CarrierBody) -> float:
    """Factor on all element counts of the mesh that the error of a carrier is known by: finer where that is no large
    one, else coarser."""
    own, bolts = _sector_size(scaled_sector(carrier, 1.0))
    finer = _modes_memory(own * FINER**3, 1 if cyclic_carrier(carrier) else bolts)
    return FINER if finer < _LARGE else _COARSER


def _sector_size(sector: FeMesh) -> tuple[int, int]:
    """Unknowns of a bolt's sector, and bolts."""
    return 3 * (len(sector.nodes) - len(sector.cut_plus)), sector.teeth


def _modes_memory(sector_size: float, together: int) -> float:
    """Bytes that the lowest modes take, by one sector or by all that must be taken together."""
    if together == 1:
        return modes_need(round(sector_size)).memory
    return whole_need(round(sector_size * together), 0, 1).memory


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
