"""Small gears as other programs would give them, and the stage file around them."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from decks import STEEL, write_deck

from gearfmu.fem import hex20
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

COUNTS = {"flank = 20": "flank = 6", "thickness = 5": "thickness = 2", "root = 6": "root = 3", "rim = 4": "rim = 2",
          "width = 6": "width = 2", "modes = 400": "modes = 60", "roll_points = 28": "roll_points = 8",
          "width_functions = 5": "width_functions = 3"}  # fmt: skip


def stage(folder: Path, section: str = "") -> Stage:
    """fzg_c on a coarse mesh, with `section` as [gears.pinion.import]."""
    text = find_stage("fzg_c").read_text(encoding="utf-8")
    for old, new in COUNTS.items():
        assert old in text
        text = text.replace(old, new)
    if section:
        text = text.replace("[gears.pinion.body.mesh]", f"[gears.pinion.import]\n{section}\n\n[gears.pinion.body.mesh]")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "stage.toml"
    path.write_text(text, encoding="utf-8")
    return load_stage(path)


@lru_cache(maxsize=2)
def pinion(whole: bool = True) -> FeMesh:
    """The coarse mesh of fzg_c's pinion, all teeth or one sector."""
    spec = load_stage("fzg_c")
    geometry = gear_geometry(spec.gears[0], spec.written.pair)
    mesh = spec.gears[0].body.mesh.model_copy(update={"flank": 6, "thickness": 2, "root": 3, "rim": 2, "width": 2})
    sector = gear_sector(geometry, spec.gears[0].face_width, mesh)
    return sector.full() if whole else sector


def hex20_deck(path: Path, nodes: np.ndarray | None = None, whole: bool = True) -> Path:
    """The pinion as a deck in mm, its nodes moved to `nodes` (m) when given."""
    mesh = pinion(whole)
    points = 1e3 * (mesh.nodes if nodes is None else nodes)
    return write_deck(path, points, {"hexahedron20": mesh.elements}, {"BORE": mesh.sets["bore"]})


def without(mesh: FeMesh, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and elements of a mesh of which these elements are left."""
    used, new = np.unique(cells, return_inverse=True)
    return mesh.nodes[used], new.reshape(cells.shape)


def write_matrices(
    folder: Path,
    mesh: FeMesh,
    change: Callable[[sp.csr_array, sp.csr_array], tuple[sp.csr_array, sp.csr_array]] = lambda k, m: (k, m),
) -> None:
    """k.npz and m.npz (SI) of a steel body, changed."""
    for name, matrix in zip("km", change(*hex20.assemble(mesh.nodes, mesh.elements, STEEL)), strict=True):
        sp.save_npz(folder / f"{name}.npz", sp.csr_matrix(matrix))


def tetrahedra(mesh: FeMesh) -> tuple[np.ndarray, np.ndarray]:
    """The same body in tet10: every hexahedron in 24 about its middle, mid nodes on its own curved map."""
    natural = _cut_in_24()
    place = np.einsum("tpn,enc->etpc", np.stack([hex20.shape(t) for t in natural]), mesh.nodes[mesh.elements])
    points = place.reshape(-1, 3)
    key = np.round(points / (1e-7 * np.ptp(mesh.nodes))).astype(np.int64)
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return points[first], number.reshape(-1, 10)


@lru_cache(maxsize=1)
def _cut_in_24() -> np.ndarray:
    """Natural coordinates (24, 10, 3) of tetrahedra: body middle, face middle, and an edge of the face."""
    edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]
    found = []
    for face in hex20.FACES[:, :4]:
        ring = hex20.CORNERS[face]
        for k in range(4):
            corners = np.array([ring[(k + 1) % 4], ring[k], ring.mean(axis=0), np.zeros(3)])
            if np.linalg.det(corners[1:] - corners[0]) < 0:
                corners = corners[[1, 0, 2, 3]]
            found.append(np.vstack([corners, [corners[e].mean(axis=0) for e in edges]]))
    return np.array(found)
