"""Hexahedra as an Abaqus deck, and the outside of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]  # of a hexahedron
MODELS = Path(__file__).resolve().parents[2] / "reduced_models"


def boundary(cells: np.ndarray) -> np.ndarray:
    """Faces (F, 4) that only one of the hexahedra (E, 8) has."""
    faces = cells[:, FACES].reshape(-1, 4)
    _, index, number = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[index[number == 1]]


def abaqus(heading: str, nodes: np.ndarray, cells: np.ndarray, sets: dict[str, np.ndarray]) -> str:
    """8-node hexahedra (E, 8), nodes (N, 3) mm, of which those of no hexahedron are left out, and node sets by name."""
    used = np.unique(cells)
    number = np.zeros(len(nodes), int)
    number[used] = np.arange(1, len(used) + 1)
    lines = ["*HEADING", heading, "*NODE"]
    lines += [f"{number[n]},{nodes[n, 0]:.7g},{nodes[n, 1]:.7g},{nodes[n, 2]:.7g}" for n in used]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=ALL"]
    lines += [f"{k},{','.join(str(number[n]) for n in cell)}" for k, cell in enumerate(cells, start=1)]
    for name, own in sets.items():
        lines.append(f"*NSET, NSET={name.upper()}")
        lines += [",".join(str(number[n]) for n in own[k : k + 16]) for k in range(0, len(own), 16)]
    return "\n".join(lines) + "\n"


def write(text: str, stage: str) -> None:
    """Writes a deck to the file that the command line names, or as `housing.inp` of a shipped stage."""
    target = Path(sys.argv[1]) if sys.argv[1:] else MODELS / stage / "housing.inp"
    target.write_text(text, encoding="utf-8")
    print(f"{target}: {target.stat().st_size / 1e3:.0f} kB")
