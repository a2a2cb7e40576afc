"""Is an imported body sound? Everything that is wrong with its mesh or its matrices, in the user's words."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gearfmu.fem import solids
from gearfmu.fem.coupling import rigid_modes

_SAME_PLACE = 1e-6  # of the mesh's size: nodes that lie at the same place
_RIGID = 1e-6  # largest force of a rigid motion, relative to that of the single stiffnesses in it
_FACTOR = 10.0  # by which the mass may miss what the mesh and the material say (unit errors are 1e3 and more)
_SPEEDS = (0.3, 30.0)  # √(K_ii/M_ii) times the distance of nodes over the wave speed is 1.5 to 2.6 for hex20 and tet10


def mesh_problems(nodes: np.ndarray, elements: Mapping[str, np.ndarray], labels: np.ndarray) -> list[str]:
    """What is wrong with a mesh: inverted or double elements, nodes at one place, parts that do not hang together.

    nodes (N, 3) m; elements by kind; labels (N,) node numbers of the file, for the messages.
    """
    return [
        *_inverted(nodes, elements, labels),
        *_same_place(nodes, labels),
        *(_apart(nodes, elements) or _hinged(elements, labels)),
    ]


def _inverted(nodes: np.ndarray, elements: Mapping[str, np.ndarray], labels: np.ndarray) -> list[str]:
    found = []
    for kind, block in elements.items():
        bad = np.flatnonzero(solids.jacobian_quality(nodes, block, kind) <= 0)
        if len(bad) == len(block):
            found.append(
                f"all {len(block)} elements ({kind}) are inside out: the file mirrors the body or sorts their nodes "
                "differently; check its axes and element type"
            )
        elif len(bad):
            corners = ", ".join(str(label) for label in labels[block[bad[0], :4]])
            found.append(
                f"{len(bad)} of {len(block)} elements ({kind}) are inverted or folded (first: nodes {corners} …): "
                "mesh these places again"
            )
    return found


def _same_place(nodes: np.ndarray, labels: np.ndarray) -> list[str]:
    pairs = cKDTree(nodes).query_pairs(_SAME_PLACE * np.ptp(nodes, axis=0).max(), output_type="ndarray")
    if not len(pairs):
        return []
    a, b = labels[pairs[0]]
    return [
        f"{len(pairs)} pairs of nodes lie at the same place (first: {a} and {b}): merge coincident nodes in the mesher"
    ]


def _apart(nodes: np.ndarray, elements: Mapping[str, np.ndarray]) -> list[str]:
    pairs = [np.stack([np.repeat(b[:, 0], b.shape[1]), b.ravel()]) for b in elements.values()]
    row, column = np.concatenate(pairs, axis=1)
    graph = sp.coo_array((np.ones(len(row)), (row, column)), (len(nodes),) * 2)
    count, part = connected_components(graph, directed=False)
    if count == 1:
        return []
    sizes = ", ".join(str(size) for size in sorted(np.bincount(part), reverse=True)[:4])
    return [f"the mesh is in {count} parts that share no node (of {sizes} nodes): connect them, or export one body"]


def _hinged(elements: Mapping[str, np.ndarray], labels: np.ndarray) -> list[str]:
    """Parts that hang together by single nodes or edges only: connected by nodes, not by faces."""
    owner, key = [], []
    first = 0
    for kind, corners in (("hexahedron20", 4), ("tetra10", 3)):
        if kind in elements:
            faces = elements[kind][:, solids.ELEMENTS[kind].FACES[:, :corners]]
            sorted_faces = np.sort(faces.reshape(-1, corners), axis=1)
            key.append(sorted_faces[:, :3] if corners == 4 else sorted_faces)
            owner.append(first + np.repeat(np.arange(len(faces)), faces.shape[1]))
            first += len(faces)
    owner_all, key_all = np.concatenate(owner), np.concatenate(key)
    _, face = np.unique(key_all, axis=0, return_inverse=True)
    graph = sp.coo_array((np.ones(len(owner_all)), (owner_all, face)), (first, face.max() + 1)).tocsr()
    count, part = connected_components(graph @ graph.T, directed=False)
    if count == 1:
        return []
    blocks = list(elements.values())
    starts = np.cumsum([0, *(len(b) for b in blocks)])
    nodes_of = [
        np.unique(np.concatenate([b[part[s : s + len(b)] == k].ravel() for b, s in zip(blocks, starts, strict=False)]))
        for k in range(count)
    ]
    shared = np.intersect1d(nodes_of[0], np.concatenate(nodes_of[1:]))
    place = f" (at node {labels[shared[0]]})" if len(shared) else ""
    return [
        f"{count} parts of the mesh hang together only by nodes or edges{place}, as by a hinge: they need common "
        "faces, or the stiffness matrix has more than six rigid motions"
    ]


def matrix_problems(stiffness: sp.csr_array, mass: sp.csr_array, nodes: np.ndarray, expected_mass: float) -> list[str]:
    """What is wrong with ready-made matrices (3N, 3N) in SI: no free body, or units that cannot be.

    expected_mass : kg, volume of the mesh times the density of the material.
    """
    fields = rigid_modes(nodes - nodes.mean(axis=0))
    found = []
    force, scale = np.abs(stiffness @ fields).max(axis=0), (abs(stiffness) @ np.abs(fields)).max(axis=0)
    if (force > _RIGID * scale).any():
        moves = [
            name
            for name, bad in zip(("x", "y", "z", "about x", "about y", "about z"), force > _RIGID * scale, strict=True)
            if bad
        ]
        found.append(
            f"rigid motion ({', '.join(moves)}) needs force up to {(force / scale).max():.1e} of the stiffness: export "
            "the free body, and check that the rows belong to these nodes and the coordinates have the unit `length`"
        )
    own_mass = float(np.mean(np.einsum("ij,ij->j", fields[:, :3], mass @ fields[:, :3])))
    if not 1 / _FACTOR < own_mass / expected_mass < _FACTOR:
        found.append(
            f"the mass matrix weighs {own_mass:.3g} kg, mesh and density give {expected_mass:.3g} kg: check "
            "`mass_unit` and `length`"
        )
    return found


def speed_problem(stiffness: sp.csr_array, mass: sp.csr_array, nodes: np.ndarray, speed: float) -> list[str]:
    """Whether √(K_ii/M_ii) times the distance to the next node is of the order of the speed of sound (m/s) of the
    material: independent of the body's shape, so that a wrong unit of stiffness shows."""
    spacing = cKDTree(nodes).query(nodes, k=2)[0][:, 1]
    ratio = np.sqrt(np.abs(stiffness.diagonal()) / np.maximum(mass.diagonal(), 1e-300))
    own = float(np.median(ratio.reshape(-1, 3).mean(axis=1) * spacing))
    if _SPEEDS[0] < own / speed < _SPEEDS[1]:
        return []
    return [
        f"stiffness and mass give waves of {own:.2g} m/s, the material {speed:.2g} m/s: check `force_unit` (with "
        "`length`) and `mass_unit`"
    ]
