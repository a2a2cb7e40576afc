"""Mesh of the housing of planetary54: a drum with a seat for the ring inside, an opening for a shaft in either end, and
four feet.

    python -m evidence.bodies.housing_drum [FILE]     # reduced_models/planetary54/housing.inp when none is named

Rings of a plane mesh, drawn out along the axis of the set. Millimetres; 8-node hexahedra, which the import makes
quadratic.
"""

from __future__ import annotations

import numpy as np

from evidence.bodies import deck

RADII = np.array([24, 36, 49, 65, 82, 88, 94, 104, 114])  # shaft, plate, seat, inside, outside, feet
SHAFT, SEAT, INSIDE, OUTSIDE = (RADII.tolist().index(r) for r in (24, 82, 88, 94))
LEVELS = np.array([-42, -34, -22, -10, 0, 10, 22, 34, 42])
PLATE, RIM, FOOT = 34, 10, 22  # |z| where end plates begin, to which the seat reaches, where feet begin
SECTORS = 40
FEET = {"right": (33, 34, 35), "left": (24, 25, 26)}  # sectors, about 45 deg below the horizontal
CORNERS = [(i, j, k) for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]  # of a hexahedron


def hexahedra() -> np.ndarray:
    """(E, 8): numbers of nodes, which count radii first, then sectors, then levels."""
    found = []
    below = {sector for own in FEET.values() for sector in own}
    for layer, (low, high) in enumerate(zip(LEVELS, LEVELS[1:], strict=False)):
        middle = abs(low + high) / 2
        for sector in range(SECTORS):
            for ring in range(len(RADII) - 1):
                wall = INSIDE <= ring < OUTSIDE or (SEAT <= ring < OUTSIDE and middle < RIM)
                foot = ring >= OUTSIDE and sector in below and middle > FOOT
                if wall or foot or (ring < OUTSIDE and middle > PLATE):
                    found.append([_node(ring + i, sector + j, layer + k) for i, j, k in CORNERS])
    return np.array(found)


def _node(ring: int, sector: int, level: int) -> int:
    return (level * SECTORS + sector % SECTORS) * len(RADII) + ring


def places() -> tuple[np.ndarray, np.ndarray]:
    """Nodes (N, 3) mm, and of every node its ring, sector and level (N, 3)."""
    level, sector, ring = np.meshgrid(*(np.arange(n) for n in (len(LEVELS), SECTORS, len(RADII))), indexing="ij")
    angle = 2 * np.pi * sector / SECTORS
    points = np.stack([RADII[ring] * np.cos(angle), RADII[ring] * np.sin(angle), LEVELS[level]], axis=-1)
    return points.reshape(-1, 3), np.stack([ring, sector, level], axis=-1).reshape(-1, 3)


def node_sets(nodes: np.ndarray, at: np.ndarray, cells: np.ndarray) -> dict[str, np.ndarray]:
    """The seat of the ring, feet, sensors and the skin by name: numbers of nodes."""
    used = np.unique(cells)
    ring, sector, _ = at.T
    found = {"ring": used[((ring == SEAT) & (np.abs(nodes[:, 2]) <= RIM))[used]]}
    for side, own in FEET.items():
        on = (ring == len(RADII) - 1) & np.isin(sector, [*own, own[-1] + 1])
        for end, beyond in (("front", nodes[:, 2] <= -FOOT), ("back", nodes[:, 2] >= FOOT)):
            found[f"{side}_{end}"] = used[(on & beyond)[used]]
    faces = deck.boundary(cells)
    inside = (ring <= INSIDE) & (np.abs(nodes[:, 2]) <= PLATE)
    opening = np.all(ring[faces] == SHAFT, axis=1)
    skin = np.unique(faces[~opening & ~np.all(inside[faces], axis=1)])
    for name, place in (("top", (0, 94, 0)), ("cover", (0, 49, 42)), ("foot", (94, 0, -42))):
        found[f"sensor_{name}"] = skin[[np.argmin(np.linalg.norm(nodes[skin] - place, axis=1))]]
    return found | {"outside": skin}


if __name__ == "__main__":
    points, where = places()
    drum = hexahedra()
    heading = "housing of planetary54, millimetres (evidence/bodies/housing_drum.py)"
    deck.write(deck.abaqus(heading, points, drum, node_sets(points, where, drum)), "planetary54")
