"""Mesh of the housing of two_stage: a closed box with a bore for every bearing, and four feet.

    python -m evidence.bodies.housing_box [FILE]      # reduced_models/two_stage/housing.inp when none is named

A plane mesh of quadrilaterals across the shafts, drawn out along them: end walls take all of it, side walls its outer
ring, bosses the rings round the bores. Millimetres; 8-node hexahedra, which the import makes quadratic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evidence.bodies import deck

Line = tuple[tuple[float, float, int], ...]
LINES = (  # from, to, cells: the first and last are side walls
    ((-60, -50, 1), (-50, 50, 6), (50, 114, 4), (114, 156, 3), (156, 234, 5), (234, 290, 3), (290, 300, 1)),
    ((-90, -80, 1), (-80, -53, 2), (-53, 53, 6), (53, 63, 1), (63, 183, 7), (183, 240, 3), (240, 250, 1)),
)
LEVELS = (0, 6, 12, 20, 28, 46, 64, 82, 100, 109, 118, 124, 130, 138, 152, 160, 168)
LEFT, RIGHT = (0, 12), (118, 130)  # end walls


@dataclass(frozen=True)
class Bore:
    """A bore: axis, block of the plane mesh that its rings replace, radii of bore and boss, and from where to where
    along the shafts its left and right bosses and seats reach; mm."""

    name: str
    axis: tuple[float, float]
    block: tuple[float, float, float, float]
    radii: tuple[float, ...]
    bosses: tuple[tuple[int, int], tuple[int, int]]
    seats: tuple[tuple[int, int], tuple[int, int]]


BORES = (
    Bore("input", (0, 0), (-50, 50, -53, 53), (36, 44), ((0, 28), (100, 130)), ((0, 20), (100, 118))),
    Bore("intermediate", (103, 0), (50, 156, -53, 53), (40, 47), ((0, 28), (118, 138)), ((0, 20), (118, 130))),
    Bore("output", (174, 122.975607), (114, 234, 63, 183), (45, 54), ((0, 28), (118, 168)), ((12, 28), (152, 168))),
)


class Plane:
    """Quadrilaterals across the shafts, of lines along x and y, with bores. points; quads (F, 4); ring: of the side
    walls; boss: number of the bore, −1."""

    def __init__(self, lines: tuple[Line, Line], bores: tuple[Bore, ...]) -> None:
        self.points: list[tuple[float, float]] = []
        self.quads: list[list[int]] = []
        self.ring: list[bool] = []
        self.boss: list[int] = []
        self._known: dict[tuple[float, float], int] = {}
        x, y = (_line(parts) for parts in lines)
        for i in range(len(x) - 1):
            for j in range(len(y) - 1):
                middle = 0.5 * (x[i] + x[i + 1]), 0.5 * (y[j] + y[j + 1])
                if not any(b.block[0] < middle[0] < b.block[1] and b.block[2] < middle[1] < b.block[3] for b in bores):
                    corners = [(x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1])]
                    edge = i in (0, len(x) - 2) or j in (0, len(y) - 2)
                    self._add(corners, edge, -1)
        for number, bore in enumerate(bores):
            self._rings(number, bore, x, y)

    def _rings(self, number: int, bore: Bore, x: np.ndarray, y: np.ndarray) -> None:
        """Rings between a block's edge and the bore, by its radii: to the boss, and the boss."""
        low, high, bottom, top = bore.block
        across, along = x[(x >= low) & (x <= high)], y[(y >= bottom) & (y <= top)]
        edge = [(v, bottom) for v in across[:-1]] + [(high, v) for v in along[:-1]]
        edge += [(v, top) for v in across[:0:-1]] + [(low, v) for v in along[:0:-1]]
        circles = [edge]
        for radius in bore.radii[::-1]:
            angles = [math.atan2(v - bore.axis[1], u - bore.axis[0]) for u, v in edge]
            circles.append([(bore.axis[0] + radius * math.cos(a), bore.axis[1] + radius * math.sin(a)) for a in angles])
        for inside, (outer, inner) in enumerate(zip(circles, circles[1:], strict=False)):
            for k in range(len(edge)):
                n = (k + 1) % len(edge)
                self._add([outer[k], outer[n], inner[n], inner[k]], False, number if inside else -1)

    def _add(self, corners: list[tuple[float, float]], ring: bool, boss: int) -> None:
        self.quads.append([self._point(*corner) for corner in corners])
        self.ring.append(ring)
        self.boss.append(boss)

    def _point(self, x: float, y: float) -> int:
        key = round(float(x), 4), round(float(y), 4)
        if key not in self._known:
            self._known[key] = len(self.points)
            self.points.append(key)
        return self._known[key]


