"""The carrier before reduction: its bolts, six inputs each, and the bore, which is the ground when it is judged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from gearfmu.fem import hex20
from gearfmu.fem.repeated import Parts
from gearfmu.femesh.carrier import carrier_sector, whole_carrier
from gearfmu.femesh.mesh import FeMesh
from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.reduction.couplings import Coupling, Elements, Judgement, full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported_carrier import imported_carrier
from gearfmu.reduction.memory import CARRIER_FACTORS, Need, modes_need, parts_need, whole_need

FINER = 1.6  # factor on all element counts of the mesh that a carrier is judged by
_COARSER = 0.75  # … of the mesh from which that one's frequencies are extrapolated where it is large
_LARGE = 1e9  # bytes


def carrier_full_order(spec: Any, scale: float = 1.0) -> FullOrder:
    """The carrier of a PlanetarySpec: interfaces bolt0 … bolt<N−1> and bore, each coupled as the file says.

    scale : factor on all element counts (1: about 150 000 unknowns); an imported carrier has none and is taken as it
    is. Rotations count with the bolt circle's radius. Raises MeshError.
    """
    if spec.carrier.imported is not None:
        return imported_carrier(spec).full
    geometry, sector = CarrierGeometry.of(spec), scaled_sector(spec, scale)
    full = full_order("carrier", *_whole_elements(spec, sector), Judgement(("bore",), geometry.a))
    return replace(full, parts=_equal_parts(full, sector)) if cyclic_carrier(spec) else full


def carrier_need(spec: Any) -> Need:
    """Memory that the reduction of a carrier meshed here takes, from its counts, the mesh beside it by which its error
    is known among it (`compared_scale`)."""
    own, bolts = _sector_size(scaled_sector(spec, 1.0))
    size, vectors, cyclic = own * bolts, 3 * spec.carrier.modes, cyclic_carrier(spec)
    need = parts_need(size, bolts, vectors) if cyclic else whole_need(size, vectors, CARRIER_FACTORS)
    scale = max(1.0, compared_scale(spec))
    return Need(size, max(need.memory, _modes_memory(own * scale**3, 1 if cyclic else bolts)), True)


def compared_scale(spec: Any) -> float:
    """Factor on all element counts of the mesh that the error of a carrier is known by: finer where that is no large
    one, else coarser."""
    own, bolts = _sector_size(scaled_sector(spec, 1.0))
    finer = _modes_memory(own * FINER**3, 1 if cyclic_carrier(spec) else bolts)
    return FINER if finer < _LARGE else _COARSER


def _sector_size(sector: FeMesh) -> tuple[int, int]:
    """Unknowns of a bolt's sector, and bolts."""
    return 3 * (len(sector.nodes) - len(sector.cut_plus)), sector.teeth


def _modes_memory(sector_size: float, together: int) -> float:
    """Bytes that the lowest modes take, by one sector or by all that must be taken together."""
    if together == 1:
        return modes_need(round(sector_size)).memory
    return whole_need(round(sector_size * together), 0, 1).memory


def cyclic_carrier(spec: Any) -> bool:
    """Are the bolts of the carrier of a PlanetarySpec evenly spaced and coupled alike, and enough for cuts?"""
    geometry = CarrierGeometry.of(spec)
    kinds = {spec.carrier.coupling_of(f"bolt{k}") for k in range(geometry.planets)}
    even = np.allclose(geometry.angles, 2 * np.pi * np.arange(geometry.planets) / geometry.planets, atol=1e-9)
    return even and len(kinds) == 1 and geometry.planets >= 3


def carrier_elements(spec: Any, scale: float = 1.0) -> tuple[Elements, list[Coupling]]:
    """Finite elements of the carrier as the file describes it, and the couplings of its bolts and bore."""
    return _whole_elements(spec, scaled_sector(spec, scale))


def scaled_sector(spec: Any, scale: float) -> FeMesh:
    """One bolt's sector of the carrier of a PlanetarySpec. scale : factor on all element counts."""
    counts = spec.carrier.mesh
    return carrier_sector(CarrierGeometry.of(spec), counts.model_copy(update={"scale": counts.scale * scale}))


def _whole_elements(spec: Any, sector: FeMesh) -> tuple[Elements, list[Coupling]]:
    geometry = CarrierGeometry.of(spec)
    whole = whole_carrier(geometry, sector)
    body = Elements(whole.nodes, whole.elements, *hex20.assemble(whole.nodes, whole.elements, spec.carrier.material))
    couplings = [
        Coupling(
            f"bolt{k}",
            spec.carrier.coupling_of(f"bolt{k}"),
            sector.sector_nodes(k)[sector.sets["bolt"]],
            geometry.bolt_axis(k),
        )
        for k in range(geometry.planets)
    ]
    couplings.append(Coupling("bore", spec.carrier.coupling_of("bore"), whole.sets["bore"], geometry.bore_centre))
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
