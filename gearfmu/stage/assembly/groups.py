"""The ground group: everything linear that does not turn, as oscillators. Free bodies and the springs between their
interface nodes, or nodes and the ground, become one symmetric eigenproblem.

With R the rigid motions of the bodies (mass M_r), N their modes, C their residual, s the elongations of the supports
(first node less second) and K_s⁻¹ the supports' compliance,

    κ = (K_s⁻¹ + C_ss)⁻¹,  M = diag(M_r, I),  K = diag(0, ω²) + [R N]_sᵀ κ [R N]_s,  K Φ = M Φ Ω²

(docs/theory.md eq. 2d). Not among the unknowns is the common rotation of a rotor's bodies about their axis, the
spin: the oscillators are orthogonal to it in the mass metric.

Signs. Loads: F_f, outward normal force on a flank (a contact presses with λ = −F_f), T, moment on a port's node.
Displacement of a flank along its outward normal, elongation and bore angle then are

    w = e q + C_ff F_f + C_fp T − C_fs κ (C_sf F_f + C_sp T),    e = ([0 N]_f − C_fs κ S) Φ,    S = [R N]_s
    support force  B = κ (S Φ q + C_sf F_f + C_sp T)      of the first body on the second, or on the ground
    bore angle     φ + p q + C_pf F_f + C_pp T − C_ps κ (C_sf F_f + C_sp T),    p = ([R N]_p − C_ps κ S) Φ

C_fs: per unit force on the *first* body, and its reaction on the second. Elongation of a support's own spring: K_s⁻¹ B.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import scipy.linalg as sl
from scipy.sparse.csgraph import connected_components

from gearfmu.errors import ModelError
from gearfmu.stage.assembly.ground_part import GroundPart
from gearfmu.stage.assembly.teeth import products

FORCES = ("fx", "fy", "fz", "mx", "my", "mz")
MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
PLANAR, SPATIAL = (0, 1), (0, 1, 2, 3, 4)
SPIN = 5
UNCOUPLED = 1e-12  # of the diagonal: smaller terms of the stiffness are rounding
EQUAL = 1e-8  # relative difference of eigenvalues of one cluster
FLOATING = 1e-14  # of the largest eigenvalue of a block: below it a motion is free
REGULAR = 1e-12  # least eigenvalue of the supports' compliance, scaled to a unit diagonal


class RigidSupportError(ModelError):
    """Rigid supports on bodies that do not yield there: their forces are not those of any spring."""


@dataclass(frozen=True)
class Support:
    """A spring between two interface nodes (body, node), or a node and the ground (second None), in some of the six
    directions of motion.

    compliance (d, d), m/N …: zero where rigid; damping (d,), N·s/m …: across the spring alone.
    """

    name: str
    first: tuple[int, int]
    second: tuple[int, int] | None
    directions: tuple[int, ...]
    compliance: np.ndarray
    damping: np.ndarray

    def hold(self) -> Support:
        """The same support, infinitely stiff where it rests on the ground."""
        return self if self.second is not None else replace(self, compliance=np.zeros_like(self.compliance))


@dataclass(frozen=True)
class Layout:
    """Bodies, rotors (bodies that spin together, every body but a housing in one) and supports; planar: motion x and y
    alone.

    stands: rotors that do not spin; carried: rotor → the rotor in whose axes it stands, and x and y (m) of its axis
    there.
    """

    bodies: Sequence[GroundPart]
    rotors: Sequence[tuple[int, ...]]
    supports: Sequence[Support]
    planar: bool
    stands: frozenset[int] = frozenset()
    carried: Mapping[int, tuple[int, float, float]] = field(default_factory=dict)

    def freedoms(self, body: int) -> tuple[int, ...]:
        """Rigid freedoms of a body among the unknowns: its own rotation too where other bodies share its spin."""
        if self.planar:
            return PLANAR
        rotor = next((r for r, own in enumerate(self.rotors) if body in own), -1)  # -1: a housing
        own_rotation = rotor < 0 or len(self.rotors[rotor]) > 1 or rotor in self.stands or rotor in self.frames
        return (*SPATIAL, SPIN) if own_rotation else SPATIAL

    @property
    def frames(self) -> set[int]:
        """Rotors that carry others."""
        return {frame for frame, *_ in self.carried.values()}

    def frame_of(self, body: int) -> int:
        """The turning rotor in whose axes a body stands, −1: the ground."""
        return next((frame for own, frame, *_ in self.in_turning_axes if own == body), -1)

    @property
    def in_turning_axes(self) -> list[tuple[int, int, float, float]]:
        """Bodies that stand in the axes of a turning rotor: number, that rotor, x and y (m) of their axis there."""
        found = []
        for r, rotor in enumerate(self.rotors):
            frame, x, y = self.carried.get(r, (r, 0.0, 0.0))
            if r in self.carried or r in self.frames:
                found += [(body, frame, x, y) for body in rotor]
        return sorted(found)

    def inertia(self, rotor: int) -> float:
        """Moment of inertia of a rotor about its axis, kg·m², the masses that it carries included; 0 where it
        stands."""
        if rotor in self.stands:
            return 0.0
        carried = sum(
            self.bodies[b].mass[0, 0] * (x * x + y * y)
            for r, (frame, x, y) in self.carried.items()
            for b in self.rotors[r]
            if frame == rotor
        )
        return float(sum(self.bodies[b].mass[SPIN, SPIN] for b in self.rotors[rotor]) + carried)

    def mass(self, body: int, direction: int) -> float:
        """Mass, or moments of inertia of the single bodies, of the rotor that a body belongs to, kg or kg·m²; of a
        housing its own."""
        own = next((rotor for rotor in self.rotors if body in rotor), (body,))
        return float(sum(self.bodies[b].mass[direction, direction] for b in own))

    def support_names(self) -> list[str]:
        """One for every direction: bearing.pinion.fx."""
        return [f"{s.name}.{FORCES[d]}" for s in self.supports for d in s.directions]

    def displacement_names(self) -> list[str]:
        """One for every direction: pinion.gear.x where a gear is held on the ground, else bearing.left.x."""
        return [f"{self._held_point(s)}.{MOTIONS[d]}" for s in self.supports for d in s.directions]

    def _held_point(self, support: Support) -> str:
        first = self.bodies[support.first[0]]
        return f"{first.name}.gear" if first.flank is not None and support.second is None else support.name


@dataclass(frozen=True)
class Group:
    """The oscillators of a layout. omega, zeta (n,); shapes (raw, n) of the unknowns of all bodies; rigid_share (n,) of
    the kinetic energy in rigid motion; kappa (s, s) N/m …; support_rows (s, n); support_compliance (s, s) m/N …, K_s⁻¹;
    damper_rows (s, n), damper (s,); at (bodies): slice of a body's unknowns, first the rigid ones; owner (n,): family
    of bodies, those that supports and spins connect, of an oscillator."""

    layout: Layout
    omega: np.ndarray
    zeta: np.ndarray
    shapes: np.ndarray
    rigid_share: np.ndarray
    kappa: np.ndarray
    support_rows: np.ndarray
    support_compliance: np.ndarray
    damper_rows: np.ndarray
    damper: np.ndarray
    at: Sequence[slice]
    owner: np.ndarray

    def carried_rows(self) -> np.ndarray:
        """(c, 2, n): motion x and y of the centre of mass of every body of `Layout.in_turning_axes`, times the root of
        its mass."""
        rows = np.zeros((len(self.layout.in_turning_axes), 2, self.omega.size))
        for i, (body, *_) in enumerate(self.layout.in_turning_axes):
            mass = self.layout.bodies[body].mass
            rows[i] = mass[:2] @ self.rigid(body) / math.sqrt(mass[0, 0])
        return rows

    def rigid(self, body: int) -> np.ndarray:
        """(6, n): rigid motion of a body about its origin."""
        freedoms = list(self.layout.freedoms(body))
        rows = np.zeros((6, self.omega.size))
        rows[freedoms] = self.shapes[self.at[body]][: len(freedoms)]
        return rows

    def node_rows(self, body: int, node: int, direction: int) -> np.ndarray:
        """(n,): motion of a node, less the spin."""
        raw = _node_row(self.layout, body, node, direction)
        own = self.shapes[self.at[body]]
        return raw @ own - self.node_supports(body, node, direction) @ self.kappa @ self.support_rows

    def node_supports(self, body: int, node: int, direction: int) -> np.ndarray:
        """(s,): C_ps of a node."""
        residual = self.layout.bodies[body].residual[6 * node + direction]
        return node_directions(self.layout, body) @ residual


def mount(layout: Layout) -> Group:
    """The ground group of a layout. ModelError where supports that are rigid hold the same motion twice."""
    at = _places(layout)
    rows = np.zeros((len(layout.support_names()), at[-1].stop))
    residual = np.zeros((len(rows), len(rows)))
    for b, body in enumerate(layout.bodies):
        sides = node_directions(layout, b)
        nodes = np.vstack([_node_row(layout, b, k, d) for k in range(len(body.nodes)) for d in range(6)])
        rows[:, at[b]] = sides @ nodes
        residual += sides @ body.residual @ sides.T
    own = sl.block_diag(*[s.compliance for s in layout.supports])
    kappa = _invert(_clean(own + residual), layout)
    mass, omega_zeta = _mass(layout, at)
    squared, shapes, owner = _eigenproblem(layout, at, rows.T @ kappa @ rows + np.diag(omega_zeta[0] ** 2), mass)
    omega = np.sqrt(squared)
    loss = (omega_zeta[0] * omega_zeta[1]) @ shapes**2
    support_rows = products(rows, shapes.T)
    return Group(
        layout=layout,
        omega=omega,
        zeta=np.divide(loss, omega, out=np.zeros_like(omega), where=omega > 0),
        shapes=shapes,
        rigid_share=1.0 - (omega_zeta[0] > 0) @ shapes**2,
        kappa=kappa,
        support_rows=support_rows,
        support_compliance=own,
        damper_rows=products(own @ kappa, support_rows.T),
        damper=np.concatenate([s.damping for s in layout.supports]),
        at=at,
        owner=owner,
    )


def node_directions(layout: Layout, body: int) -> np.ndarray:
    """(s, 6K): elongation of every support direction per motion of the body's nodes: +1 of the first body, −1 of the
    second."""
    rows = np.zeros((len(layout.support_names()), 6 * len(layout.bodies[body].nodes)))
    start = 0
    for support in layout.supports:
        for sign, end in ((1.0, support.first), (-1.0, support.second)):
            if end is not None and end[0] == body:
                for i, direction in enumerate(support.directions):
                    rows[start + i, 6 * end[1] + direction] += sign
        start += len(support.directions)
    return rows


def families(layout: Layout) -> np.ndarray:
    """(bodies,): number of the family of each body: those that supports or a common spin connect."""
    links = [(s.first[0], s.second[0]) for s in layout.supports if s.second is not None]
    links += [(rotor[0], other) for rotor in layout.rotors for other in rotor[1:]]
    graph = np.zeros((len(layout.bodies), len(layout.bodies)))
    for i, j in links:
        graph[i, j] = 1.0
    return np.asarray(connected_components(graph, directed=False)[1])


def _places(layout: Layout) -> list[slice]:
    counts = [len(layout.freedoms(b)) + body.omega.size for b, body in enumerate(layout.bodies)]
    ends = np.cumsum(counts)
    return [slice(int(end - n), int(end)) for end, n in zip(ends, counts, strict=True)]


def _node_row(layout: Layout, body: int, node: int, direction: int) -> np.ndarray:
    """(unknowns of the body,): motion of a node, residual and spin left out."""
    free = layout.bodies[body]
    rigid = free.nodes[node].rigid_rows[direction, list(layout.freedoms(body))]
    return np.concatenate([rigid, free.rows[node, direction]])


def _mass(layout: Layout, at: Sequence[slice]) -> tuple[np.ndarray, np.ndarray]:
    """M (raw, raw), and ω and ζ (2, raw) of the unknowns, 0 for the rigid ones."""
    mass, omega_zeta = np.eye(at[-1].stop), np.zeros((2, at[-1].stop))
    for b, body in enumerate(layout.bodies):
        freedoms = list(layout.freedoms(b))
        rigid = slice(at[b].start, at[b].start + len(freedoms))
        mass[rigid, rigid] = body.mass[np.ix_(freedoms, freedoms)]
        omega_zeta[:, rigid.stop : at[b].stop] = body.omega, body.zeta
    return mass, omega_zeta


def _invert(compliance: np.ndarray, layout: Layout) -> np.ndarray:
    """κ. Scaled to a unit diagonal first: directions of force and moment differ by powers of ten."""
    scale = np.sqrt(np.diag(compliance))
    names = layout.support_names()
    if rigid := [name for name, s in zip(names, scale, strict=True) if s == 0.0]:
        raise RigidSupportError(
            f"supports {', '.join(rigid)}: rigid, on bodies that do not yield there; give them a stiffness"
        )
    scaled = compliance / np.outer(scale, scale)
    if scaled.size and np.linalg.eigvalsh(scaled)[0] < REGULAR:
        raise RigidSupportError("supports: some that are rigid hold the same motion twice; give them stiffnesses")
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    return 0.5 * (inverse + inverse.T)


def _eigenproblem(
    layout: Layout, at: Sequence[slice], stiffness: np.ndarray, mass: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ω² (n,) ascending, Φ (raw, n), family (n,). Solved block by block of what is coupled, so that nothing mixes that
    does not belong together."""
    raw_family = np.concatenate([np.full(a.stop - a.start, f) for a, f in zip(at, families(layout), strict=True)])
    basis = _without_spins(layout, at, mass)
    k, m = (_clean(basis.T @ matrix @ basis) for matrix in (stiffness, mass))
    blocks = connected_components((k != 0.0) | (m != 0.0), directed=False)[1]
    found: list[tuple[float, int, np.ndarray, int]] = []
    for block in range(blocks.max() + 1):
        own = np.flatnonzero(blocks == block)
        squared, vectors = sl.eigh(k[np.ix_(own, own)], m[np.ix_(own, own)])
        squared[squared < FLOATING * squared[-1]] = 0.0
        shapes = basis[:, own] @ _turn_clusters(squared, vectors)
        family = int(raw_family[np.abs(shapes).sum(axis=1).argmax()])
        found += [(float(value), block, shape, family) for value, shape in zip(squared, shapes.T, strict=True)]
    values = np.array([value for value, *_ in found])
    order = sorted(range(len(found)), key=lambda i: (values[i], found[i][1]))
    sorted_values = _level(values[order])
    order = [order[i] for i in sorted(range(len(order)), key=lambda i: (sorted_values[i], found[order[i]][1]))]
    shapes = np.stack([found[i][2] for i in order], axis=1)
    return sorted_values, shapes, np.array([found[i][3] for i in order])


