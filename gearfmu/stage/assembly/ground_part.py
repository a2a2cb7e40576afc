"""Bodies as the ground group takes them: rigid motion, patterns of nodal diameter 0 and 1 in axes that do not turn,
nodes. A gear's flanks read all that by rows, and gyroscopic forces act on it.

In axes that do not turn the pair (first, second) of nodal diameter 1 is a vector P in the plane, and so are forces x, y
and moments x, y at a node on the axis. With a, b the rows of the pair on tooth 0, a tooth at the angle ψ reads
(docs/theory.md eq. 3, θ = ψ)

    w = (a cos ψ − b sin ψ) P₁ + (a sin ψ + b cos ψ) P₂

so every row at a flank is c₀ + c_c cos ψ + c_s sin ψ, stored as three tables; a single pattern (ν = 0) or direction (z,
rz) has c₀ alone. Rows at a node on the axis are constant.

Gyroscopic forces act on bodies that tilt and deform while their rotors turn (docs/theory.md 3.11). In axes that do not
turn the velocity of a body's unknowns p (rigid motion x, y, z, rx, ry, rz, then its patterns of ν ≤ 1) enters the
kinetic energy as ½ ṗᵀMṗ + ṗᵀ(Ω H + Ω_f Q) p, H and Q skew. Ω is the speed of its rotor, Ω_f that of the axes in which
it stands (a carrier's):

    H = G − M J,   Q = M J;     M p̈ + 2 (Ω H + Ω_f Q) ṗ + … = f

G: Coriolis coupling in the body's own axes, J: the quarter turn of every pair that turns as a vector. For rigid tilt H
is −½ J_p J, the gyroscopic moment; for translation it vanishes. Q of translation are the Coriolis forces on carried
masses (`Group.carried_rows`) and is not repeated here."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as sl

from gearfmu.body.body import Body, Flank, Node
from gearfmu.errors import ModelError
from gearfmu.stage.assembly.levels import lowest_levels
from gearfmu.stage.assembly.teeth import OFFSETS, blend, products
from gearfmu.stagefile.tables.connections import LevelSpec

if TYPE_CHECKING:
    from gearfmu.stage.assembly.groups import Group, Layout

NODE_MEMBERS = np.array([1, 2, 0, 1, 2, 0])  # x, y and rx, ry are pairs, z and rz single
NOISE = 1e-7  # of the static compliance of a carrier: smaller residuals are rounding of its Krylov vectors
SILENT = 1e-6  # bore rows of patterns of nodal diameter 2 and more, relative: must vanish
RX, RY, RZ, RIGID = 3, 4, 5, 6
HIGHEST = 2 * math.pi * 100e3  # rad/s: patterns above it feel 2Ω/ω < 2e-3 at 600 rad/s, and are left out
IDLE = 1e-9  # of a body's largest gyroscopic pair: smaller ones are rounding


@dataclass(frozen=True)
class Along:
    """What flanks read along the profile, towards growing roll, as `PartFlank` along the normal: turning, patterns, and
    compliances of one tooth beyond the ground modes: normal (2, 2, P, P, A, A), m/N, along the normal, own, along
    the profile, per force along the profile. What a force there does to the bore beyond the modes is not known."""

    turning: np.ndarray
    patterns: np.ndarray
    normal: np.ndarray
    own: np.ndarray


@dataclass(frozen=True)
class PartFlank:
    """What the flanks of a gear read at P lengths of roll, for A width functions.

    turning (2, P, A, m), kg^-½: rows on tooth 0 of the modes that turn with the gear (ν ≥ 2), chosen (m,) their
    numbers in the body, level (m,), ascending, the lowest level at which each is dynamic; low (n,) the numbers of the
    ground modes (ν ≤ 1), low_member (n,): 0 single, 1 and 2 of a pair;
    patterns (3, 2, P, A, n), kg^-½: c₀, c_c, c_s of
    the ground modes; node (3, 2, P, A, 6), m/N and 1/N: the same per unit force and moment on the bore node, beyond the
    ground modes; residual (2, 2, 7, P, P, A, A), m/N: from flank, to flank, tooth offset −3 … 3, beyond the ground
    modes.
    """

    turning: np.ndarray
    chosen: np.ndarray
    level: np.ndarray
    low: np.ndarray
    low_member: np.ndarray
    patterns: np.ndarray
    node: np.ndarray
    residual: np.ndarray
    along: Along | None = None


@dataclass(frozen=True)
class GroundPart:
    """A free body in the ground group. mass (6, 6) of the rigid motion x, y, z, rx, ry, rz about its origin (kg, kg·m,
    kg·m²); omega (n,) rad/s and zeta (n,) of its elastic modes; nodes (K); rows (K, 6, n), kg^-½ and kg^-½/m: nodes in
    the modes; residual (6K, 6K), m/N …: nodes beyond the modes; spinning: what it feels when it turns, None: as a rigid
    body."""

    name: str
    mass: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    nodes: tuple[Node, ...]
    rows: np.ndarray
    residual: np.ndarray
    flank: PartFlank | None = None
    spinning: Spinning | None = None


@dataclass(frozen=True)
class Reading:
    """How the flanks of a toothed body are read: `chosen` modes, width functions of `degrees`, rolls of `to_grid` (P,
    R), weights of those of the body (`resampling`; a unit matrix leaves them), `cuts` of the levels."""

    chosen: np.ndarray
    degrees: np.ndarray
    to_grid: np.ndarray
    cuts: LevelSpec = LevelSpec()


def ground_part(body: Body, reading: Reading | None = None) -> GroundPart:
    """What the ground group takes of a body: all modes of one that is loaded at nodes only, patterns of nodal diameter
    0 and 1 of a toothed one, whose flanks are read as `reading` says.

    ModelError where a node has not all six directions, and where patterns of nodal diameter 2 and more move the node of
    a toothed body: it is no ring of equal sectors.
    """
    if short := [node.name for node in body.nodes if len(node.components) != 6]:
        raise ModelError(f"body '{body.name}': {', '.join(short)} must move in all six directions to hold planets")
    low, symmetric = np.arange(body.modes), np.ones((len(body.rows), body.modes))
    static = body.static
    if reading is not None:
        low, part = reading.chosen[body.toothed.diameter[reading.chosen] <= 1], body.toothed.part
        symmetric, static = _couples(part[low]), static * _couples(NODE_MEMBERS)
    omega = 2 * np.pi * body.frequency[low] if body.exact is None else body.exact.omega
    rows = body.rows[:, low] * symmetric
    residual = _symmetric(static - products(rows / omega**2, rows)) if body.exact is None else body.exact.residual
    if body.exact is None and reading is None:
        scale = np.sqrt(np.abs(np.diag(static)))
        residual = np.where(np.abs(residual) > NOISE * np.outer(scale, scale), residual, 0.0)
    return GroundPart(
        name=body.name,
        mass=body.mass,
        omega=omega,
        zeta=body.damping_ratio[low],
        nodes=body.nodes,
        rows=rows.reshape(len(body.nodes), 6, -1),
        residual=residual,
        flank=None if reading is None else _flank(body, reading, low, rows),
        spinning=body_spinning(body, low),
    )


def _flank(body: Body, reading: Reading, low: np.ndarray, node_rows: np.ndarray) -> PartFlank:
    """What flanks read; low: numbers of the ground modes, node_rows (6, n) of the node in them."""
    flank, degrees, to_grid = body.toothed, reading.degrees, reading.to_grid
    turning = reading.chosen[flank.diameter[reading.chosen] > 1]
    _check_node(body, turning)
    omega = 2 * np.pi * body.frequency[low]
    rows = blend(to_grid, flank.rows[:, :, degrees], 1)
    level = lowest_levels(
        2 * np.pi * body.frequency[turning], flank.part[turning], rows[..., turning], degrees, reading.cuts
    )
    order = np.argsort(level, kind="stable")
    turning, level = turning[order], level[order]
    patterns = turn_tables(rows[..., low], flank.part[low])
    node = turn_tables(blend(to_grid, flank.node[:, :, degrees], 1), NODE_MEMBERS)
    node -= products(patterns / omega**2, node_rows)
    return PartFlank(
        turning=rows[..., turning],
        chosen=turning,
        level=level,
        low=low,
        low_member=flank.part[low],
        patterns=patterns,
        node=node,
        residual=_flank_residual(flank, reading, patterns, omega),
        along=_along(body, np.concatenate([low, turning]), reading, patterns),
    )


def turn_tables(values: np.ndarray, member: np.ndarray) -> np.ndarray:
    """(3, …, n): c₀, c_c, c_s of rows `values` (…, n) on tooth 0; member (n,): 0 single, 1 and 2 of a pair, which
    follow each other."""
    tables = np.zeros((3, *values.shape))
    single, first = np.flatnonzero(member == 0), np.flatnonzero(member == 1)
    tables[0][..., single] = values[..., single]
    a, b = values[..., first], values[..., first + 1]
    tables[1][..., first], tables[2][..., first] = a, -b
    tables[1][..., first + 1], tables[2][..., first + 1] = b, a
    return tables


def read_tables(tables: np.ndarray, psi: float) -> np.ndarray:
    """(…): c₀ + c_c cos ψ + c_s sin ψ of `tables` (3, …)."""
    return tables[0] + tables[1] * np.cos(psi) + tables[2] * np.sin(psi)


def _along(body: Body, chosen: np.ndarray, reading: Reading, patterns: np.ndarray) -> Along | None:
    """None for a body without displacement along the profile. patterns: along the normal."""
    flank, degrees, to_grid = body.toothed, reading.degrees, reading.to_grid
    if (tangent := flank.tangent) is None:
        return None
    low = flank.diameter[chosen] <= 1
    omega = 2 * np.pi * body.frequency[chosen[low]]
    rows = blend(to_grid, tangent.rows[:, :, degrees], 1)
    own_patterns = turn_tables(rows[..., chosen[low]], flank.part[chosen[low]])
    normal, own = (read_tables(tables, 0.0) for tables in (patterns, own_patterns))
    tables = []
    for static, read in ((tangent.static_nt, normal), (tangent.static_tt, own)):
        static = static[..., degrees, :][..., degrees]
        static = blend(to_grid, blend(to_grid, static, 2), 3)
        tables.append(static - _between_flanks(read / omega**2, own))
    return Along(rows[..., chosen[~low]], own_patterns, *tables)


def _flank_residual(flank: Flank, reading: Reading, patterns: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """C_static of the free body less what its ground modes carry, by tooth offset; their rows turn with the offset."""
    static = flank.static[..., reading.degrees, :][..., reading.degrees]
    static = np.stack([static[:, :, offset % static.shape[2]] for offset in OFFSETS], axis=2)
    static = blend(reading.to_grid, blend(reading.to_grid, static, 3), 4)
    here = read_tables(patterns, 0.0) / omega**2
    carried = np.stack([_between_flanks(here, there) for there in patterns])
    for i, offset in enumerate(OFFSETS):
        static[:, :, i] -= read_tables(carried, 2 * np.pi * offset / flank.teeth)
    return static


def _between_flanks(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    """(2, 2, P, P, A, A): Σ_k here there of rows (2, P, A, n), over the modes that `there` has."""
    flanks, rolls, functions, _ = here.shape
    total = np.zeros((flanks, flanks, rolls, rolls, functions, functions))
    part = np.empty_like(total)
    used = np.any(there, axis=(0, 1, 2))
    rows = (np.moveaxis(table[..., used], -1, 0).copy() for table in (here, there))
    for a, b in zip(*rows, strict=True):
        total += np.multiply(a[:, None, :, None, :, None], b[None, :, None, :, None, :], out=part)
    return total


def _couples(member: np.ndarray) -> np.ndarray:
    """(6, n) of 0 and 1: by symmetry single patterns move the bore along and about the axis, pairs across; the rest is
    noise."""
    return ((NODE_MEMBERS == 0)[:, None] == (np.asarray(member) == 0)).astype(float)


def _check_node(body: Body, turning: np.ndarray) -> None:
    scale = np.abs(body.rows).max(axis=1)
    moved = np.abs(body.rows[:, turning]).max(axis=1, initial=0.0)
    if np.any(moved > SILENT * scale):
        raise ModelError(
            f"body '{body.name}': modes of nodal diameter 2 and more move its bore, so it is no ring of equal sectors; "
            "reduce it again, an imported gear with equal sectors"
        )


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)


@dataclass(frozen=True)
class Spinning:
    """Of a free body of n patterns: gyroscopic H and coriolis Q, (6 + n, 6 + n), skew."""

    gyroscopic: np.ndarray
    coriolis: np.ndarray


def rigid_spinning(mass: np.ndarray, patterns: int) -> Spinning:
    """Of a body that tilts as a rigid one: H of its polar moment of inertia, Q of tilt about its centre of mass, the
    rest being that of a point mass there; mass (6, 6) about its axis."""
    h, q = np.zeros((2, RIGID + patterns, RIGID + patterns))
    h[RX, RY] = 0.5 * mass[RZ, RZ]
    q[RY, RX] = mass[RX, RX] - mass[1, RX] ** 2 / mass[0, 0]
    return Spinning(h - h.T, q - q.T)


def body_spinning(body: Body, low: np.ndarray) -> Spinning | None:
    """Of a body with the patterns `low`: sections of a beam tilt, patterns of a gear feel what `Body.spin` tells; None
    of one that turns as if rigid."""
    if body.exact is not None:
        return Spinning(body.exact.gyroscopic, rigid_spinning(body.mass, low.size).coriolis)
    if body.spin is None:
        return None
    rigid, flank = rigid_spinning(body.mass, low.size), body.toothed
    h, q = rigid.gyroscopic, rigid.coriolis
    own = (flank.diameter[low] == 1) & (2 * np.pi * body.frequency[low] < HIGHEST)
    first = np.flatnonzero(own & (flank.part[low] == 1))
    quarter = np.zeros((low.size, low.size))
    quarter[first + 1, first] = 1.0
    quarter -= quarter.T
    h[RIGID:, RIGID:] = (body.spin.coupling[np.ix_(low, low)] - quarter) * np.outer(own, own)
    h[RX : RY + 1, RIGID:] = -body.spin.tilt[:, low] * own
    h[RIGID:, RX : RY + 1] = -h[RX : RY + 1, RIGID:].T
    q[RIGID:, RIGID:] = quarter
    return rigid


def turn_rates(body: Body, chosen: np.ndarray) -> np.ndarray | None:
    """(m,): Coriolis coupling of the pairs among the modes `chosen` of a gear group, first member into second; other
    couplings move frequencies by the square of Ω/ω. None where its file does not tell."""
    if body.spin is None:
        return None
    part = body.toothed.part[chosen]
    rates = np.zeros(chosen.size)
    first = np.flatnonzero(part == 1)
    rates[first] = rates[first + 1] = body.spin.coupling[chosen[first + 1], chosen[first]]
    return rates


def skew_pairs(matrix: np.ndarray) -> np.ndarray:
    """(p, 2, m): rows x, y of a skew matrix (m, m) = Σ y xᵀ − x yᵀ, by its real Schur form."""
    schur, basis = sl.schur(matrix, output="real")
    size = np.diag(schur, 1)
    pairs = []
    for i in np.flatnonzero(np.abs(size) > IDLE * np.abs(size).max(initial=0.0)):
        x, y = (basis[:, i + 1], basis[:, i]) if size[i] > 0 else (basis[:, i], basis[:, i + 1])
        pairs.append(np.sqrt(abs(size[i])) * np.stack([x, y]))
    return np.array(pairs).reshape(-1, 2, len(matrix))


def whirl_rows(group: Group) -> tuple[np.ndarray, np.ndarray]:
    """Rotors (p,) and rows x, y (p, 2, n): those of the bodies' own rotors and of the axes that they stand in.
    Speeds change by −2Ω (y x·v − x y·v), Ω the rotor's speed."""
    layout, rotors, rows = group.layout, [], []
    for r, rotor in enumerate(layout.rotors):
        for body in rotor if r not in layout.stands else ():
            free, frame = layout.bodies[body], layout.frame_of(body)
            own = free.spinning or rigid_spinning(free.mass, free.omega.size)
            for turns, matrix in ((r, own.gyroscopic), (frame, own.coriolis)):
                if turns >= 0:
                    found = skew_pairs(matrix[np.ix_(*2 * [_unknowns(layout, body)])]) @ group.shapes[group.at[body]]
                    rotors += len(found) * [turns]
                    rows += list(found)
    return np.array(rotors, int), np.array(rows).reshape(-1, 2, group.omega.size)


def _unknowns(layout: Layout, body: int) -> np.ndarray:
    """Which of the rigid motions and patterns of a body are unknowns."""
    return np.array([*layout.freedoms(body), *range(6, 6 + layout.bodies[body].omega.size)], int)
