"""Small real mesh files, written by the tests themselves."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np

STEEL = SimpleNamespace(youngs_modulus=206e9, poisson_ratio=0.3, density=7850.0)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]])
# A brick cut into six tetrahedra along one diagonal; neighbours fit.
SIX = np.array([[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]])
TET_EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
TYPES = {"hexahedron": "C3D8", "hexahedron20": "C3D20", "tetra10": "C3D10"}


def grid(counts: tuple[int, int, int], size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Corner nodes (N, 3) and hex8 elements (E, 8) of a brick."""
    axes = [np.linspace(0, s, n + 1) for s, n in zip(size, counts, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(nodes)).reshape(*(n + 1 for n in counts))
    first = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    return nodes, index[tuple((first[:, None] + CORNERS).transpose(2, 0, 1))]


def quadratic(nodes: np.ndarray, corners: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mid nodes on the edges of linear elements."""
    pairs, place = np.unique(np.sort(corners[:, edges], axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    middle = len(nodes) + place.reshape(len(corners), -1)
    return np.concatenate([nodes, nodes[pairs].mean(axis=1)]), np.hstack([corners, middle])


def brick(kind: str, counts=(4, 2, 2), size=(40.0, 10.0, 8.0)) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (mm) and elements of a brick of one kind of element."""
    nodes, hexes = grid(counts, size)
    if kind == "hexahedron":
        return nodes, hexes
    if kind == "hexahedron20":
        return quadratic(nodes, hexes, EDGES)
    return quadratic(nodes, hexes[:, SIX].reshape(-1, 4), TET_EDGES)


def write_deck(path: Path, nodes: np.ndarray, cells: dict[str, np.ndarray], sets=None, tail: str = "") -> Path:
    """An Abqus/CalculiX deck: labels count from 1, coordinates in full precision, at most 16 numbers a line."""
    lines = ["*NODE, NSET=NALL", *(f"{k}, {x:.17g}, {y:.17g}, {z:.17g}" for k, (x, y, z) in enumerate(nodes, 1))]
    label = 0
    for kind, block in cells.items():
        lines.append(f"*ELEMENT, TYPE={TYPES.get(kind, kind)}, ELSET=EALL")
        for row in block + 1:
            label += 1
            words = [str(label), *map(str, row)]
            lines += [
                ", ".join(words[:11]) + ("," if len(words) > 11 else ""),
                *([", ".join(words[11:])] * (len(words) > 11)),
            ]
    for name, members in (sets or {}).items():
        lines.append(f"*NSET, NSET={name}")
        words = [str(m + 1) for m in members]
        lines += [", ".join(words[k : k + 12]) for k in range(0, len(words), 12)]
    path.write_text("\n".join([*lines, tail]) + "\n", encoding="utf-8")
    return path
