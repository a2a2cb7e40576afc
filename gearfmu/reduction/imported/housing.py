"""A housing before reduction: its mesh in the stage's axes, seats and feet as interfaces, and what is read beside them:
sensors and the closed outer surface.

A seat's master lies on the axis of the circle that fits its nodes best, in the middle of their length; a foot's in the
middle of its nodes. Sensors and skin add rows, no unknowns and no modes: nothing loads them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.surface import Faces
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.reduction.couplings import Coupling, elimination, full_order
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface
from gearfmu.reduction.imported.carrier import circle_centre
from gearfmu.reduction.imported.files import elements_of, naming, ready_matrices, set_coupling, sound_mesh, whole_facts
from gearfmu.reduction.imported.skin import Surface, closed_surface, enveloping_surface
from gearfmu.reduction.memory import MESH_COARSER, require_memory, whole_need
from gearfmu.stagefile.tables.housing import HousingBody, HousingImportSpec

HOUSING_FACTORS = 5  # of K, with the interfaces held, and at the reference's three points


@dataclass(frozen=True)
class ImportedHousing:
    """An imported housing before reduction. full: seats and feet are its interfaces; spans: of every interface the
    lowest and highest z of its nodes, m; sensors: interfaces of three components that nothing loads; surface: its skin,
    the convex envelope where the file names none, None of a superelement without one, and skin (3P, N): displacement of
    its points by the unknowns."""

    full: FullOrder
    facts: dict[str, object]
    spans: dict[str, tuple[float, float]]
    sensors: tuple[Interface, ...]
    surface: Surface | None
    skin: sp.csr_array | None


def imported_housing(housing: HousingBody) -> ImportedHousing:
    """The finite elements of a housing. MeshError for sets that are missing, no circle or no surface, for holes in
    the skin, and as of every import."""
    source = housing.imported
    assert source is not None and housing.material is not None
    mesh = sound_mesh(source)
    with naming(Path(source.file)):
        require_memory(whole_need(mesh.nodes.size, 3 * housing.modes, HOUSING_FACTORS), MESH_COARSER)
        matrices = ready_matrices(source, mesh, np.eye(3), housing.material)
        faces = solids.boundary(mesh.elements)
        feet = [set_coupling(mesh, faces, own, source.foot_coupling, name=name) for name, own in source.feet.items()]
        held = _seats(mesh, faces, source) + feet
        felt = [_sensor(mesh, faces, name, node_set) for name, node_set in source.sensors.items()]
        body = elements_of(mesh, matrices, housing.material)
        reach = float(np.linalg.norm(mesh.nodes, axis=1).max())
        full = full_order(housing.name, body, [*held, *felt], tuple(source.feet), reach)
        loaded, sensors = full.interfaces[: len(held)], full.interfaces[len(held) :]
        surface = closed_surface(mesh, faces, source.skin) if source.skin else enveloping_surface(mesh, faces)
        transform = elimination(mesh.nodes, [c for c in held if c.kind == "rigid"])[0]
        skin = sp.csr_array(sp.kron(surface.sample, sp.identity(3), format="csr") @ transform)
    heights = {c.name: mesh.nodes[c.nodes, 2] for c in held}
    return ImportedHousing(
        replace(full, interfaces=loaded),
        whole_facts(mesh, full.size),
        {name: (float(z.min()), float(z.max())) for name, z in heights.items()},
        tuple(replace(s, components=COMPONENTS[:3], rows=sp.csr_array(s.rows[:3])) for s in sensors),
        surface,
        skin,
    )


def _seats(mesh: ImportedMesh, faces: Faces, source: HousingImportSpec) -> list[Coupling]:
    found = []
    for name, node_set in source.seats.items():
        nodes = mesh.nodes[mesh.node_set(node_set)]
        try:
            centre = circle_centre(nodes[:, :2])
        except MeshError as error:
            raise MeshError(f"seat {name} ('{node_set}'): {error}") from error
        point = np.array([*centre, 0.5 * (nodes[:, 2].min() + nodes[:, 2].max())])
        found.append(set_coupling(mesh, faces, node_set, source.seat_coupling, point, name))
    return found


def _sensor(mesh: ImportedMesh, faces: Faces, name: str, node_set: str) -> Coupling:
    """One node moves as itself, more as their mean."""
    members = mesh.node_set(node_set)
    if len(members) == 1:
        return Coupling(name, "nodes", members, mesh.nodes[members[0]])
    return set_coupling(mesh, faces, node_set, name=name)
