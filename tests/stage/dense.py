"""Ground groups put together another way: free bodies, and supports as unknown forces, in one saddle-point system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl

from gearfmu.body import Body
from gearfmu.geometry import GearGeometry
from gearfmu.stage.assembly.ground_part import GroundPart, read_tables
from gearfmu.stage.assembly.groups import SPIN, Group, Layout, node_directions
from gearfmu.stage.assembly.teeth import OFFSETS, products, resampling


def flank_rows(group: Group, body: int) -> np.ndarray:
    """(3, 2, P, A, n): e, as c₀, c_c, c_s."""
    flank, freedoms = group.layout.bodies[body].flank, group.layout.freedoms(body)
    elastic = group.shapes[group.at[body]][len(freedoms) :]
    by_supports = products(flank_supports(group, body) @ group.kappa, group.support_rows.T)
    return products(flank.patterns, elastic.T) - by_supports


def flank_supports(group: Group, body: int) -> np.ndarray:
    """(3, 2, P, A, s): C_fs."""
    return products(group.layout.bodies[body].flank.node, node_directions(group.layout, body))


Place = tuple[int, int, int]  # body, node, direction
FlankLoad = tuple[int, int, int, int]  # tooth, flank, roll, width function


@dataclass(frozen=True)
class Loads:
    """n unit loads. rows: on rigid motions (n, 6B) of free bodies, or on a group's oscillators (n, m); supports (n, s):
    what elongates the supports, own (n, n): what moves the places of the loads, beside those motions."""

    rows: np.ndarray
    supports: np.ndarray
    own: np.ndarray


def compliance(body: GroundPart, omega: float) -> np.ndarray:
    """(6K, 6K) of the nodes of a free body at a frequency (rad/s), without its rigid motion."""
    rows = body.rows.reshape(6 * len(body.nodes), body.omega.size)
    return body.residual + rows / (body.omega**2 - omega**2) @ rows.T


def node_rows(body: GroundPart) -> np.ndarray:
    """(6K, 6): rigid motion of all nodes."""
    return np.vstack([node.rigid_rows for node in body.nodes])


# ---- by free bodies --------------------------------------------------------------------------------------------------
def at_nodes(layout: Layout, places: Sequence[Place], omega: float) -> Loads:
    rows, supports, own = [], [], np.zeros((len(places), len(places)))
    for i, (b, node, direction) in enumerate(places):
        yields = compliance(layout.bodies[b], omega)[6 * node + direction]
        rows.append(np.zeros(6 * len(layout.bodies)))
        rows[-1][6 * b : 6 * b + 6] = node_rows(layout.bodies[b])[6 * node + direction]
        supports.append(node_directions(layout, b) @ yields)
        own[i] = [yields[6 * n + d] if other == b else 0.0 for other, n, d in places]
    return Loads(np.array(rows), np.array(supports), own)


@dataclass(frozen=True)
class OnGear:
    """Loads on flanks of an elastic gear, number `b` of a layout, that has turned by `angle` (rad), then a moment on
    its bore; degrees, rolls: of its width functions, of the even grid along its flanks."""

    b: int
    body: Body
    shape: GearGeometry
    loads: Sequence[FlankLoad]
    angle: float
    degrees: np.ndarray
    rolls: int

    def tooth(self, load: FlankLoad) -> float:
        return self.angle + load[0] * 2 * np.pi / self.shape.z

    def rigid(self) -> np.ndarray:
        """(n + 1, 6): normals from the involute (docs/theory.md eq. 4), moments about the origin."""
        found = []
        for load in self.loads:
            _, flank, roll, function = load
            sign, degree = (1, -1)[flank], self.degrees[function]
            s = np.linspace(self.shape.s_form, self.shape.s_tip, self.rolls)[roll]
            t = self.tooth(load) + sign * (self.shape.psi_b - s / self.shape.r_b)
            n = sign * np.array([-np.sin(t), np.cos(t), 0.0])
            along = self.body.flank.face_width / 6 * (degree == 1)
            about = np.array([-n[1], n[0], 0.0]) * along + np.array([0, 0, sign * self.shape.r_b]) * (degree == 0)
            found.append(np.concatenate([n * (degree == 0), about]))
        return np.array([*found, np.eye(6)[SPIN]])

    def free(self, layout: Layout) -> Loads:
        """By the body's own tables, turned."""
        flank, n = self.body.flank, len(self.loads)
        grid = resampling(flank.roll, self.shape.s_form, self.shape.s_tip, self.rolls)
        own, nodes = np.zeros((n + 1, n + 1)), np.zeros((n + 1, 6))
        for i, load in enumerate(self.loads):
            j, f, p, a = load
            nodes[i] = _turn6(self.tooth(load)) @ (grid[p] @ flank.node[f, :, self.degrees[a]])
            for k, (m, g, q, b) in enumerate(self.loads):
                between = flank.static[f, g, (m - j) % flank.static.shape[2], :, :, self.degrees[a], self.degrees[b]]
                own[i, k] = grid[p] @ between @ grid[q]
        nodes[n] = self.body.static[SPIN]
        own[:, n] = own[n, :] = nodes[:, SPIN]
        rows = np.zeros((n + 1, 6 * len(layout.bodies)))
        rows[:, 6 * self.b : 6 * self.b + 6] = self.rigid()
        return Loads(rows, nodes @ node_directions(layout, self.b).T, own)

    def read(self, group: Group) -> Loads:
        """By the tables of the group."""
        rows, supports, flank = flank_rows(group, self.b), flank_supports(group, self.b), _flank(group, self.b)
        n, w, c_fs = len(self.loads), [], []
        own = np.zeros((n + 1, n + 1))
        for i, load in enumerate(self.loads):
            j, f, p, a = load
            w.append(read_tables(rows[:, f, p, a], self.tooth(load)))
            c_fs.append(read_tables(supports[:, f, p, a], self.tooth(load)))
            own[i, :n] = [flank.residual[f, g, OFFSETS.index(m - j), p, q, a, b] for m, g, q, b in self.loads]
            own[i, n] = own[n, i] = flank.node[0, f, p, a, SPIN]
        own[n, n] = group.layout.bodies[self.b].residual[SPIN, SPIN]
        moved = np.vstack([self.rigid()[:n] @ group.rigid(self.b) + np.array(w), group.node_rows(self.b, 0, SPIN)])
        return Loads(moved, np.vstack([*c_fs, group.node_supports(self.b, 0, SPIN)]), own)