def _line(parts: Line) -> np.ndarray:
    return np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in parts] + [[parts[-1][1]]])


def hexahedra(plane: Plane) -> np.ndarray:
    """(E, 8): number of a level times points plus point of the plane."""
    count, found = len(plane.points), []
    for layer, (low, high) in enumerate(zip(LEVELS, LEVELS[1:], strict=False)):
        wall = any(a <= low and high <= b for a, b in (LEFT, RIGHT))
        side = LEFT[0] <= low and high <= RIGHT[1]
        for quad, ring, boss in zip(plane.quads, plane.ring, plane.boss, strict=True):
            bossed = boss >= 0 and any(a <= low and high <= b for a, b in BORES[boss].bosses)
            if wall or (side and ring) or bossed:
                found.append([layer * count + p for p in quad] + [(layer + 1) * count + p for p in quad])
    return np.array(found)


def outside(cells: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Nodes of the outer surface: of boundary faces that neither a bore's surface nor the inside of the box has."""
    faces = deck.boundary(cells)
    x, y, z = (nodes[faces][..., k] for k in range(3))
    (left, right), (bottom, top) = ((parts[0][0], parts[-1][1]) for parts in LINES)
    flat = [np.ptp(x, axis=1) == 0, np.ptp(y, axis=1) == 0, np.ptp(z, axis=1) == 0]
    sides = (flat[0] & np.isin(x[:, 0], (left, right))) | (flat[1] & np.isin(y[:, 0], (bottom, top)))
    ends = flat[2] & ((z[:, 0] == LEFT[0]) | (z[:, 0] >= RIGHT[1]))
    beyond = (z.min(axis=1) >= RIGHT[1]) & ~flat[2]
    boss = np.zeros(len(faces), bool)
    for bore in BORES:
        radius = np.hypot(x - bore.axis[0], y - bore.axis[1])
        boss |= beyond & np.all(np.abs(radius - bore.radii[1]) < 1e-2, axis=1)
    return np.unique(faces[sides | ends | boss])


def node_sets(plane: Plane, cells: np.ndarray, nodes: np.ndarray) -> dict[str, np.ndarray]:
    """Seats, feet, sensors and the skin by name: numbers of nodes."""
    used, z = np.unique(cells), nodes[:, 2]
    found = {}
    for bore in BORES:
        on = np.abs(np.hypot(nodes[:, 0] - bore.axis[0], nodes[:, 1] - bore.axis[1]) - bore.radii[0]) < 1e-2
        for side, (low, high) in zip(("left", "right"), bore.seats, strict=True):
            found[f"{bore.name}_{side}"] = used[(on & (z >= low) & (z <= high))[used]]
    bottom = nodes[:, 1] == LINES[1][0][0]
    for k, (across, along) in enumerate((a, b) for b in (z <= 20, (z >= 109) & (z <= 130)) for a in
                                        (nodes[:, 0] <= -33, nodes[:, 0] >= 271)):  # fmt: skip
        found[f"foot{k}"] = used[(bottom & across & along)[used]]
    skin = outside(cells, nodes)
    for name, place in (("top", (120, 250, 64)), ("cover", (60, 160, 130)), ("foot", (-60, -60, 0))):
        found[f"sensor_{name}"] = skin[[np.argmin(np.linalg.norm(nodes[skin] - place, axis=1))]]
    return found | {"outside": skin}


def text() -> str:
    """The mesh as an Abaqus deck."""
    plane = Plane(LINES, BORES)
    cells = hexahedra(plane)
    flat = np.array(plane.points)
    nodes = np.vstack([np.column_stack([flat, np.full(len(flat), float(z))]) for z in LEVELS])
    heading = "housing of two_stage, millimetres (evidence/bodies/housing_box.py)"
    return deck.abaqus(heading, nodes, cells, node_sets(plane, cells, nodes))


if __name__ == "__main__":
    deck.write(text(), "two_stage")
