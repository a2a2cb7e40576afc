"""Static compliance of a free gear body between tooth flanks and bore: C = Pᵀ K⁺ P, inertia relief, mean-axis gauge.

Each harmonic contributes Fᴴ C_ν F; tooth offset m is their Fourier sum. For a body that is its own mirror image about
mid-width, loads of even and odd width functions do not see each other: those entries are zero exactly. Loads along the
profile (friction) are answered on the own tooth only.

Loads are condensed onto the cuts. With y = L⁻¹ f_I of the factor of the interior and g = f_B − K_BI K_II⁻¹ f_I,
    fᴴ C_ν f' = yᵀ y' + g_νᴴ S_ν⁻¹ g'_ν,        g_ν = g on (minus, plus) seen by ν,
exactly, S_ν as of `fem.harmonic`. yᵀ y' and g are the same for all ν. For ν = 0 and 1 loads are balanced first by the
inertia forces of rigid motion, which are loads of the sector like others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.fem.cyclic import SectorSpace
from gearfmu.fem.harmonic import Harmonic
from gearfmu.reduction.cyclic.flank import Points
from gearfmu.reduction.cyclic.modal import Progress, untold
from gearfmu.reduction.cyclic.sector import SectorBody

_NEGLIGIBLE = 1e-11  # of the largest: singular values of the loads on the cuts that are left out
_COLUMNS = 128


@dataclass(frozen=True)
class Statics:
    """Static compliance, conventions of `body.body.Flank`: C_ff (2, 2, z, R, R, A, A), m/N; C_fb (2, R, A, 6), m/N and
    1/N; C_bb (6, 6), m/N … 1/(N·m). pictures : (p, z, 3N) displacement of all sectors, in sector frames, under the
    unit flank loads asked for, m/N. static_nt, static_tt (2, 2, R, R, A, A), m/N: displacement along the normal and
    along the profile at (tooth 0, flank f, roll i, function a) per load along the profile at (tooth 0, g, j, b); None
    where there are no such rows. Of a ring also static_fp (2, z, R, A, 3), flank row of tooth 0 per unit force x, y, z
    (sector frame) on the rim patch of sector m, and static_pp (z, 3, 3), m/N; last index 0 of a gear by its sector."""

    static_ff: np.ndarray
    static_fb: np.ndarray
    static_bb: np.ndarray
    pictures: np.ndarray
    static_nt: np.ndarray | None = None
    static_tt: np.ndarray | None = None
    static_fp: np.ndarray | None = None
    static_pp: np.ndarray | None = None


def static_tables(body: SectorBody, picture_loads: list[int], progress: Progress = untold) -> Statics:
    """Compliance of all flank points and the bore for every tooth offset.

    picture_loads : flat indices (side, roll, function) of loads on tooth 0 whose displacement is wanted everywhere.
    """
    size, every, z = body.profile_loads, body.load_matrix.shape[0], body.teeth
    ff, fb, bb = np.zeros((z, size, size)), np.zeros((every, 6)), np.zeros((6, 6))
    own = np.zeros((every, every))
    pictures = np.zeros((len(picture_loads), z, body.mesh.nodes.size))
    for index, space in enumerate(body.spaces):
        loads = _CondensedLoads(body, space)
        seen, normal = loads.columns, np.flatnonzero(loads.columns < size)
        shown = [load for load in picture_loads if load in seen]
        kernels, moved = _all_diameters(body, index, loads, np.searchsorted(seen, shown), progress)
        table = np.zeros((z, len(normal), len(normal)))
        for m in range(z):
            table[m] = loads.parts[:, normal].T @ kernels[m] @ loads.parts[:, normal]
        inner = loads.gram[: loads.count, : loads.count]
        table[0] += inner[np.ix_(normal, normal)]
        own[np.ix_(seen, seen)] += inner + loads.parts.T @ kernels[0] @ loads.parts
        for nu in (0, 1):
            harmonic = space.harmonic(nu)
            product = loads.compliance(harmonic, loads.tooth, loads.tooth) - inner
            own[np.ix_(seen, seen)] += harmonic.weight / z * product.real
            turn = harmonic.weight / z * np.exp(-2j * np.pi * nu * np.arange(z) / z)
            for m in range(z):
                table[m] += (turn[m] * product[np.ix_(normal, normal)]).real
            bore = loads.bore @ body.bore_parts(harmonic)
            fb[seen] += harmonic.weight * loads.compliance(harmonic, loads.tooth, bore).real
            bb += z * harmonic.weight * loads.compliance(harmonic, bore, bore).real
        ff[np.ix_(np.arange(z), seen[normal], seen[normal])] += table
        for number, load in enumerate(shown):
            pictures[picture_loads.index(load)] += _picture(body, index, load, moved[:, :, [number]])
    return _shaped(body, symmetric_offsets(ff), fb, bb, 0.5 * (own + own.T), pictures)


class _CondensedLoads:
    """Loads of one space, k in all: those of a tooth that the space sees (`count`), six of the bore, six of inertia.

    gram : yᵀ y', (k, k). border : g, (b, k). patterns (b, r), parts (r, count): the tooth's columns of g as a product.
    """

    def __init__(self, body: SectorBody, space: SectorSpace):
        self.columns = body.seen_loads(space.parity)
        self.count = len(self.columns)
        teeth = space.from_nodes @ body.load_matrix[self.columns].T
        others = np.hstack([space.from_nodes @ body.bore_moments[0].T, space.mass_matrix @ space.rigid])
        loads = sp.csc_array(sp.hstack([teeth, sp.csc_array(others)]))
        inner = np.empty((space.interior, loads.shape[1]))
        self.border, self._motion = loads[space.interior :].toarray(), loads.T.dot(space.rigid).T
        for first in range(0, loads.shape[1], _COLUMNS):
            columns = slice(first, first + _COLUMNS)
            inner[:, columns], passed = space.factor.forward(loads[: space.interior, columns].toarray())
            self.border[:, columns] += passed
        self.gram = inner.T @ inner
        self.patterns, self.parts = _low_rank(self.border[:, : self.count])

    @property
    def bore(self) -> np.ndarray:
        """Columns of the bore's six loads among all, as a selection (k, 6)."""
        return np.eye(len(self.gram))[:, self.count : self.count + 6]

    @property
    def tooth(self) -> np.ndarray:
        """Columns of the tooth's loads among all, as a selection (k, count)."""
        return np.eye(len(self.gram))[:, : self.count]

    def compliance(self, harmonic: Harmonic, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """leftᴴ C_ν right of combinations of the k loads."""
        left, right = (self._balanced(harmonic, parts) for parts in (left, right))
        cut = harmonic.reduce_border(self.border)
        return left.conj().T @ self.gram @ right + (cut @ left).conj().T @ harmonic.solve_cut(cut @ right)

    def kernel(self, harmonic: Harmonic) -> tuple[np.ndarray, np.ndarray]:
        """Of ν ≥ 2: cut displacement (c, r) per load in `patterns`, and their compliance (r, r)."""
        cut = harmonic.reduce_border(self.patterns)
        moved = harmonic.solve_cut(cut)
        return moved, cut.conj().T @ moved

    def _balanced(self, harmonic: Harmonic, parts: np.ndarray) -> np.ndarray:
        if not harmonic.rigid.shape[1]:
            return parts
        rigid = harmonic.rigid_parts
        parts = parts.astype(np.result_type(parts, rigid))
        parts[-6:] -= rigid @ (rigid.conj().T @ (self._motion @ parts))
        return parts


def _low_rank(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal columns, and rows, whose product is the matrix."""
    left, values, right = sl.svd(matrix, full_matrices=False, check_finite=False)
    kept = values > _NEGLIGIBLE * values.max(initial=0.0)
    return left[:, kept], values[kept, None] * right[kept]


def _all_diameters(
    body: SectorBody, index: int, loads: _CondensedLoads, shown: np.ndarray, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """What ν = 2, 3, … do on the cuts: Fourier sums (z, r, r) of `_CondensedLoads.kernel` by tooth offset, and the
    cut's displacement (ν, c, p) under the loads that are shown."""
    z, found = body.teeth, []
    diameters = np.arange(2, z // 2 + 1)
    for nu in diameters.tolist():
        progress(f"static compliance, nodal diameter {nu}", nu / (z // 2 + 1))
        harmonic = body.spaces[index].harmonic(nu)
        moved, kernel = loads.kernel(harmonic)
        found.append((moved @ loads.parts[:, shown], kernel))
    turn = _weights(z, diameters) * np.exp(2j * np.pi * np.multiply.outer(np.arange(z), diameters) / z)
    rank = loads.patterns.shape[1]
    if not found:
        return np.zeros((z, rank, rank)), np.zeros((0, len(loads.border), len(shown)))
    stacked = np.array([kernel for _, kernel in found]).reshape(len(found), -1)
    kernels = turn.real @ stacked.real + turn.imag @ stacked.imag
    return kernels.reshape(z, rank, rank), np.array([moved for moved, _ in found])


def _weights(z: int, diameters: np.ndarray) -> np.ndarray:
    """Share of each ν in a sum over all: ν and −ν together where both are there."""
    return np.where(2 * diameters % z, 2, 1) / z


def _picture(body: SectorBody, index: int, load: int, moved: np.ndarray) -> np.ndarray:
    """Displacement (z, 3N) of all sectors under a load of tooth 0; moved (ν, c, 1): that of the cut, ν = 2, 3, …"""
    space, z = body.spaces[index], body.teeth
    diameters = np.arange(2, z // 2 + 1)
    turn = _weights(z, diameters)[:, None] * np.exp(2j * np.pi * np.multiply.outer(diameters, np.arange(z)) / z)
    expand = [space.harmonic(nu).expand_border(cut) for nu, cut in zip(diameters.tolist(), moved, strict=True)]
    border = np.zeros((len(space.factor.schur), z))
    for shape, around in zip(expand, turn, strict=True):
        border += (shape * around).real
    force = space.from_nodes @ body.load_matrix[[load]].toarray().T
    inner, _ = space.factor.forward(force[: space.interior])
    inside = space.factor.backward(inner * turn.real.sum(axis=0), border)
    total = (space.to_nodes @ np.concatenate([inside, border])).T
    for nu in (0, 1):
        harmonic = space.harmonic(nu)
        response = space.to_nodes @ harmonic.expand(harmonic.flexibility(body.tooth_forces(harmonic, np.array([load]))))
        around = harmonic.weight / z * np.exp(2j * np.pi * nu * np.arange(z) / z)
        total += np.multiply.outer(around, response[:, 0]).real
    return total


def _shaped(
    body: SectorBody, ff: np.ndarray, fb: np.ndarray, bb: np.ndarray, own: np.ndarray, pictures: np.ndarray
) -> Statics:
    """The tables by flank, roll and function; own (every, every): compliance of all loads of one tooth."""
    z, flank, profile = body.teeth, body.flank_count, body.profile_loads
    loads = 2, len(body.points.rolls), body.points.functions
    of_profile = (block.reshape(*loads, *loads) for block in (own[:flank, profile:], own[profile:, profile:]))
    normal, tangent = (np.ascontiguousarray(block.transpose(0, 3, 1, 4, 2, 5)) for block in of_profile)
    return Statics(
        static_ff=by_load(ff[:, :flank, :flank], body.points),
        static_fb=fb[:flank].reshape(*loads, 6),
        static_bb=0.5 * (bb + bb.T),
        pictures=pictures,
        static_nt=normal,
        static_tt=tangent,
        static_fp=ff[:, :flank, flank:].reshape(z, *loads, -1).transpose(1, 0, 2, 3, 4),
        static_pp=ff[:, flank:, flank:],
    )


def symmetric_offsets(tables: np.ndarray) -> np.ndarray:
    """Compliance (z, k, k) by tooth offset, the same from tooth 0 to m as from m to 0."""
    back = tables[(-np.arange(len(tables))) % len(tables)].transpose(0, 2, 1)
    return 0.5 * (tables + back)


def by_load(tables: np.ndarray, points: Points) -> np.ndarray:
    """Tables (z, 2·R·A, 2·R·A) between all loads of two flanks as `Statics.static_ff`."""
    loads = 2, len(points.rolls), points.functions
    return np.ascontiguousarray(tables.reshape(len(tables), *loads, *loads).transpose(1, 4, 0, 2, 5, 3, 6))
