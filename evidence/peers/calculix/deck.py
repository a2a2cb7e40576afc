"""CalculiX decks of two gears in static contact. Lengths in mm, forces in N, stresses in MPa.

Small displacements, linear material, contact of surfaces by penalty pressure (no friction). The wheel's bore is held;
the pinion's is turned about its axis by a given angle; the bores' reactions are printed. One load a deck: a second
step that starts from the first one's contact can end with teeth that stick (tensile pressure).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evidence.peers.calculix.solid import Solid


@dataclass(frozen=True)
class Placed:
    """A gear where it stands. centre (2,) m, angle (rad) of its frame, held: "clamped" (every bore node) or "averaged"
    (mean displacement and rotation of the bore surface). turned: (rad) prescribed rotation of the bore."""

    name: str
    solid: Solid
    centre: np.ndarray
    angle: float
    held: str
    turned: float

    @property
    def nodes(self) -> np.ndarray:
        """(N, 3) m in the common frame."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        turned = self.solid.nodes @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        return turned + [*self.centre, 0.0]


@dataclass(frozen=True)
class Problem:
    """gears: pinion, wheel. pairs: their teeth that may touch; half the width, the low end face a plane of symmetry.
    youngs, poisson: Pa, –. penalty: Pa/m. increments: equal parts in which the pinion is turned."""

    gears: tuple[Placed, Placed]
    pairs: Sequence[tuple[int, int]]
    youngs: float = 206e9
    poisson: float = 0.3
    penalty: float = 3e16
    element: str = "C3D20R"
    increments: int = 1


def write_deck(problem: Problem, path: Path) -> None:
    """The deck of a problem; one node numbering, the wheel's nodes after the pinion's, dummy nodes of averaging last.

    The pinion's fine zone is the slave surface, the wheel's whole flank the master."""
    lines = ["*NODE, NSET=ALL"]
    for gear, (node, _) in zip(problem.gears, starts(problem), strict=True):
        lines += [f"{node + k}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(1e3 * gear.nodes)]
    for gear, (node, element), zone in zip(problem.gears, starts(problem), ("patch", "flank"), strict=True):
        lines += [f"*ELEMENT, TYPE={problem.element}, ELSET=E{gear.name}"]
        for k, row in enumerate(gear.solid.elements + node):
            text = [str(n) for n in row]
            lines += [f"{element + k}, " + ", ".join(text[:10]) + ",", ", ".join(text[10:])]
        lines += node_set(f"BORE{gear.name}", gear.solid.bore + node)
        for side in ("low", "high"):
            lines += node_set(f"{side.upper()}{gear.name}", getattr(gear.solid, side) + node)
        for tooth, faces in getattr(gear.solid, zone).items():
            lines += [f"*SURFACE, NAME={_tooth(gear, tooth)}, TYPE=ELEMENT"]
            lines += [f"{element + e}, S{f}" for e, f in faces]
    lines += _physics(problem) + _step(problem)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def starts(problem: Problem) -> list[tuple[int, int]]:
    """First node and element number of either gear."""
    first = problem.gears[0].solid
    return [(1, 1), (len(first.nodes) + 1, len(first.elements) + 1)]


def _dummies(problem: Problem) -> list[int]:
    """Number of either gear's node whose displacements are the bore's mean x, mean y and rotation × 1 mm."""
    last = sum(len(gear.solid.nodes) for gear in problem.gears)
    return [last + 1, last + 2]


def _tooth(gear: Placed, tooth: int) -> str:
    return f"T{gear.name}{tooth}".replace("-", "M")


def node_set(name: str, nodes: np.ndarray) -> list[str]:
    return [f"*NSET, NSET={name}"] + [", ".join(map(str, nodes[k : k + 12])) + "," for k in range(0, len(nodes), 12)]


def _physics(problem: Problem) -> list[str]:
    lines = ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{1e-6 * problem.youngs:.9g}, {problem.poisson:.9g}"]
    for gear, dummy, (node, _) in zip(problem.gears, _dummies(problem), starts(problem), strict=True):
        lines += [f"*SOLID SECTION, ELSET=E{gear.name}, MATERIAL=STEEL"]
        lines += ["*BOUNDARY", f"LOW{gear.name}, 3, 3"]
        if gear.held == "averaged":
            lines += ["*NODE, NSET=ALL", f"{dummy}, 0, 0, 0", *_averaging(gear, dummy, node)]
    lines += ["*SURFACE INTERACTION, NAME=DRY", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{1e-9 * problem.penalty:.9g}, 0.001"]
    first, second = problem.gears
    for one, other in problem.pairs:
        lines += ["*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE"]
        lines += [f"{_tooth(first, one)}, {_tooth(second, other)}"]
    return lines


def _averaging(gear: Placed, dummy: int, start: int) -> list[str]:
    """Equations Σ row·u = dummy, reduced so that each has a dependent displacement of its own."""
    r = 1e3 * (gear.nodes[gear.solid.bore, :2] - gear.centre)
    w, zero = gear.solid.weights, np.zeros(len(gear.solid.weights))
    polar = w @ (r * r).sum(axis=1)
    means = ([w, zero], [zero, w], [-w * r[:, 1] / polar, w * r[:, 0] / polar])
    rows = np.array([np.ravel(mean, order="F") for mean in means])
    here = int(np.argmax(w))
    there = int(np.argmax(w * np.linalg.norm(r - r[here], axis=1)))
    other = 2 * there + int(np.argmax(np.abs([r[there, 1] - r[here, 1], r[there, 0] - r[here, 0]])))
    pivots = [2 * here, 2 * here + 1, other]
    inverse = np.linalg.inv(rows[:, pivots])
    lines = []
    for equation, (row, mean) in enumerate(zip(inverse @ rows, inverse, strict=True)):
        columns = [pivots[equation]] + [c for c in np.flatnonzero(row) if c not in pivots]
        terms = [(start + gear.solid.bore[c // 2], c % 2 + 1, row[c]) for c in columns]
        terms += [(dummy, k + 1, -mean[k]) for k in range(3) if mean[k] != 0]
        lines += ["*EQUATION", str(len(terms))]
        text = [f"{node}, {axis}, {value:.14g}" for node, axis, value in terms]
        lines += [", ".join(text[k : k + 4]) for k in range(0, len(text), 4)]
    return lines


def _step(problem: Problem) -> list[str]:
    share = "1." if problem.increments == 1 else f"{1 / problem.increments + 1e-3:.3f}"  # the last one is shorter
    lines = ["*STEP, INC=100", "*STATIC, DIRECT", f"{share}, 1.", "*BOUNDARY"]
    for gear, dummy, (node, _) in zip(problem.gears, _dummies(problem), starts(problem), strict=True):
        angle = gear.turned
        if gear.held == "averaged":
            lines += [f"{dummy}, 1, 2, 0", f"{dummy}, 3, 3, {angle:.12g}"]
            continue
        arm = 1e3 * (gear.nodes[gear.solid.bore, :2] - gear.centre)
        for number, (x, y) in zip(node + gear.solid.bore, arm, strict=True):
            lines += [f"{number}, 1, 1, {-angle * y:.12g}", f"{number}, 2, 2, {angle * x:.12g}"]
        lines += [f"BORE{gear.name}, 3, 3"]
    for gear in problem.gears:
        lines += [f"*NODE PRINT, NSET=BORE{gear.name}", "RF"]
    return [*lines, "*END STEP"]
