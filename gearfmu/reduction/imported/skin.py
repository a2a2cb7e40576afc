"""The outer surface of a housing, closed: the faces of a node set by their corners, holes covered by fans of triangles;
the convex envelope of the mesh where no set is named.

A hole (a bore, an opening for a shaft) is an edge loop that belongs to one face only. It is closed by triangles between
its edges and one more point, the mean of its corners, which moves as their mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.fem.surface import Faces
from gearfmu.femesh.imported import ImportedMesh
from gearfmu.sound import envelope


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
