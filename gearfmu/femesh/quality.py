"""Is a mesh good enough? Scaled Jacobian, volume, elements per load strip."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearfmu.fem import hex20
from gearfmu.femesh.mesh import FeMesh, FlankGrid


def scaled_jacobian(mesh: FeMesh) -> np.ndarray:
    """Smallest det J / (|J₁||J₂||J₃|) of each element (E,) over corners and 3³ Gauss points: 1 brick, ≤ 0 folded."""
    points = np.concatenate([hex20.CORNERS, hex20.gauss_hex()[0]])
    jacobian = np.einsum("pan,enc->epac", hex20.shape_gradient(points), mesh.nodes[mesh.elements], optimize=True)
    lengths = np.linalg.norm(jacobian, axis=3).prod(axis=2)
    return (np.linalg.det(jacobian) / lengths).min(axis=1)


def volume(mesh: FeMesh) -> float:
    """Volume (m³) of the mesh, 3³ Gauss points an element."""
    points, weights = hex20.gauss_hex()
    jacobian = np.einsum("pan,enc->epac", hex20.shape_gradient(points), mesh.nodes[mesh.elements], optimize=True)
    return float((np.linalg.det(jacobian) @ weights).sum())


def flank_element_length(grid: FlankGrid, r_b: float) -> float:
    """Largest arc length (m) of a flank element along the involute."""
    arc = grid.roll**2 / (2 * r_b)
    return float((arc.max(axis=1) - arc.min(axis=1)).max())


def mesh_report(mesh: FeMesh, r_b: float | None = None, strip_half_width: float | None = None) -> dict[str, Any]:
    """Plain facts of a mesh: counts, quality, volume (m³).

    With the base radius r_b (m) also the length of its flank elements (m), with the load strip (m) how many lie in one.
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
