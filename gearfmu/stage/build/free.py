"""Free bodies as the ground group takes them: rigid motion, patterns of nodal diameter 0 and 1 in axes that do not
turn, interface nodes, and what a gear's flanks read of all that.

In axes that do not turn the pair (first, second) of nodal diameter 1 is a vector P in the plane, and so are forces x, y
and moments x, y at a node on the axis. With a, b the rows of the pair on tooth 0, a tooth at the angle ψ reads
(docs/theory.md eq. 3, θ = ψ)

    w = (a cos ψ − b sin ψ) P₁ + (a sin ψ + b cos ψ) P₂

so every row at a flank is c₀ + c_c cos ψ + c_s sin ψ, stored as three tables; a single pattern (ν = 0) or direction (z,
rz) has c₀ alone. Rows at a node on the axis are constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.body.beam import BeamBody
from gearfmu.body.interface_body import InterfaceBody
from gearfmu.errors import ModelError
from gearfmu.spec.tables.ports import LevelSpec
from gearfmu.stage.build.levels import lowest_levels
from gearfmu.stage.build.spinning import Spinning, gear_spinning, shaft_spinning
from gearfmu.stage.build.tables import OFFSETS, blend

NODE_MEMBERS = np.array([1, 2, 0, 1, 2, 0])  # x, y and rx, ry are pairs, z and rz single
NOISE = 1e-7  # of the static compliance of a carrier: smaller residuals are rounding of its Krylov vectors
SILENT = 1e-6  # bore rows of patterns of nodal diameter 2 and more, relative: must vanish


@dataclass(frozen=True)
class Along:
    """What flanks read along the profile, towards growing roll, as `Flank` has it along the normal: turning, patterns,
    and compliances of one tooth beyond the ground modes: normal (2, 2, P, P, A, A), m/N, along the normal, own, along
    the profile, per force along the profile. What a force there does to the bore beyond the modes is not known."""

    turning: np.ndarray
    patterns: np.ndarray
    normal: np.ndarray
    own: np.ndarray


@dataclass(frozen=True)
class Flank:
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
class FreeBody:
    """A free body on its axis. mass (6, 6) of the rigid motion x, y, z, rx, ry, rz about its origin on the axis (kg,
    kg·m, kg·m²); omega (n,) rad/s and zeta (n,) of its elastic modes; place (K,) m: interface nodes along the axis,
    from the origin, across (K, 2) m: beside it; rows (K, 6, n), kg^-½ and kg^-½/m: nodes in the modes; residual (6K,
    6K), m/N …: nodes beyond the modes; spinning: what it feels when it turns, None: as a rigid body."""

    name: str
    mass: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    place: np.ndarray
    rows: np.ndarray
    residual: np.ndarray
    flank: Flank | None = None
    across: np.ndarray | None = None
    spinning: Spinning | None = None

    def rigid_rows(self, node: int) -> np.ndarray:
        """(6, 6): rigid motion of the body → motion of a node."""
        rows = np.eye(6)
        rows[0, 4], rows[1, 3] = self.place[node], -self.place[node]
        if self.across is not None:
            x, y = self.across[node]
            rows[0, 5], rows[1, 5], rows[2, 3], rows[2, 4] = -y, x, y, -x
        return rows


def free_gear(
    body: Any, chosen: np.ndarray, degrees: np.ndarray, to_grid: np.ndarray, cuts: LevelSpec | None = None
) -> FreeBody:
    """The FreeBody of a ReducedBody: `chosen` modes, width functions of `degrees`, rolls of `to_grid` (P, R), weights
    of those of the body (`resampling`; a unit matrix leaves them), `cuts` of the levels. Its one node is the bore.

    ModelError where patterns of nodal diameter 2 and more move the bore: the body is no ring of equal sectors.
    """
    low = chosen[body.nodal_diameter[chosen] <= 1]
    turning = chosen[body.nodal_diameter[chosen] > 1]
    _check_bore(body, turning)
    omega = 2 * np.pi * body.frequency[low]
    bore = body.bore_rows[:, low] * _couples(body.part[low])
    rows = blend(to_grid, body.flank_rows[:, :, degrees], 1)
    level = lowest_levels(
        2 * np.pi * body.frequency[turning], body.part[turning], rows[..., turning], degrees, cuts or LevelSpec()
    )
    order = np.argsort(level, kind="stable")
    turning, level = turning[order], level[order]
    patterns = turn_tables(rows[..., low], body.part[low])
    node = turn_tables(blend(to_grid, body.static_fb[:, :, degrees], 1), NODE_MEMBERS)
    node -= products(patterns / omega**2, bore)
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = body.mass * np.eye(3), body.inertia
    return FreeBody(
        name=body.name,
        mass=mass,
        omega=omega,
        zeta=body.damping_ratio[low],
        place=np.zeros(1),
        rows=bore[None],
        residual=_symmetric(body.static_bb * _couples(NODE_MEMBERS) - products(bore / omega**2, bore)),
        flank=Flank(
            turning=rows[..., turning],
            chosen=turning,
            level=level,
            low=low,
            low_member=body.part[low],
            patterns=patterns,
            node=node,
            residual=_flank_residual(body, degrees, to_grid, patterns, omega),
            along=_along(body, np.concatenate([low, turning]), degrees, to_grid, patterns),
        ),
        spinning=gear_spinning(body, mass, low),
    )


def free_shaft(name: str, beam: BeamBody, damping_ratio: float) -> FreeBody:
    """The FreeBody of a shaft, its origin the centre of mass; all its modes with one damping ratio."""
    zeta, spinning = np.full(beam.omega.size, damping_ratio), shaft_spinning(beam)
    return FreeBody(name, beam.mass, beam.omega, zeta, beam.place, beam.rows, beam.residual, spinning=spinning)


def free_carrier(body: InterfaceBody) -> FreeBody:
    """The FreeBody of a carrier, its origin that of its own file; nodes in the order of its interfaces.

    ModelError where an interface has not all six directions.
    """
    short = [i["name"] for i in body.interfaces if len(i["components"]) != 6]
    if short:
        raise ModelError(f"body '{body.name}': {', '.join(short)} must move in all six directions to hold planets")
    omega, count = 2 * np.pi * body.frequency, len(body.interfaces)
    residual = _symmetric(body.static - products(body.rows / omega**2, body.rows))
    scale = np.sqrt(np.abs(np.diag(body.static)))
    return FreeBody(
        name=body.name,
        mass=body.rigid_mass,
        omega=omega,
        zeta=body.damping_ratio,
        place=body.point[:, 2],
        rows=body.rows.reshape(count, 6, -1),
        residual=np.where(np.abs(residual) > NOISE * np.outer(scale, scale), residual, 0.0),
        across=body.point[:, :2],
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


def _along(
    body: Any, chosen: np.ndarray, degrees: np.ndarray, to_grid: np.ndarray, patterns: np.ndarray
) -> Along | None:
    """None for a body without displacement along the profile. patterns: along the normal."""
    if (tangent := getattr(body, "tangent", None)) is None:
        return None
    low = body.nodal_diameter[chosen] <= 1
    omega = 2 * np.pi * body.frequency[chosen[low]]
    rows = blend(to_grid, tangent.rows[:, :, degrees], 1)
    own_patterns = turn_tables(rows[..., chosen[low]], body.part[chosen[low]])
    normal, own = (read_tables(tables, 0.0) for tables in (patterns, own_patterns))
    tables = []
    for static, read in ((tangent.static_nt, normal), (tangent.static_tt, own)):
        static = static[..., degrees, :][..., degrees]
        static = blend(to_grid, blend(to_grid, static, 2), 3)
        tables.append(static - _between_flanks(read / omega**2, own))
    return Along(rows[..., chosen[~low]], own_patterns, *tables)


def _flank_residual(
    body: Any, degrees: np.ndarray, to_grid: np.ndarray, patterns: np.ndarray, omega: np.ndarray
) -> np.ndarray:
    """C_static of the free body less what its ground modes carry, by tooth offset; their rows turn with the offset."""
    static = body.static_ff[..., degrees, :][..., degrees]
    static = np.stack([static[:, :, offset % static.shape[2]] for offset in OFFSETS], axis=2)
    static = blend(to_grid, blend(to_grid, static, 3), 4)
    here = read_tables(patterns, 0.0) / omega**2
    carried = np.stack([_between_flanks(here, there) for there in patterns])
    for i, offset in enumerate(OFFSETS):
        static[:, :, i] -= read_tables(carried, 2 * np.pi * offset / body.teeth)
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


def _check_bore(body: Any, turning: np.ndarray) -> None:
    scale = np.abs(body.bore_rows).max(axis=1)
    moved = np.abs(body.bore_rows[:, turning]).max(axis=1, initial=0.0)
    if np.any(moved > SILENT * scale):
        raise ModelError(
            f"body '{body.name}': modes of nodal diameter 2 and more move its bore, so it is no ring of equal sectors; "
            "reduce it again, an imported gear with equal sectors"
        )


def products(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left (…, n) · right (m, n)ᵀ, summed in one order whatever the memory (`blend`)."""
    total = np.zeros((*left.shape[:-1], right.shape[0]))
    part = np.empty_like(total)
    for k in range(right.shape[1]):
        total += np.multiply(left[..., k, None], right[:, k], out=part)
    return total


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)
