"""CalculiX decks of two helical gears in static contact, both whole: as deck.py with clamped bores, but free between
them in all directions, with one contact pair for every layer of the width, so that its force can be printed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as sl

from evidence.peers.calculix.ccx import reactions
from evidence.peers.calculix.deck import Placed, Problem, node_set, starts

FORCE = re.compile(r"total surface force \(fx,fy,fz\)")
PAIR = re.compile(r"statistics for slave set (\S+), master set (\S+) and time")


@dataclass(frozen=True)
class Tilted(Placed):
    """A gear whose axis is turned about x and y through its mid-width by `tilt` (2,) rad, first order."""

    tilt: tuple[float, float] = (0.0, 0.0)

    @property
    def nodes(self) -> np.ndarray:
        """(N, 3) m in the common frame."""
        x, y = self.tilt
        arm = super().nodes - [*self.centre, 0.0]
        rotation = sl.expm(np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]]))
        return arm @ rotation.T + [*self.centre, 0.0]


def write_spatial_deck(problem: Problem, path: Path) -> None:
    """The deck of a problem whose solids have flanks by layers (helical_section.py)."""
    lines = ["*NODE, NSET=ALL"]
    for gear, (node, _) in zip(problem.gears, starts(problem), strict=True):
        lines += [f"{node + k}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(1e3 * gear.nodes)]
    for gear, (node, element) in zip(problem.gears, starts(problem), strict=True):
        lines += [f"*ELEMENT, TYPE={problem.element}, ELSET=E{gear.name}"]
        for k, row in enumerate(gear.solid.elements + node):
            text = [str(n) for n in row]
            lines += [f"{element + k}, " + ", ".join(text[:10]) + ",", ", ".join(text[10:])]
        lines += node_set(f"BORE{gear.name}", gear.solid.bore + node)
    lines += _surfaces(problem)
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{1e-6 * problem.youngs:.9g}, {problem.poisson:.9g}"]
    lines += [f"*SOLID SECTION, ELSET=E{gear.name}, MATERIAL=STEEL" for gear in problem.gears]
    lines += ["*SURFACE INTERACTION, NAME=DRY", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{1e-9 * problem.penalty:.9g}, 0.001"]
    for slave, master in contact_pairs(problem):
        lines += ["*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE", f"{slave}, {master}"]
    path.write_text("\n".join(lines + _step(problem)) + "\n", encoding="ascii")


def contact_pairs(problem: Problem) -> list[tuple[str, str]]:
    """Slave and master surface of every tooth pair, layers in order."""
    layers = len(next(iter(problem.gears[0].solid.flank.values())))
    return [(_name("P", one, k), _name("W", other, None)) for one, other in problem.pairs for k in range(layers)]


def _name(gear: str, tooth: int, layer: int | None) -> str:
    return f"{gear}{'M' if tooth < 0 else ''}{abs(tooth)}" + ("" if layer is None else f"L{layer}")


def _surfaces(problem: Problem) -> list[str]:
    """The pinion's flanks by layers, the wheel's as one, tip edges included."""
    lines = []
    (first, (_, start)), (second, (_, other)) = zip(problem.gears, starts(problem), strict=True)
    for tooth, layers in first.solid.flank.items():
        for k, faces in enumerate(layers):
            lines += [f"*SURFACE, NAME={_name('P', tooth, k)}, TYPE=ELEMENT"]
            lines += [f"{start + e}, S{f}" for e, f in faces]
    for tooth, layers in second.solid.flank.items():
        lines += [f"*SURFACE, NAME={_name('W', tooth, None)}, TYPE=ELEMENT"]
        lines += [f"{other + e}, S{f}" for e, f in layers.reshape(-1, 2)]
    return lines


def _step(problem: Problem) -> list[str]:
    lines = ["*STEP, INC=100", "*STATIC, DIRECT", "1., 1.", "*BOUNDARY"]
    for gear, (node, _) in zip(problem.gears, starts(problem), strict=True):
        arm = 1e3 * (gear.nodes[gear.solid.bore] - [*gear.centre, 0.0])
        for number, (x, y, _) in zip(node + gear.solid.bore, arm, strict=True):
            lines += [f"{number}, 1, 1, {-gear.turned * y:.12g}", f"{number}, 2, 2, {gear.turned * x:.12g}"]
        lines += [f"BORE{gear.name}, 3, 3"]
    for gear in problem.gears:
        lines += [f"*NODE PRINT, NSET=BORE{gear.name}", "RF"]
    for slave, master in contact_pairs(problem):
        lines += [f"*CONTACT PRINT, SLAVE={slave}, MASTER={master}", "CF"]
    return [*lines, "*END STEP"]


def bore_loads(problem: Problem, path: Path) -> np.ndarray:
    """(2, 6) force (N) and moment (N·m) about its mid-width that each bore exerts on its gear."""
    sets, loads = reactions(path), []
    for gear, (node, _) in zip(problem.gears, starts(problem), strict=True):
        forces = sets[f"BORE{gear.name}"]
        arm = gear.nodes[np.array(list(forces)) - node] - [*gear.centre, 0.0]
        force = np.array(list(forces.values()))
        loads.append(np.concatenate([force.sum(axis=0), np.cross(arm, force).sum(axis=0)]))
    return np.array(loads)


def layer_forces(problem: Problem, path: Path) -> np.ndarray:
    """(pairs, layers) N: contact force of every tooth pair in every layer."""
    found: dict[tuple[str, str], float] = {}
    lines = [line for line in path.read_text(encoding="ascii").splitlines() if line.strip()]
    for line, following in zip(lines, lines[1:], strict=False):
        if head := PAIR.search(line):
            current = head[1], head[2]
        elif FORCE.search(line):
            found[current] = float(np.linalg.norm([float(value) for value in following.split()[:3]]))
    forces = [found.get(pair, 0.0) for pair in contact_pairs(problem)]
    return np.array(forces).reshape(len(problem.pairs), -1)