def _without_spins(layout: Layout, at: Sequence[slice], mass: np.ndarray) -> np.ndarray:
    """(raw, n): basis of all motion that is orthogonal, in the mass metric, to the common rotation of every rotor and
    of what it carries."""
    basis = np.eye(len(mass))
    drop = []
    for r, rotor in enumerate(layout.rotors):
        if layout.planar or r in layout.stands or (len(rotor) == 1 and r not in layout.frames):
            continue
        momentum = mass @ _rotation(layout, at, r, len(mass))
        turns = np.flatnonzero(momentum)
        first = int(turns[np.argmax(momentum[turns])])
        basis[first, turns] -= momentum[turns] / momentum[first]
        drop.append(first)
    return np.delete(basis, drop, axis=1)


def _rotation(layout: Layout, at: Sequence[slice], rotor: int, size: int) -> np.ndarray:
    """(raw,): unit rotation of a rotor; the axes of what it carries move on, but do not turn."""
    vector = np.zeros(size)
    vector[[at[b].start + SPIN for b in layout.rotors[rotor]]] = 1.0
    for carried, (frame, x, y) in layout.carried.items():
        for b in layout.rotors[carried] if frame == rotor else ():
            vector[at[b].start : at[b].start + 2] = -y, x
    return vector


def _clean(matrix: np.ndarray) -> np.ndarray:
    """Symmetric, and without couplings that are rounding beside the diagonal."""
    matrix = 0.5 * (matrix + matrix.T)
    scale = np.sqrt(np.abs(np.diag(matrix)))
    return np.where(np.abs(matrix) > UNCOUPLED * np.outer(scale, scale), matrix, 0.0)


