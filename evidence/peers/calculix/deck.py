"""CalculiX decks of two helical gears in static contact, both whole. Lengths in mm, forces in N, stresses in MPa.

Small displacements, linear material, contact of surfaces by penalty pressure (no friction). All nodes of a bore are
held, the wheel's where it is, the pinion's turned about its axis by a given angle; between the bores the gears are free
in all directions. One contact pair for every layer of the width, so that its force can be printed. One load a deck: a
second step that starts from the first one's contact can end with teeth that stick (tensile pressure).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as sl

from evidence.peers.calculix.ccx import reactions
from evidence.peers.calculix.solid import Solid

YOUNGS, POISSON = 206e9, 0.3  # Pa, –
PENALTY = 1e16  # Pa/m: two pairs do not converge at 3e16; costs 0.3 % of stiffness at the pitch point
FORCE = re.compile(r"total surface force \(fx,fy,fz\)")
PAIR = re.compile(r"statistics for slave set (\S+), master set (\S+) and time")


@dataclass(frozen=True)
class Placed:
    """A gear where it stands. centre (2,) m, angle (rad) of its frame, turned: (rad) prescribed rotation of the bore.
    tilt (2,) rad: the axis is turned about x and y through its mid-width, first order."""

    name: str
    solid: Solid
    centre: np.ndarray
    angle: float
    turned: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)

    @property
    def nodes(self) -> np.ndarray:
        """(N, 3) m in the common frame."""
        return self.arms + [*self.centre, 0.0]

    @property
    def arms(self) -> np.ndarray:
        """(N, 3) m from the centre at mid-width, in the common frame."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        x, y = self.tilt
        rotation = sl.expm(np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]]))
        return self.solid.nodes @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ rotation.T


@dataclass(frozen=True)
class Problem:
    """gears: pinion "P" and wheel "W". pairs: their teeth that may touch."""

    gears: tuple[Placed, Placed]
    pairs: Sequence[tuple[int, int]]

    def numbered(self) -> Iterator[tuple[Placed, int, int]]:
        """Gears with their first node and element number; the wheel's come after the pinion's."""
        node, element = 1, 1
        for gear in self.gears:
            yield gear, node, element
            node, element = node + len(gear.solid.nodes), element + len(gear.solid.elements)

    def contacts(self) -> list[tuple[str, str]]:
        """Slave and master surface of every tooth pair, layers in order."""
        layers = len(next(iter(self.gears[0].solid.flank.values())))
        return [(_name("P", one, k), _name("W", other)) for one, other in self.pairs for k in range(layers)]


def node_lines(nodes: np.ndarray, start: int = 1, digits: int = 12) -> list[str]:
    """Numbered nodes (N, 3) m."""
    return [f"{k}, {x:.{digits}g}, {y:.{digits}g}, {z:.{digits}g}" for k, (x, y, z) in enumerate(1e3 * nodes, start)]


def element_lines(elements: np.ndarray, start: int = 1) -> list[str]:
    """Numbered 20-node hexahedra, two lines each; elements (E, 20) node numbers of the deck."""
    lines = []
    for k, row in enumerate(elements, start):
        text = [str(node) for node in row]
        lines += [f"{k}, " + ", ".join(text[:10]) + ",", ", ".join(text[10:])]
    return lines


def write_deck(problem: Problem, path: Path) -> None:
    """The deck of a problem."""
    lines = ["*NODE, NSET=ALL"]
    for gear, node, _ in problem.numbered():
        lines += node_lines(gear.nodes, node)
    for gear, node, element in problem.numbered():
        lines += [f"*ELEMENT, TYPE=C3D20R, ELSET=E{gear.name}", *element_lines(gear.solid.elements + node, element)]
        bore = gear.solid.bore + node
        lines += [f"*NSET, NSET=BORE{gear.name}"]
        lines += [", ".join(map(str, bore[k : k + 12])) + "," for k in range(0, len(bore), 12)]
    lines += _surfaces(problem)
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{1e-6 * YOUNGS:.9g}, {POISSON:.9g}"]
    lines += [f"*SOLID SECTION, ELSET=E{gear.name}, MATERIAL=STEEL" for gear in problem.gears]
    lines += ["*SURFACE INTERACTION, NAME=DRY", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{1e-9 * PENALTY:.9g}, 0.001"]
    for slave, master in problem.contacts():
        lines += ["*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE", f"{slave}, {master}"]
    path.write_text("\n".join(lines + _step(problem)) + "\n", encoding="ascii")


def _name(gear: str, tooth: int, layer: int | None = None) -> str:
    return f"{gear}{'M' if tooth < 0 else ''}{abs(tooth)}" + ("" if layer is None else f"L{layer}")


def _surfaces(problem: Problem) -> list[str]:
    """The pinion's flanks by layers, the wheel's as one, tip edges included."""
    lines = []
    (pinion, _, first), (wheel, _, other) = problem.numbered()
    surfaces = [(_name("P", t, k), faces, first) for t, all_of in pinion.solid.flank.items()
                for k, faces in enumerate(all_of)]  # fmt: skip
    surfaces += [(_name("W", t), all_of.reshape(-1, 2), other) for t, all_of in wheel.solid.flank.items()]
    for name, faces, start in surfaces:
        lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *(f"{start + e}, S{f}" for e, f in faces)]
    return lines


def _step(problem: Problem) -> list[str]:
    lines = ["*STEP, INC=100", "*STATIC, DIRECT", "1., 1.", "*BOUNDARY"]
    for gear, node, _ in problem.numbered():
        for number, (x, y, _) in zip(node + gear.solid.bore, 1e3 * gear.arms[gear.solid.bore], strict=True):
            lines += [f"{number}, 1, 1, {-gear.turned * y:.12g}", f"{number}, 2, 2, {gear.turned * x:.12g}"]
        lines += [f"BORE{gear.name}, 3, 3"]
    for gear in problem.gears:
        lines += [f"*NODE PRINT, NSET=BORE{gear.name}", "RF"]
    for slave, master in problem.contacts():
        lines += [f"*CONTACT PRINT, SLAVE={slave}, MASTER={master}", "CF"]
    return [*lines, "*END STEP"]


def pinion_load(problem: Problem, path: Path) -> np.ndarray:
    """(6,) force (N) and moment (N·m) about its mid-width that the pinion's bore exerts on it."""
    gear, node, _ = next(problem.numbered())
    forces = reactions(path)[f"BORE{gear.name}"]
    arm, force = gear.arms[np.array(list(forces)) - node], np.array(list(forces.values()))
    return np.concatenate([force.sum(axis=0), np.cross(arm, force).sum(axis=0)])


def layer_forces(problem: Problem, path: Path) -> np.ndarray:
    """(pairs, layers) N: contact force of every tooth pair in every layer."""
    found: dict[tuple[str, str], float] = {}
    lines = [line for line in path.read_text(encoding="ascii").splitlines() if line.strip()]
    for line, following in zip(lines, lines[1:], strict=False):
        if head := PAIR.search(line):
            current = head[1], head[2]
        elif FORCE.search(line):
            found[current] = float(np.linalg.norm([float(value) for value in following.split()[:3]]))
    forces = [found.get(pair, 0.0) for pair in problem.contacts()]
    return np.array(forces).reshape(len(problem.pairs), -1)
