"""Modes of a body that is not taken by sectors: with rigid couplings at its interfaces, or held by springs."""

from __future__ import annotations

import numpy as np

from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import rigid_fields
from gearfmu.fem.cyclic import mirror_nodes
from gearfmu.femesh.mesh import FeMesh
from gearfmu.modes.shapes import BodyModes, Mode, energy_shares, harmonic_shares
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder

TOGETHER = 1e-5  # relative: frequencies this close are a pair


def whole_modes(
    body: FullOrder, mesh: FeMesh, slaves: dict[str, np.ndarray], material: hex20.Material, count: int
) -> BodyModes:
    """The `count` lowest elastic modes of a FullOrder body (one more where that would split a pair); damping is NaN.

    mesh : its finite elements, all of them. slaves : node numbers of each rigid coupling, by the interface's name.
    The nodal diameter is the harmonic around the axis with most of the surface's mean square. Raises ModesError.
    """
    squared, vectors = elastic(body).modes(count + 1)
    frequency = np.sqrt(squared) / (2 * np.pi)
    mass = hex20.assemble(mesh.nodes, mesh.elements, material)[1][::3, ::3]
    faces = surface.boundary_faces(mesh.elements)
    used, local = np.unique(faces, return_inverse=True)
    modes, k = [], 0
    while k < min(count, len(frequency)):
        pair = k + 1 < len(frequency) and frequency[k + 1] / frequency[k] - 1 < TOGETHER
        numbers = (k + 1, k + 2) if pair else (k + 1,)
        shapes = np.stack([at_nodes(body, vectors[:, n - 1], mesh.nodes, slaves) for n in numbers])
        shares = np.mean([harmonic_shares(mesh.nodes[used], shape[used]) for shape in shapes], axis=0)
        modes.append(
            Mode(
                numbers=numbers,
                frequency=float(frequency[k]),
                damping_ratio=float("nan"),
                parity=_parity(mesh.nodes, shapes[0]),
                nodal_diameter=int(np.argmax(shares)),
                harmonic_share=float(shares.max()),
                energy=np.mean([energy_shares(mesh.nodes, mass, shape) for shape in shapes], axis=0),
                shape=shapes[:, used],
            )
        )
        k += len(numbers)
    return BodyModes(body.name, mesh.nodes[used], local.reshape(-1, 8), tuple(modes))


def at_nodes(body: FullOrder, vector: np.ndarray, nodes: np.ndarray, slaves: dict[str, np.ndarray]) -> np.ndarray:
    """Displacement (N, 3) of all nodes from the unknowns (n,) of the body: slaves move with their masters."""
    flat = np.full(nodes.size, np.nan)
    free = body.node_of_dof < len(nodes)
    numbers = body.node_of_dof[free]
    _, first = np.unique(numbers, return_index=True)
    component = np.arange(len(numbers)) - first[np.searchsorted(numbers[first], numbers)]
    flat[3 * numbers + component] = vector[free]
    shape = flat.reshape(-1, 3)
    for interface in body.interfaces:
        if interface.kind == "rigid":
            mine = slaves[interface.name]
            shape[mine] = rigid_fields(nodes[mine] - interface.point) @ (interface.rows @ vector)
    assert np.isfinite(shape).all(), "every node is an unknown of the body or the slave of a coupling"
    return shape


def _parity(nodes: np.ndarray, shape: np.ndarray) -> int:
    """+1 or −1 for a shape that is symmetric or antisymmetric about the middle of a body which is so, else 0."""
    mirror = mirror_nodes(nodes)
    if mirror is None:
        return 0
    even = float(((shape + shape[mirror] * [1, 1, -1]) ** 2).sum() / (4 * (shape**2).sum()))
    return 1 if even > 0.99 else -1 if even < 0.01 else 0