def _clusters(values: np.ndarray) -> list[slice]:
    """Runs of ascending values that are equal but for rounding."""
    ends = [i for i in range(1, len(values)) if values[i] - values[i - 1] > EQUAL * abs(values[i])]
    return [slice(a, b) for a, b in pairwise([0, *ends, len(values)])]


def _level(values: np.ndarray) -> np.ndarray:
    """Ascending values with those of a cluster made equal, so that their order does not depend on rounding."""
    return np.concatenate([np.full(values[own].size, values[own].mean()) for own in _clusters(values)])


def _turn_clusters(squared: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """The same eigenvectors (n, k), those of one value turned so that they are reproducible: each zero in the unknown
    that leads another of the cluster, and positive in its own."""
    return np.hstack([_turn_cluster(vectors[:, own]) for own in _clusters(squared)])


def _turn_cluster(vectors: np.ndarray) -> np.ndarray:
    result, left = [], vectors
    while left.shape[1]:
        size = np.linalg.norm(left, axis=1)
        lead = int(np.flatnonzero(size > 0.5 * size.max())[0])
        if left.shape[1] > 1:
            left = left @ sl.qr(left[lead][:, None])[0]
        result.append(left[:, 0] * np.sign(left[lead, 0]))
        left = left[:, 1:]
    return np.stack(result, axis=1)
