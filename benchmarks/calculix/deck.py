"""CalculiX decks of two gears in static contact, and their results. Lengths in mm, forces in N, stresses in MPa.

Small displacements, linear material, contact of surfaces by penalty pressure (no friction). The wheel's bore is held;
the pinion's is turned about its axis by given angles, one *STEP each; torques are read from the bores' reactions.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from section import Plane

FACE_OF_EDGE = np.array([3, 4, 5, 6])  # CalculiX's face number over edge k of the section's quadrilateral


@dataclass(frozen=True)
class Solid:
    """An extruded section, 20-node hexahedra in VTK (= Abaqus) order. nodes (N, 3) m, in its body frame. bore: nodes
    of the bore, weights: their share of its area. low, high: nodes of the two end faces. flank, patch: per fine
    tooth (F, 2) element and face number of its sg = +1 surface and of the fine zone of it."""

    nodes: np.ndarray
    elements: np.ndarray
    bore: np.ndarray
    weights: np.ndarray
    low: np.ndarray
    high: np.ndarray
    flank: dict[int, np.ndarray]
    patch: dict[int, np.ndarray]


def extruded(plane: Plane, levels: np.ndarray) -> Solid:
    """The solid over the section between the corner levels z (L + 1,) m."""
    z = np.interp(np.arange(2 * len(levels) - 1) / 2, np.arange(len(levels)), levels)
    exists = np.zeros((len(z), len(plane.nodes)), dtype=bool)
    exists[::2] = True
    exists[:, np.unique(plane.quads[:, :4])] = True
    number = np.where(exists, np.cumsum(exists.ravel()).reshape(exists.shape) - 1, -1)
    level, node = np.nonzero(exists)
    corner, middle = plane.quads[:, :4], plane.quads[:, 4:]
    elements = [
        np.hstack([number[k][corner], number[k + 2][corner], number[k][middle], number[k + 2][middle],
                   number[k + 1][corner]])
        for k in range(0, len(z) - 2, 2)
    ]  # fmt: skip
    bore, weights = _bore(plane, number, z)
    return Solid(
        nodes=np.column_stack([plane.nodes[node], z[level]]),
        elements=np.concatenate(elements),
        bore=bore,
        weights=weights,
        low=number[0][number[0] >= 0],
        high=number[-1][number[-1] >= 0],
        flank={tooth: _faces(plane, edges, len(levels) - 1) for tooth, edges in plane.flank.items()},
        patch={tooth: _faces(plane, edges, len(levels) - 1) for tooth, edges in plane.patch.items()},
    )


def _bore(plane: Plane, number: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bore nodes and ∫N dA/A of eight-node faces: −1/12 of a face at its corners, 1/3 at its mid nodes."""
    weight = np.zeros(number.max() + 1)
    start, end, middle = plane.bore.T
    span = np.linalg.norm(plane.nodes[end] - plane.nodes[start], axis=1)
    for k in range(0, len(z) - 2, 2):
        area = span * (z[k + 2] - z[k])
        for level in (k, k + 2):
            np.add.at(weight, number[level][start], -area / 12)
            np.add.at(weight, number[level][end], -area / 12)
            np.add.at(weight, number[level][middle], area / 3)
        np.add.at(weight, number[k + 1][start], area / 3)
        np.add.at(weight, number[k + 1][end], area / 3)
    bore = np.flatnonzero(weight)
    return bore, weight[bore] / weight.sum()


def _faces(plane: Plane, edges: np.ndarray, layers: int) -> np.ndarray:
    """Element and face numbers over section edges, all layers."""
    wanted = {tuple(sorted(pair)) for pair in edges[:, :2].tolist()}
    found = [
        (element, FACE_OF_EDGE[k])
        for element, quad in enumerate(plane.quads.tolist())
        for k in range(4)
        if tuple(sorted((quad[k], quad[(k + 1) % 4]))) in wanted
    ]
    assert len(found) == len(edges)
    return np.concatenate([np.array(found) + [layer * len(plane.quads), 0] for layer in range(layers)])