def _turn6(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.kron(np.eye(2), np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def _flank(group: Group, b: int):
    return group.layout.bodies[b].flank


def answer(layout: Layout, loads: Loads, omega: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (n, n) at all loads by each at a frequency (rad/s), undamped, and forces on the supports (s, n);
    every rotor's spin is held in the mass metric."""
    bodies, directions = layout.bodies, (0, 1) if layout.planar else range(6)
    moves = [6 * b + d for b in range(len(bodies)) for d in directions]
    elongate = np.hstack([node_directions(layout, b) @ node_rows(body) for b, body in enumerate(bodies)])[:, moves]
    yields = sl.block_diag(*[s.compliance for s in layout.supports])
    for b, body in enumerate(bodies):
        yields = yields + node_directions(layout, b) @ compliance(body, omega) @ node_directions(layout, b).T
    mass = sl.block_diag(*[body.mass for body in bodies])
    held = [mass[[6 * b + SPIN for b in rotor]].sum(axis=0) for rotor in layout.rotors] if not layout.planar else []
    spins = np.reshape(held, (len(held), len(mass)))[:, moves]
    s, r = len(yields), len(spins)
    dynamic = -(omega**2) * mass[np.ix_(moves, moves)]
    system = np.block(
        [
            [dynamic, elongate.T, spins.T],
            [elongate, -yields, np.zeros((s, r))],
            [spins, np.zeros((r, s)), np.zeros((r, r))],
        ]
    )
    rigid = loads.rows[:, moves]
    right = np.vstack([rigid.T, -loads.supports.T, np.zeros((r, len(rigid)))])
    scale = 1 / np.sqrt(np.abs(system).max(axis=1))
    found = scale[:, None] * np.linalg.solve(scale[:, None] * system * scale, scale[:, None] * right)
    x, force = found[: len(moves)], found[len(moves) : len(moves) + s]
    return rigid @ x + loads.own - loads.supports @ force, force


# ---- by a group ------------------------------------------------------------------------------------------------------
def read_nodes(group: Group, places: Sequence[Place]) -> Loads:
    bodies = group.layout.bodies
    own = [[bodies[b].residual[6 * n + d, 6 * m + e] if b == o else 0.0 for o, m, e in places] for b, n, d in places]
    rows, supports = ([read(*place) for place in places] for read in (group.node_rows, group.node_supports))
    return Loads(np.array(rows), np.array(supports), np.array(own))


def group_answer(group: Group, loads: Loads, omega: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The same as `answer` from the oscillators."""
    q = loads.rows.T / (group.omega**2 - omega**2)[:, None]
    force = group.kappa @ (group.support_rows @ q + loads.supports.T)
    return loads.own - loads.supports @ group.kappa @ loads.supports.T + loads.rows @ q, force


def relative(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference, every entry in units of the answers at its two loads: flanks and bore angle differ by powers
    of ten."""
    scale = np.sqrt(np.abs(np.diag(wanted)))
    return float(np.abs((found - wanted) / np.outer(scale, scale)).max())
