"""A scene as a deck of CalculiX's direct time integration: same meshes, couplings, springs, contact points and loads.

Lengths in mm, forces in N, mass in tonnes, time in s. A rigid coupling's surface follows its master, translation node
and rotation node, by linear equations; an averaging node and the gap of every contact point are dependent unknowns of
nodes of their own. Springs sit between these nodes; a contact is a spring whose force is a table, 0 while it is open.
Small displacements: CalculiX is not asked for NLGEOM.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from evidence.reduction.in_time.scenes import Scene, Solid
from evidence.reduction.in_time.transient import Scheme
from gearfmu.fem.coupling import rigid_fields

MM = 1e3
ARM, OPENING, CLOSING = 10.0, 1e3, 5.0  # mm: length of a contact's spring, ends of its table
SPRINGS = 1_000_000  # first number of their elements
_TERMS = 4  # terms of an equation in a line


class Deck:
    """Numbers of nodes: those of the solids one after the other, then those of interfaces and contacts."""

    def __init__(self, scene: Scene, scheme: Scheme):
        self.scene, self.scheme = scene, scheme
        counts = [len(solid.elements.nodes) for solid in scene.solids.values()]
        self.first = dict(zip(scene.solids, np.cumsum([1, *counts[:-1]]).tolist(), strict=True))
        number = sum(counts) + 1
        self.interface: dict[tuple[str, str], int] = {}  # (solid, interface) → translation node; rotations: the next
        for name, solid in scene.solids.items():
            for coupling in solid.couplings:
                self.interface[name, coupling.name] = number
                number += 2
        self.contact = number  # of contact k: number + k
        self.last = number + int((scene.kinds == "contact").sum())

    def write(self, path: Path) -> None:
        """The deck."""
        lines = [
            *self._meshes(),
            *self._couplings(),
            *self._contacts(),
            *self._springs(),
            *self._contact_springs(),
            *self._step(),
        ]
        path.write_text("\n".join(lines) + "\n", encoding="ascii")

    def read(self, path: Path) -> dict[str, np.ndarray]:
        """Of a .dat file: member → (T + 1, p) displacements of the rows of its couplings in m and rad, and "contact" →
        (T + 1, c) what the gaps grew by."""
        first = min(self.interface.values())
        table = [np.zeros((self.last - first, 3))]
        for line in path.read_text(encoding="ascii").splitlines():
            if "displacements" in line:
                table.append(np.zeros_like(table[0]))
            elif len(fields := line.split()) == 4:
                table[-1][int(fields[0]) - first] = [float(value) for value in fields[1:]]
        values = np.array(table)
        found = {}
        for name, solid in self.scene.solids.items():
            nodes = [self.interface[name, coupling.name] - first for coupling in solid.couplings]
            found[name] = np.hstack([np.hstack([values[:, n] / MM, values[:, n + 1]]) for n in nodes])
        return found | {"contact": values[:, self.contact - first :, 0] / MM}

    def _meshes(self) -> Iterator[str]:
        yield "*NODE, NSET=ALL"
        for name, solid in self.scene.solids.items():
            for k, (x, y, z) in enumerate(MM * (solid.elements.nodes + solid.centre)):
                yield f"{self.first[name] + k}, {x:.14g}, {y:.14g}, {z:.14g}"
        yield "*NODE, NSET=EXTRA"
        yield from (f"{number}, 0, 0, 0" for number in range(min(self.interface.values()), self.last))
        element = 1
        for name, solid in self.scene.solids.items():
            yield f"*ELEMENT, TYPE=C3D20, ELSET=E{name}"
            for row in solid.elements.elements + self.first[name]:
                text = [str(node) for node in row]
                yield f"{element}, " + ", ".join(text[:10]) + ","
                yield ", ".join(text[10:])
                element += 1
        material = self.scene.material
        yield from ("*MATERIAL, NAME=STEEL", "*ELASTIC")
        yield f"{1e-6 * material.youngs_modulus:.12g}, {material.poisson_ratio:.12g}"
        yield from ("*DENSITY", f"{1e-12 * material.density:.12g}")
        yield from (f"*SOLID SECTION, ELSET=E{name}, MATERIAL=STEEL" for name in self.scene.solids)

    def _couplings(self) -> Iterator[str]:
        for name, solid in self.scene.solids.items():
            for coupling in solid.couplings:
                master = self.interface[name, coupling.name]
                if coupling.kind == "rigid":
                    yield from self._rigid(name, solid, coupling.nodes, master, coupling.point)
                    continue
                rows = next(i.rows for i in solid.full.interfaces if i.name == coupling.name)
                assert rows.shape[1] == 3 * len(solid.elements.nodes), "averaging beside rigid couplings"
                for k in range(6):
                    unit = 1.0 if k < 3 else 1 / MM
                    yield from _equation(
                        [(master + k // 3, k % 3 + 1, -1.0), *_terms(rows[[k]], self.first[name], unit)]
                    )

    def _rigid(self, name: str, solid: Solid, nodes: np.ndarray, master: int, point: np.ndarray) -> Iterator[str]:
        for node in nodes:
            fields = rigid_fields(MM * (solid.elements.nodes[node] - point))
            for axis in range(3):
                weights = [(master + k // 3, k % 3 + 1, fields[axis, k]) for k in np.flatnonzero(fields[axis])]
                yield from _equation([(self.first[name] + int(node), axis + 1, -1.0), *weights])

    def _contacts(self) -> Iterator[str]:
        points = self.scene.points
        if points is None:
            return
        for k in range(len(points.gap)):
            both = zip(points.rows, ("planet", "sun"), strict=True)
            terms = [term for rows, name in both for term in _terms(rows[[k]], self.first[name], 1.0)]
            yield from _equation([(self.contact + k, 1, -1.0), *terms])
        yield from ("*BOUNDARY", *(f"{node}, 2, 3" for node in range(self.contact, self.last)))

    def _springs(self) -> Iterator[str]:
        """Springs between interfaces or to the ground. CalculiX takes whole numbers for directions here: a stiffness
        has a decimal point."""
        stiffness = self.scene.assembly.joints.stiffness
        for j in np.flatnonzero(self.scene.kinds != "contact"):
            ends = self._ends(j)
            unit = MM if ends[0][2] else 1 / MM  # N·m/rad → N·mm/rad, N/m → N/mm
            yield f"*ELEMENT, TYPE=SPRING{len(ends)}, ELSET=S{j}"
            yield f"{SPRINGS + j}, " + ", ".join(str(end[0]) for end in ends)
            yield f"*SPRING, ELSET=S{j}"
            yield ", ".join(str(end[1]) for end in ends)
            yield f"{stiffness[j] * unit:.13e}"

    def _contact_springs(self) -> Iterator[str]:
        """From the node of every gap along x to one that is held. (SPRING1 with a table, which would need none, has a
        tangent in CalculiX 2.20 with which Newton's method goes round in circles.)"""
        joints, touching = self.scene.assembly.joints, np.flatnonzero(self.scene.kinds == "contact")
        if not len(touching):
            return
        yield from ("*NODE, NSET=HELD", f"{self.last}, {-ARM}, 0, 0", "*BOUNDARY", "HELD, 1, 3")
        for k, j in enumerate(touching):
            gap = MM * joints.gap[j]
            yield f"*ELEMENT, TYPE=SPRINGA, ELSET=S{j}"
            yield f"{SPRINGS + j}, {self.last}, {self.contact + k}"
            yield f"*SPRING, ELSET=S{j}, NONLINEAR"
            yield f"{-CLOSING * joints.stiffness[j] / MM:.13e}, {-gap - CLOSING:.13e}"
            yield f"0.0, {-gap:.13e}"
            yield f"0.0, {OPENING:.13e}"

    def _ends(self, joint: int) -> list[tuple[int, int, bool]]:
        """(node, direction, whether a rotation) of the interfaces that a spring joins."""
        found = []
        for (name, solid), rows in zip(self.scene.solids.items(), self.scene.assembly.joints.rows, strict=True):
            labels = [(i.name, k) for i in solid.full.interfaces for k in range(len(i.components))]
            for row in rows[[joint]].indices:
                interface, k = labels[row]
                found.append((self.interface[name, interface] + k // 3, k % 3 + 1, k >= 3))
        return found

    def _step(self) -> Iterator[str]:
        assembly, scheme = self.scene.assembly, self.scheme
        yield from self._initial()
        times = np.arange(scheme.steps + 1) * scheme.step
        yield "*AMPLITUDE, NAME=HISTORY"
        yield from (f"{t:.12g}, {assembly.history(t):.12g}" for t in times)
        yield from ("*STEP, INC=1000000", f"*DYNAMIC, DIRECT, ALPHA={scheme.alpha}", f"{scheme.step}, {scheme.end}")
        yield from ("*CONTROLS, PARAMETERS=FIELD", "1e-6, 1e-6, , , 1e-6, 1e-9, 1e-3, 1e-8")
        for (name, solid), pattern in zip(self.scene.solids.items(), assembly.patterns, strict=True):
            labels = [(i.name, k) for i in solid.full.interfaces for k in range(len(i.components))]
            for row in np.flatnonzero(pattern):
                interface, k = labels[row]
                node, unit = self.interface[name, interface] + k // 3, MM if k >= 3 else 1.0
                yield from ("*CLOAD, AMPLITUDE=HISTORY", f"{node}, {k % 3 + 1}, {unit * pattern[row]:.12g}")
        yield from ("*NODE PRINT, NSET=EXTRA", "U", "*END STEP")

    def _initial(self) -> Iterator[str]:
        """Speeds of all nodes of the solids that move, and of the masters of their rigid couplings."""
        starts = dict(zip(self.scene.solids, self.scene.assembly.start, strict=True))
        if not any(start.any() for start in starts.values()):
            return
        yield "*INITIAL CONDITIONS, TYPE=VELOCITY"
        for name, solid in self.scene.solids.items():
            start = starts[name]
            speeds = MM * rigid_fields(solid.elements.nodes) @ start
            for k, speed in enumerate(speeds):
                yield from (f"{self.first[name] + k}, {axis + 1}, {speed[axis]:.14g}" for axis in np.flatnonzero(speed))
            for coupling in solid.couplings:
                node = self.interface[name, coupling.name]
                both = np.concatenate([MM * rigid_fields(coupling.point) @ start, start[3:]])
                yield from (f"{node + k // 3}, {k % 3 + 1}, {both[k]:.14g}" for k in np.flatnonzero(both))


def _terms(row: sp.csr_array, first: int, unit: float) -> list[tuple[int, int, float]]:
    row = sp.csr_array(row)
    row.sum_duplicates()
    return [(first + c // 3, c % 3 + 1, unit * v) for c, v in zip(row.indices.tolist(), row.data, strict=True) if v]


def _equation(terms: list[tuple[int, int, float]]) -> Iterator[str]:
    """Σ value · displacement = 0; the first one is the dependent one."""
    yield from ("*EQUATION", str(len(terms)))
    text = [f"{node}, {axis}, {value:.14g}" for node, axis, value in terms]
    yield from (", ".join(text[k : k + _TERMS]) for k in range(0, len(text), _TERMS))
