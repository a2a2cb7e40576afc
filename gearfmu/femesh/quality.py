"""Quality of a mesh: scaled Jacobian, volume, elements per load patch; meshes as .vtu for ParaView."""

from __future__ import annotations

import os
from typing import Any

import meshio
import numpy as np

from gearfmu.fem import hex20
from gearfmu.femesh.mesh import FeMesh, FlankGrid
from gearfmu.files import written_whole


def scaled_jacobian(mesh: FeMesh) -> np.ndarray:
    """Smallest det J / (|J₁||J₂||J₃|) of each element (E,) over corners and 3³ Gauss points: 1 brick, ≤ 0 folded."""
    jacobian = _jacobian(mesh, np.concatenate([hex20.CORNERS, hex20.gauss_hex()[0]]))
    lengths = np.linalg.norm(jacobian, axis=3).prod(axis=2)
    return (np.linalg.det(jacobian) / lengths).min(axis=1)


def volume(mesh: FeMesh) -> float:
    """Volume (m³) of the mesh, 3³ Gauss points an element."""
    points, weights = hex20.gauss_hex()
    return float((np.linalg.det(_jacobian(mesh, points)) @ weights).sum())


def _jacobian(mesh: FeMesh, points: np.ndarray) -> np.ndarray:
    """(E, P, 3, 3) of every element at natural coordinates (P, 3)."""
    return np.einsum("pan,enc->epac", hex20.shape_gradient(points), mesh.nodes[mesh.elements], optimize=True)


def flank_element_length(grid: FlankGrid, r_b: float) -> float:
    """Largest arc length (m) of a flank element along the involute."""
    arc = grid.roll**2 / (2 * r_b)
    return float((arc.max(axis=1) - arc.min(axis=1)).max())


def mesh_report(mesh: FeMesh, r_b: float | None = None, strip_half_width: float | None = None) -> dict[str, Any]:
    """Plain facts of a mesh: counts, quality, volume (m³).

    With the base radius r_b (m) also the length of its flank elements (m), with the load patch (m) their number in one.
    """
    quality = scaled_jacobian(mesh)
    facts: dict[str, Any] = {
        "nodes": len(mesh.nodes),
        "dof": 3 * len(mesh.nodes),
        "elements": len(mesh.elements),
        "teeth": mesh.teeth,
        "scaled_jacobian_min": float(quality.min()),
        "scaled_jacobian_mean": float(quality.mean()),
        "volume": volume(mesh),
    }
    if r_b is not None and mesh.flank:
        length = flank_element_length(mesh.flank[0], r_b)
        facts |= {"flank_elements": list(mesh.flank[0].shape), "flank_element_length": length}
        if strip_half_width is not None:
            facts["elements_per_strip"] = 2 * strip_half_width / length
    return facts


def write_vtu(mesh: FeMesh, path: str | os.PathLike[str]) -> None:
    """Write hexahedra and flank faces, whole or not at all.

    Point data: `roll` (m, NaN off the flanks) and one 0/1 field per node set and cut. Cell data: `scaled_jacobian`
    (NaN on faces) and `flank` (0 solid, +1/−1 the flank side).
    """
    roll = np.full(len(mesh.nodes), np.nan)
    cells = [("hexahedron20", mesh.elements)]
    quality, sides = [scaled_jacobian(mesh)], [np.zeros(len(mesh.elements))]
    for side, grid in mesh.flank.items():
        roll[grid.quads] = grid.roll
        cells.append(("quad8", grid.quads))
        quality.append(np.full(len(grid.quads), np.nan))
        sides.append(np.full(len(grid.quads), 1.0 - 2.0 * side))
    marked = dict(mesh.sets) | {"cut_minus": mesh.cut_minus, "cut_plus": mesh.cut_plus}
    point_data = {"roll": roll} | {name: _marks(nodes, len(mesh.nodes)) for name, nodes in marked.items()}
    with written_whole(path) as temporary:
        grid = meshio.Mesh(mesh.nodes, cells, point_data, {"scaled_jacobian": quality, "flank": sides})
        grid.write(temporary, file_format="vtu")


def _marks(nodes: np.ndarray, count: int) -> np.ndarray:
    marks = np.zeros(count)
    marks[nodes] = 1.0
    return marks
