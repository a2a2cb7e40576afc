"""How a gear yields on its shaft: one finite element body of gear and shaft, beside a gear with an averaged bore and
one with a rigid bore on a Timoshenko beam.

    python -m evidence.bodies.bore_on_shaft

Gears of the helical pair z 31/73 (`coarse.py`), mesh at a third. The shaft fills the bore, is hollow (10 mm),
stands out by the face width on either side and is clamped at its ends. The load is one normal force along the pitch
line, shared by three teeth 1 : 2 : 1. Prints and writes the compliance at the load by nodal diameter, all times the
face width, mm µm/N. Column 2+ is the shape of the bore alone; the beam acts in 0 and 1.
"""

from __future__ import annotations

import csv
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from evidence.bodies.coarse import PAIR
from gearfmu.fem.coupling import rigid_modes
from gearfmu.fem.hex20 import assemble
from gearfmu.femesh import FeMesh, gear_sector
from gearfmu.files import written_whole
from gearfmu.spec.forms.members import members
from gearfmu.spec.proposals.numbers import new_from_numbers
from gearfmu.spec.stage import load_stage

SCALE = 0.35
HOLE, LAYERS, BEYOND = 10e-3, 4, 1.0  # m; elements between hole and bore; length of shaft beside the gear, face widths
SHARES = (0.25, 0.5, 0.25)
TIMOSHENKO = 0.9  # shear coefficient
Matrix = Any


@dataclass(frozen=True)
class Body:
    """A sector: mesh nodes, elements, the nodes on both cuts; bore: nodes of the gear's bore; ends: clamped nodes."""

    nodes: np.ndarray
    elements: np.ndarray
    cuts: tuple[np.ndarray, np.ndarray]
    bore: np.ndarray
    ends: np.ndarray


def gear_alone(mesh: FeMesh) -> Body:
    """The sector of the gear as the product meshes it."""
    return Body(mesh.nodes, mesh.elements, (mesh.cut_minus, mesh.cut_plus), mesh.sets["bore"], np.zeros(0, int))


def with_shaft(mesh: FeMesh, width: float) -> Body:
    """The sector with its piece of the shaft, nodes shared at the bore."""
    levels, angles, own = _bore_grid(mesh)
    step = levels[2] - levels[0]
    more = max(1, round(BEYOND * width / step))
    outer = 0.5 * width + BEYOND * width * np.arange(1, 2 * more + 1) / (2 * more)
    heights = np.concatenate([-outer[::-1], levels, outer])
    radius = float(np.hypot(*mesh.nodes[mesh.sets["bore"][0], :2]))
    radii = np.linspace(0.5 * HOLE, radius, 2 * LAYERS + 1)
    numbers = np.full((radii.size, angles.size, heights.size), -1)
    numbers[-1, :, 2 * more : 2 * more + levels.size] = own
    nodes = [mesh.nodes]
    count = len(mesh.nodes)
    for place in np.ndindex(numbers.shape):
        if numbers[place] < 0 and sum(k % 2 for k in place) <= 1:
            i, j, k = place
            angle = angles[j] + mesh.twist * heights[k]
            nodes.append(np.array([[radii[i] * math.cos(angle), radii[i] * math.sin(angle), heights[k]]]))
            numbers[place] = count
            count += 1
    cells = np.array(list(_cells(numbers)))
    first, last = (numbers[:, j][numbers[:, j] >= len(mesh.nodes)] for j in (0, -1))
    cuts = np.concatenate([mesh.cut_minus, first]), np.concatenate([mesh.cut_plus, last])
    ends = np.concatenate([numbers[..., k][numbers[..., k] >= 0] for k in (0, -1)])
    return Body(np.concatenate(nodes), np.concatenate([mesh.elements, cells]), cuts, mesh.sets["bore"], ends)


