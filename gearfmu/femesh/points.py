"""Where the points of a superelement lie: GRID cards of Nastran, or *NODE of an Abaqus or CalculiX deck."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.fem.nastran_matrices import bulk_cards, bulk_number
from gearfmu.femesh.abaqus import read_deck


def read_points(path: Path) -> dict[int, np.ndarray]:
    """Coordinates (3,) of every point by its label, in the file's unit. MeshError for a file without points, and for
    points in another system of coordinates."""
    if path.suffix.lower() == ".inp":
        found = {label: np.array(point, float) for label, point in read_deck(path).nodes.items()}
    else:
        found = _grids(path)
    if not found:
        raise MeshError(f"{path}: no GRID card and no *NODE: name the file that says where the points lie")
    return found


def _grids(path: Path) -> dict[int, np.ndarray]:
    try:
        cards = [card for card in bulk_cards(path) if card[0].rstrip("*") == "GRID"]
    except OSError as error:
        raise MeshError(f"{path}: the file cannot be read ({error.strerror}): check the path") from None
    found = {}
    for card in cards:
        if card[2] not in ("", "0"):
            raise MeshError(f"{path}: GRID {card[1]} is in coordinate system {card[2]}: write it in the basic system")
        try:
            found[int(card[1])] = np.array([bulk_number(text or "0.0") for text in card[3:6]])
        except ValueError as error:
            raise MeshError(f"{path}: GRID {card[1]} cannot be read ({error}): correct this card") from None
    return found
