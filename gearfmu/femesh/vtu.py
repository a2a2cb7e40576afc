"""Meshes as .vtu for ParaView and other tools."""

from __future__ import annotations

import os

import meshio
import numpy as np

from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.quality import scaled_jacobian
from gearfmu.files import written_whole


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
