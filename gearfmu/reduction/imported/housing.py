"""A housing before reduction: its mesh in the stage's axes, seats and feet as interfaces, and what is read beside them:
sensors and the closed outer surface.

A seat's master lies on the axis of the circle that fits its nodes best, in the middle of their length; a foot's in the
middle of its nodes. Sensors and skin add rows, no unknowns and no modes: nothing loads them.

The skin consists of the faces of a node set by their corners; it is the convex envelope of the mesh where no set is
named. A hole of it (a bore, an opening for a shaft) is an edge loop that belongs to one face only. It is closed by
triangles between its edges and one more point, the mean of its corners, which moves as their mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.surface import Faces
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.reduction.couplings import Coupling, elimination, full_order
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface
from gearfmu.reduction.imported.carrier import circle_centre
from gearfmu.reduction.imported.files import elements_of, naming, ready_matrices, set_coupling, sound_mesh, whole_facts
from gearfmu.reduction.memory import MESH_COARSER, require_memory, whole_need
from gearfmu.sound import envelope
from gearfmu.stagefile.tables.housing import HousingBody, HousingImportSpec

HOUSING_FACTORS = 5  # of K, with the interfaces held, and at the reference's three points


@dataclass(frozen=True)
class Surface:
    """A closed surface. points (P, 3) m; faces (F, 4) numbers of points, normals outward, a triangle repeats its last
    point; sample (P, N): points from the nodes of the mesh; holes: that were closed."""

    points: np.ndarray
    faces: np.ndarray
    sample: sp.csr_array
    holes: int


def closed_surface(mesh: ImportedMesh, faces: Faces, name: str) -> Surface:
    """The skin of a mesh: boundary faces whose nodes all lie in the node set `name`. MeshError where it has no faces,
    or edges of more than two, or is not in one piece with simple holes."""
    own = faces.within(mesh.node_set(name))
    corners = own.corners
    if not len(corners):
        raise MeshError(f"skin '{name}': no boundary face has all its nodes in this set: name the outer surface")
    used, local = np.unique(corners, return_inverse=True)
    surface = enclosed(mesh.nodes[used], local.reshape(corners.shape), name)
    chosen = sp.csr_array((np.ones(len(used)), (np.arange(len(used)), used)), (len(used), len(mesh.nodes)))
    return replace(surface, sample=sp.csr_array(surface.sample @ chosen))


def enclosed(nodes: np.ndarray, faces: np.ndarray, name: str) -> Surface:
    """The surface of `faces` (F, 4), numbers of nodes (N, 3) m, with its holes closed. MeshError for edges of more than
    two faces, for holes that are not simple, and where it encloses nothing."""
    loops = _loops(faces, name)
    caps = []
    for k, loop in enumerate(loops):
        middle = np.full(len(loop), len(nodes) + k)
        caps.append(np.column_stack([np.roll(loop, -1), loop, middle, middle]))
    closed, sample = np.vstack([faces, *caps]), _sample(len(nodes), loops)
    points = sample @ nodes
    if _volume(points, closed) <= 0:
        raise MeshError(f"skin '{name}' encloses no volume: name the outer surface, all of it, and not the inner one")
    return Surface(points, closed, sample, len(loops))


def enveloping_surface(mesh: ImportedMesh, faces: Faces) -> Surface:
    """The convex envelope of a mesh, in triangles as long as the edges of its boundary; a point moves as the boundary
    node that is nearest to it."""
    corners = faces.corners
    used, at = np.unique(corners), mesh.nodes[corners]
    around = envelope(mesh.nodes[used], float(np.linalg.norm(at[:, 1] - at[:, 0], axis=1).mean()))
    nearest = used[cKDTree(mesh.nodes[used]).query(around.points)[1]]
    entries = np.ones(len(nearest)), (np.arange(len(nearest)), nearest)
    sample = sp.csr_array(entries, shape=(len(nearest), len(mesh.nodes)))
    return Surface(around.points, around.triangles[:, [0, 1, 2, 2]], sample, 0)


def _loops(faces: np.ndarray, name: str) -> list[np.ndarray]:
    """Edge loops that belong to one face only, along the faces' own sense."""
    following = np.roll(faces, -1, axis=1)
    edges = np.column_stack([faces.ravel(), following.ravel()])
    edges = edges[edges[:, 0] != edges[:, 1]]
    known = {(int(a), int(b)) for a, b in edges}
    if len(known) != len(edges):
        raise MeshError(f"skin '{name}': two of its faces meet with opposite normals, or three in one edge")
    after = {a: b for a, b in sorted(known) if (b, a) not in known}
    if len(after) != sum((b, a) not in known for a, b in known):
        raise MeshError(f"skin '{name}': holes touch each other in a point: leave a row of faces between them")
    loops = []
    while after:
        first = min(after)
        loop, at = [first], after.pop(first)
        while at != first:
            if at not in after:
                raise MeshError(f"skin '{name}': the edge of a hole ends: name all faces of the outer surface")
            loop.append(at)
            at = after.pop(at)
        loops.append(np.array(loop))
    return loops


def _sample(count: int, loops: list[np.ndarray]) -> sp.csr_array:
    """Points from the nodes: themselves, and the mean of every loop."""
    rows = [np.arange(count), *(np.full(len(loop), count + k) for k, loop in enumerate(loops))]
    columns = [np.arange(count), *loops]
    values = [np.ones(count), *(np.full(len(loop), 1 / len(loop)) for loop in loops)]
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_array(entries, shape=(count + len(loops), count))


def _volume(points: np.ndarray, faces: np.ndarray) -> float:
    """m³ inside: of the tetrahedra between the origin and the triangles."""
    a, b, c, d = (points[faces[:, k]] for k in range(4))
    parts = np.einsum("ij,ij->i", a, np.cross(b, c)) + np.einsum("ij,ij->i", a, np.cross(c, d))
    return float(parts.sum() / 6)


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
