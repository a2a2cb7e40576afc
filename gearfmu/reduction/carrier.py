"""The carrier before reduction: its bolts, six inputs each, and the bore, which is the ground when it is judged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from gearfmu.fem import hex20
from gearfmu.femesh.carrier import carrier_sector, whole_carrier
from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.reduction.couplings import Coupling, Elements, Judgement, full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported_carrier import imported_carrier
from gearfmu.reduction.memory import CARRIER_FACTORS, Need, whole_need

FINER = 1.6  # factor on all element counts of the mesh that a carrier is judged by


def carrier_full_order(spec: Any, scale: float = 1.0) -> FullOrder:
    """The carrier of a PlanetarySpec: interfaces bolt0 … bolt<N−1> and bore, each coupled as the file says.

    scale : factor on all element counts (1: about 150 000 unknowns); an imported carrier has none and is taken as it
    is. Rotations count with the bolt circle's radius. Raises MeshError.
    """
    if spec.carrier.imported is not None:
        return imported_carrier(spec).full
    geometry = CarrierGeometry.of(spec)
    return full_order("carrier", *carrier_elements(spec, scale), Judgement(("bore",), geometry.a))


def carrier_need(spec: Any) -> Need:
    """Memory that the reduction of a carrier meshed here takes, from its counts: the whole body, or the sector of the
    finer mesh (`FINER`) by which its error is measured."""
    sector = carrier_sector(CarrierGeometry.of(spec), spec.carrier.mesh)
    own, vectors = 3 * (len(sector.nodes) - len(sector.cut_plus)), 3 * spec.carrier.modes
    whole, finer = (
        whole_need(unknowns, vectors, CARRIER_FACTORS) for unknowns in (own * sector.teeth, round(own * FINER**3))
    )
    return replace(whole, memory=max(whole.memory, finer.memory))


def carrier_elements(spec: Any, scale: float = 1.0) -> tuple[Elements, list[Coupling]]:
    """Finite elements of the carrier as the file describes it, and the couplings of its bolts and bore."""
    geometry = CarrierGeometry.of(spec)
    counts = spec.carrier.mesh
    sector = carrier_sector(geometry, counts.model_copy(update={"scale": counts.scale * scale}))
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
