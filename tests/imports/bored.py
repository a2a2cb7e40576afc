"""Coarse finite elements of a housing for two_stage: a block with a bore along every shaft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from decks import EDGES, quadratic

from evidence.bodies import deck
from evidence.bodies.housing_box import Bore, Plane

LINES = (
    ((-50, 50, 2), (50, 114, 1), (114, 156, 1), (156, 234, 1)),
    ((-53, 53, 2), (53, 63, 1), (63, 183, 2)),
)
BORES = {
    name: Bore(name, axis, block, (radius,), ((0, 0), (0, 0)), ((0, 0), (0, 0)))
    for name, axis, block, radius in (
        ("input", (0, 0), (-50, 50, -53, 53), 36),
        ("intermediate", (103, 0), (50, 156, -53, 53), 40),
        ("output", (174, 122.975607), (114, 234, 63, 183), 45),
    )
}
SENSORS = {"top": (114, 183, 168), "cover": (50, 53, 168)}


@dataclass(frozen=True)
class Block:
    """nodes (N, 3) mm, cells (E, 20); sets: of nodes by name, seats as asked, feet, sensors, "outside"; skin: outer
    faces (F, 4) by their corners, normals outward. Seats have corners alone, which lie on their circles."""

    nodes: np.ndarray
    cells: np.ndarray
    sets: dict[str, np.ndarray]
    skin: np.ndarray


def block(levels: tuple[float, ...], seats: dict[str, tuple[str, float, float]]) -> Block:
    """The block between these levels, mm; seats: of a bore by its name, from level to level."""
    plane = Plane(LINES, tuple(BORES.values()))
    flat, quads = np.array(plane.points), np.array(plane.quads)
    nodes = np.vstack([np.column_stack([flat, np.full(len(flat), float(z))]) for z in levels])
    layers = len(flat) * np.arange(len(levels) - 1)
    corners = np.concatenate([np.hstack([quads + low, quads + low + len(flat)]) for low in layers])
    x, y, z = nodes.T
    on = {name: np.hypot(x - own.axis[0], y - own.axis[1]) < own.radii[0] + 1e-2 for name, own in BORES.items()}
    sets = {name: np.flatnonzero(on[bore] & (z >= low) & (z <= high)) for name, (bore, low, high) in seats.items()}
    ends = z <= levels[1], z >= levels[-2]
    for k, (end, side) in enumerate((end, side) for end in ends for side in (x <= 0, x >= 156)):
        sets[f"foot{k}"] = np.flatnonzero((y == y.min()) & end & side)
    for name, place in SENSORS.items():
        sets[name] = np.array([np.argmin(np.linalg.norm(nodes - place, axis=1))])
    faces = deck.boundary(corners)
    inside = np.any([own[faces].all(axis=1) for own in on.values()], axis=0)
    skin = faces[~inside]
    nodes, cells = quadratic(nodes, corners, EDGES)
    middle = cells[:, 8:][np.isin(corners[:, EDGES], skin).all(axis=2)]
    return Block(nodes, cells, sets | {"outside": np.union1d(skin, middle)}, skin)