def _bore_grid(mesh: FeMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights, angles at mid-width, and node numbers (angles, heights) of the bore, −1 where there is none."""
    bore = mesh.sets["bore"]
    x, y, z = mesh.nodes[bore].T
    height = np.round(z, 9)
    angle = np.round(np.angle(np.exp(1j * (np.arctan2(y, x) - mesh.twist * z))), 7)
    heights, k = np.unique(height, return_inverse=True)
    angles, j = np.unique(angle, return_inverse=True)
    numbers = np.full((angles.size, heights.size), -1)
    numbers[j, k] = bore
    return heights, angles, numbers


def _cells(n: np.ndarray) -> Iterator[list[int]]:
    for i in range(0, n.shape[0] - 2, 2):
        for j in range(0, n.shape[1] - 2, 2):
            for k in range(0, n.shape[2] - 2, 2):
                around = [(i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)]
                middle = [(i + 1, j), (i + 2, j + 1), (i + 1, j + 2), (i, j + 1)]
                yield [
                    *(n[p][k] for p in around), *(n[p][k + 2] for p in around), *(n[p][k] for p in middle),
                    *(n[p][k + 2] for p in middle), *(n[p][k + 1] for p in around),
                ]  # fmt: skip


def beam(material: Any, width: float, outer: float) -> dict[str, float]:
    """Stiffness at the middle of the shaft with clamped ends: axial, torsion, lateral, tilt."""
    a = (0.5 + BEYOND) * width
    area, inertia = math.pi * (outer**2 - HOLE**2) / 4, math.pi * (outer**4 - HOLE**4) / 64
    e, g = material.youngs_modulus, material.youngs_modulus / 2 / (1 + material.poisson_ratio)
    phi = 12 * e * inertia / (TIMOSHENKO * g * area * a**2)
    lateral, tilt = 12 * e * inertia / a**3 / (1 + phi), (4 + phi) * e * inertia / a / (1 + phi)
    return {"axial": 2 * e * area / a, "torsion": 4 * g * inertia / a, "lateral": 2 * lateral, "tilt": 2 * tilt}


def pitch_line_load(mesh: FeMesh, geometry: Any) -> np.ndarray:
    """(3N,) unit normal force, even along the flank nodes nearest to the pitch circle."""
    flank = mesh.flank[0]
    roll = geometry.r_b * math.tan(geometry.alpha_t)
    nodes, where = np.unique(flank.quads, return_index=True)
    off = np.abs(flank.roll.ravel()[where] - roll)
    nodes = nodes[off < off.min() + 1e-9]
    force = np.zeros((len(mesh.nodes), 3))
    for node in nodes:
        x, y, z = mesh.nodes[node]
        spot = math.atan2(y, x)
        side = 1.0 if math.remainder(spot - mesh.twist * z, 2 * math.pi) > 0 else -1.0
        normal = spot - side * (0.5 * math.pi + geometry.alpha_t)
        beta_b = math.atan(mesh.twist * geometry.r_b)
        direction = np.array([math.cos(normal), math.sin(normal), 0.0]) * math.cos(beta_b)
        direction[2] = side * math.sin(beta_b)
        force[node] = direction / len(nodes)
    return force.ravel()


@dataclass(frozen=True)
class Case:
    """A body with how its bore is held: "one body", "averaged", "rigid"; shaft: stiffness of the beam."""

    body: Body
    stiffness: sp.csr_array
    held: str
    shaft: dict[str, float]
    teeth: int

    def compliance(self, load: np.ndarray, n: int) -> float:
        """Displacement at the load of nodal diameter n per unit amplitude on every tooth, m/N."""
        turn = 2 * math.pi / self.teeth
        to, place = self._free(n, turn)
        k = (to.conj().T @ self.stiffness @ to).tocsc()
        phi = _rigid_fields(self.body.nodes, n)
        if self.held == "averaged" and phi.shape[1]:
            dofs = _dofs(self.body.bore)
            fit = sp.csr_array((len(phi), phi.shape[1]), dtype=complex).tolil()
            fit[dofs] = phi[dofs] @ np.linalg.inv(phi[dofs].conj().T @ phi[dofs])
            rows = fit.tocsr().conj().T @ to
            k = k + rows.conj().T @ sp.diags_array(self._springs(n) / self.teeth) @ rows
        if self.held == "rigid" and phi.shape[1]:
            k = k + sp.diags_array(place)
        force = to.conj().T @ np.concatenate([load, np.zeros(to.shape[0] - load.size)])
        return float(np.real(np.vdot(force, splu(sp.csc_matrix(k)).solve(force))))

    def _springs(self, n: int) -> np.ndarray:
        s = self.shaft
        return np.array([s["axial"], s["torsion"]] if n == 0 else [s["lateral"], s["tilt"]])

    def _free(self, n: int, turn: float) -> tuple[sp.csr_array, np.ndarray]:
        """Full displacements from free unknowns; stiffness of the shaft on those unknowns that are rigid motions."""
        size = len(self.body.nodes)
        minus, plus = self.body.cuts
        plus = plus[_partners(self.body.nodes, minus, plus, turn)]
        c, s = math.cos(turn), math.sin(turn)
        rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) * np.exp(1j * n * turn)
        away = np.zeros(size, bool)
        away[plus] = True
        rigid = self.held == "rigid"
        away[self.body.bore if rigid else self.body.ends] = True
        kept = np.flatnonzero(~away)
        column = np.full(size, -1)
        column[kept] = np.arange(kept.size)
        rows = [_dofs(kept)]
        cols = [_dofs(column[kept])]
        data = [np.ones(3 * kept.size, complex)]
        tied = column[minus] >= 0
        for a in range(3):
            for b in range(3):
                rows.append(3 * plus[tied] + a)
                cols.append(3 * column[minus[tied]] + b)
                data.append(np.full(int(tied.sum()), rotation[a, b]))
        shape = (3 * size, 3 * kept.size)
        to = sp.coo_array((np.concatenate(data), (np.concatenate(rows), np.concatenate(cols))), shape=shape).tocsr()
        place = np.zeros(3 * kept.size)
        if rigid and n < 2:
            phi = np.zeros((3 * size, 2), complex)
            dofs = _dofs(self.body.bore)
            phi[dofs] = _rigid_fields(self.body.nodes, n)[dofs]
            to = sp.hstack([to, sp.csr_array(phi)]).tocsr()
            place = np.concatenate([place, self._springs(n) / self.teeth])
        return to, place


def _dofs(nodes: np.ndarray) -> np.ndarray:
    return (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()


def _partners(nodes: np.ndarray, minus: np.ndarray, plus: np.ndarray, turn: float) -> np.ndarray:
    """Which of `plus` each of `minus` comes to when it is turned on by one pitch."""
    c, s = math.cos(turn), math.sin(turn)
    x, y, z = nodes[minus].T
    moved = np.column_stack([c * x - s * y, s * x + c * y, z])
    far = np.linalg.norm(moved[:, None] - nodes[plus][None], axis=2)
    assert far.min(axis=1).max() < 1e-8, "cuts do not match"
    return far.argmin(axis=1)


def _rigid_fields(nodes: np.ndarray, n: int) -> np.ndarray:
    """Rigid motions of nodal diameter n: (3N, 2) or none; axial and turn, or lateral and tilt."""
    if n > 1:
        return np.zeros((3 * len(nodes), 0), complex)
    modes = rigid_modes(nodes)
    if n == 0:
        return modes[:, [2, 5]].astype(complex)
    way = np.array([1.0, 1j]) / math.sqrt(2)  # turned by the pitch it gains exp(−i pitch)
    return np.column_stack([modes[:, [0, 1]] @ way, modes[:, [3, 4]] @ way])


def compliances(case: Case, load: np.ndarray) -> dict[str, float]:
    """By nodal diameter 0, 1 and all others, m/N."""
    z = case.teeth
    found = {"0": 0.0, "1": 0.0, "2+": 0.0}
    for n in range(z // 2 + 1):
        twice = 1 if n == 0 or 2 * n == z else 2
        share = abs(sum(w * np.exp(2j * math.pi * n * k / z) for k, w in zip((-1, 0, 1), SHARES, strict=True))) ** 2
        found[str(n) if n < 2 else "2+"] += twice * share * case.compliance(load, n) / z
    return found


def rows() -> Iterator[dict[str, Any]]:
    """Both gears, three ways each."""
    with tempfile.TemporaryDirectory() as home:
        spec = load_stage(str(new_from_numbers("pair_31_73", PAIR, home)))
    for member in members(spec).values():
        gear, geometry = member.gear, member.geometry
        mesh = gear_sector(geometry, gear.face_width, gear.body.mesh.model_copy(update={"scale": SCALE}))
        load = pitch_line_load(mesh, geometry)
        shaft = beam(gear.material, gear.face_width, gear.bore_diameter)
        for held in ("one body", "averaged", "rigid"):
            body = with_shaft(mesh, gear.face_width) if held == "one body" else gear_alone(mesh)
            stiffness, _ = assemble(body.nodes, body.elements, gear.material)
            found = compliances(Case(body, stiffness, held, shaft, gear.teeth), load)
            scaled = {name: float(1e9 * gear.face_width * c) for name, c in found.items()}
            yield (
                {"gear": gear.name, "bore": held}
                | {k: round(v, 5) for k, v in scaled.items()}
                | {"all": round(sum(scaled.values()), 5)}
            )


def main() -> None:
    """Print and write evidence/bodies/bore_on_shaft.csv."""
    table = []
    for row in rows():
        print(row, flush=True)
        table.append(row)
    with written_whole(Path(__file__).with_suffix(".csv")) as path, path.open("w", newline="", encoding="utf-8") as out:
        writer = csv.DictWriter(out, list(table[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)


if __name__ == "__main__":
    main()