@dataclass(frozen=True)
class Placed:
    """A gear where it stands. centre (2,) m, angle (rad) of its frame, held: "clamped" (every bore node) or "averaged"
    (mean displacement and rotation of the bore surface); angles: turns (rad) about its axis, one a step."""

    name: str
    solid: Solid
    centre: np.ndarray
    angle: float
    held: str
    angles: Sequence[float]

    @property
    def nodes(self) -> np.ndarray:
        """(N, 3) m in the common frame."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        turned = self.solid.nodes @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        return turned + [*self.centre, 0.0]


@dataclass(frozen=True)
class Problem:
    """gears: pinion, wheel. pairs: their teeth that may touch. sides: which end faces are held along z: "low" (half
    the width, plane of symmetry) or "both" (plane strain). youngs, poisson: Pa, –. penalty: Pa/m."""

    gears: tuple[Placed, Placed]
    pairs: Sequence[tuple[int, int]]
    sides: str = "low"
    youngs: float = 206e9
    poisson: float = 0.3
    penalty: float = 1e17
    element: str = "C3D20R"


def write_deck(problem: Problem, path: Path) -> None:
    """The deck of a problem; one node numbering, the wheel's nodes after the pinion's, dummy nodes of averaging last.

    The pinion's fine zone is the slave surface, the wheel's whole flank the master."""
    lines = ["*NODE, NSET=ALL"]
    for gear, (node, _) in zip(problem.gears, _starts(problem), strict=True):
        lines += [f"{node + k}, {x:.12g}, {y:.12g}, {z:.12g}" for k, (x, y, z) in enumerate(1e3 * gear.nodes)]
    for gear, (node, element), zone in zip(problem.gears, _starts(problem), ("patch", "flank"), strict=True):
        lines += [f"*ELEMENT, TYPE={problem.element}, ELSET=E{gear.name}"]
        for k, row in enumerate(gear.solid.elements + node):
            text = [str(n) for n in row]
            lines += [f"{element + k}, " + ", ".join(text[:10]) + ",", ", ".join(text[10:])]
        lines += _set(f"BORE{gear.name}", gear.solid.bore + node)
        for side in ("low", "high"):
            lines += _set(f"{side.upper()}{gear.name}", getattr(gear.solid, side) + node)
        for tooth, faces in getattr(gear.solid, zone).items():
            lines += [f"*SURFACE, NAME={_tooth(gear, tooth)}, TYPE=ELEMENT"]
            lines += [f"{element + e}, S{f}" for e, f in faces]
    lines += _physics(problem)
    for step in range(len(problem.gears[0].angles)):
        lines += _step(problem, step)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _starts(problem: Problem) -> list[tuple[int, int]]:
    """First node and element number of either gear."""
    first = problem.gears[0].solid
    return [(1, 1), (len(first.nodes) + 1, len(first.elements) + 1)]


def _dummies(problem: Problem) -> list[int]:
    """Number of either gear's node whose displacements are the bore's mean x, mean y and rotation × 1 mm."""
    last = sum(len(gear.solid.nodes) for gear in problem.gears)
    return [last + 1, last + 2]


def _tooth(gear: Placed, tooth: int) -> str:
    return f"T{gear.name}{tooth}".replace("-", "M")


def _set(name: str, nodes: np.ndarray) -> list[str]:
    return [f"*NSET, NSET={name}"] + [", ".join(map(str, nodes[k : k + 12])) + "," for k in range(0, len(nodes), 12)]


def _physics(problem: Problem) -> list[str]:
    lines = ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{1e-6 * problem.youngs:.9g}, {problem.poisson:.9g}"]
    for gear, dummy, (node, _) in zip(problem.gears, _dummies(problem), _starts(problem), strict=True):
        lines += [f"*SOLID SECTION, ELSET=E{gear.name}, MATERIAL=STEEL"]
        lines += ["*BOUNDARY", f"LOW{gear.name}, 3, 3"]
        lines += [f"HIGH{gear.name}, 3, 3"] if problem.sides == "both" else []
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
    rows = np.array([np.ravel([w, zero], "F"), np.ravel([zero, w], "F"), np.ravel([-w * r[:, 1], w * r[:, 0]], "F") / polar])
    here = int(np.argmax(w))
    there = int(np.argmax(w * np.linalg.norm(r - r[here], axis=1)))
    other = 2 * there + int(np.argmax(np.abs([r[there, 1] - r[here, 1], r[there, 0] - r[here, 0]])))
    pivots = [2 * here, 2 * here + 1, other]
    inverse = np.linalg.inv(rows[:, pivots])
    rows, means = inverse @ rows, inverse
    lines = []
    for equation, (row, mean) in enumerate(zip(rows, means, strict=True)):
        columns = [pivots[equation]] + [c for c in np.flatnonzero(row) if c not in pivots]
        terms = [(start + gear.solid.bore[c // 2], c % 2 + 1, row[c]) for c in columns]
        terms += [(dummy, k + 1, -mean[k]) for k in range(3) if mean[k] != 0]
        lines += ["*EQUATION", str(len(terms))]
        text = [f"{node}, {axis}, {value:.14g}" for node, axis, value in terms]
        lines += [", ".join(text[k : k + 4]) for k in range(0, len(text), 4)]
    return lines


def _step(problem: Problem, step: int) -> list[str]:
    lines = ["*STEP, INC=100", "*STATIC, DIRECT", "1., 1.", "*BOUNDARY, OP=MOD"]
    for gear, dummy, (node, _) in zip(problem.gears, _dummies(problem), _starts(problem), strict=True):
        angle = gear.angles[step]
        if gear.held == "averaged":
            lines += [f"{dummy}, 1, 2, 0", f"{dummy}, 3, 3, {angle:.12g}"]
            continue
        arm = 1e3 * (gear.nodes[gear.solid.bore, :2] - gear.centre)
        for number, (x, y) in zip(node + gear.solid.bore, arm, strict=True):
            lines += [f"{number}, 1, 1, {-angle * y:.12g}", f"{number}, 2, 2, {angle * x:.12g}"]
        if problem.sides == "low" and gear.held == "clamped" and step == 0:
            lines += [f"BORE{gear.name}, 3, 3"]
    for gear in problem.gears:
        lines += [f"*NODE PRINT, NSET=BORE{gear.name}", "RF"]
    for one, other in problem.pairs:
        first, second = problem.gears
        lines += [f"*CONTACT PRINT, SLAVE={_tooth(first, one)}, MASTER={_tooth(second, other)}", "CDIS, CSTR"]
    return [*lines, "*END STEP"]


def require_ccx() -> None:
    """SystemExit with the remedy where CalculiX is not installed."""
    if shutil.which("ccx") is None:
        raise SystemExit("needs CalculiX's solver ccx: apt-get install calculix-ccx")


def run_deck(path: Path, threads: int = 1) -> float:
    """Run ccx on a deck, its log beside it; wall time (s). RuntimeError with the end of the log when it fails."""
    start = time.perf_counter()
    with open(path.with_suffix(".log"), "w", encoding="utf-8") as log:
        environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
        code = subprocess.run(["ccx", path.stem], cwd=path.parent, stdout=log, env=environment, check=False).returncode
    text = path.with_suffix(".log").read_text(encoding="utf-8")
    if code != 0 or "Job finished" not in text:
        raise RuntimeError(f"ccx gave up on {path}:\n{text[-1500:]}")
    return time.perf_counter() - start


def reactions(path: Path) -> list[dict[str, dict[int, np.ndarray]]]:
    """Of every step of a .dat file: per printed set the force (3,) N on each of its nodes."""
    steps: dict[float, dict[str, dict[int, np.ndarray]]] = {}
    current: dict[int, np.ndarray] | None = None
    for line in path.read_text(encoding="ascii").splitlines():
        if head := re.match(r" forces \(fx,fy,fz\) for set (\S+) and time +(\S+)", line):
            current = steps.setdefault(float(head[2]), {}).setdefault(head[1], {})
        elif line.strip() and not line.startswith("  ") and not re.match(r" +\d", line):
            current = None
        elif current is not None and len(fields := line.split()) == 4:
            current[int(fields[0])] = np.array([float(f) for f in fields[1:]])
    return [steps[moment] for moment in sorted(steps)]


def torques(problem: Problem, path: Path) -> np.ndarray:
    """(steps, 2) torque (N·m) about its axis that each bore exerts on its gear."""
    result = []
    for step in reactions(path):
        row = []
        for gear, (node, _) in zip(problem.gears, _starts(problem), strict=True):
            forces = step[f"BORE{gear.name}"]
            arm = gear.nodes[np.array(list(forces)) - node, :2] - gear.centre
            force = np.array(list(forces.values()))
            row.append(float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum()))
        result.append(row)
    return np.array(result)
