"""Free bodies with z equal sectors, one sector at a time: every nodal diameter ν is a small system on the cut faces.

Displacements are written in the frame of each sector; those of harmonic ν are u_j = U exp(2πiνj/z) in sector j. With
the dofs of the plus cut turned by −2π/z into the frame of the minus cut, u_plus = exp(iθ) u_minus, θ = 2πν/z.
The interior is factorised once, real, with both cuts held, and condensed onto the cuts:
    S = K_BB − K_BI K_II⁻¹ K_IB,   S_ν = S_mm + S_pp + e^{iθ} S_mp + e^{−iθ} S_pm,
so that each harmonic costs a dense system of the size of one cut. S_ν is singular only for ν = 0 and 1, by the rigid
motions, which are known. A sector that is its own mirror image about mid-width (z → −z) splits once more, exactly,
into symmetric and antisymmetric fields; one of a helical gear is not and has one space of all fields. Source: Thomas,
Int. J. Numer. Meth. Eng. 14 (1979) 81 (cyclic symmetry).

A surface may be rigid (a bore on a stiff shaft): its nodes are eliminated for the rigid motions of that surface, which
join the cuts as unknowns of the condensed system. Seen from sector j a motion q of the whole surface turns back by
2πj/z: ν = 0 has translation along and rotation about the axis, ν = 1 translation across it and tilts, as amplitudes a
of (q_x, q_y) = (1, i) a, and for ν ≥ 2 the surface stands still. A rigid patch inside every sector (the seat of a bolt)
has six unknowns of its own in each, which are inner ones like any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.fem.coupling import rigid_fields, rigid_modes
from gearfmu.fem.factor import Factor

_MATCH = 1e-7  # of the mesh's size: nodes that should coincide


@dataclass(frozen=True)
class Sector:
    """Finite-element model of one sector, in its own frame.

    nodes (N, 3), m; elements (E, 20); stiffness, mass (3N, 3N) csr; teeth z ≥ 3; cut_minus, cut_plus (c,): paired
    nodes. helical: no mirror at mid-width is looked for. rigid (r,): nodes of a surface that moves as one rigid body
    over all sectors; None or empty: there is none. patch (p,): nodes off the cuts that move as a rigid body of their
    own in every sector, of a sector without mirror; None: there are none.
    """

    nodes: np.ndarray
    elements: np.ndarray
    stiffness: sp.csr_array
    mass: sp.csr_array
    teeth: int
    cut_minus: np.ndarray
    cut_plus: np.ndarray
    helical: bool = False
    rigid: np.ndarray | None = None
    patch: np.ndarray | None = None


class SectorSpace:
    """The fields of one mirror parity on a sector, condensed onto the cuts (see the head of this file).

    parity : +1 symmetric about mid-width (u_x, u_y even, u_z odd in z), −1 antisymmetric, 0 for a sector without that
    symmetry.
    to_nodes : (3N, n) sparse; columns ordered interior, minus cut, plus cut (orthonormal), and the motions of the rigid
    surface, rotations as the displacement at its largest radius.
    """

    def __init__(self, sector: Sector, mirror: np.ndarray, parity: int):
        self.parity, self.teeth = parity, sector.teeth
        basis, owner = _parity_basis(mirror, parity) if parity else _all_fields(sector)
        minus, plus, interior = _split(owner, sector)
        patch = _patch_motions(sector)
        self.interior, self.cut = len(interior) + patch.shape[1], len(minus)
        columns = sp.hstack([basis[:, interior], sp.csc_array(patch), basis[:, np.concatenate([minus, plus])]])
        self.to_nodes = sp.csc_array(_turn_plus(sector) @ sp.csc_array(columns))
        self.motions, length, moved = _rigid_surface(sector, parity)
        if len(self.motions):
            self.to_nodes = sp.csc_array(sp.hstack([self.to_nodes, sp.csc_array(moved)]))
        self.from_nodes = sp.csr_array(self.to_nodes.T)
        stiffness = sp.csr_array(self.from_nodes @ sector.stiffness @ self.to_nodes)
        self.mass_matrix = sp.csr_array(self.from_nodes @ sector.mass @ self.to_nodes)
        self.rigid = self.from_nodes @ rigid_modes(sector.nodes)
        if len(self.motions):
            self.rigid[self.interior + 2 * self.cut :] = (np.eye(6) * length)[self.motions]
        inside, border = slice(0, self.interior), slice(self.interior, None)
        inner = owner[interior] // 3
        if sector.patch is not None:
            mirror = mirror.copy()
            mirror[sector.patch] = first = sector.patch.min()  # stands for all of them
            inner = np.concatenate([inner, np.full(6, first)])
        self._factor = Factor(stiffness[inside, inside], _cells(sector.elements, mirror, inner), inner)
        self.coupling = sp.csr_array(stiffness[inside, border])
        self.influence = self._factor.solve(self.coupling.toarray())
        self.schur = stiffness[border, border].toarray() - self.coupling.T @ self.influence

    def solve_held(self, loads: np.ndarray) -> np.ndarray:
        """K_II⁻¹ f for interior loads (interior, k): both cuts held."""
        return self._factor.solve(loads)

    def harmonic(self, nodal_diameter: int) -> Harmonic:
        """The body restricted to one nodal diameter 0 ≤ ν ≤ z/2."""
        return Harmonic(self, nodal_diameter)


class Harmonic:
    """One nodal diameter of one parity: a free body in complex coordinates (interior, minus cut, amplitudes of the
    rigid surface), real for ν = 0, z/2.

    Quantities are those of one sector: φᴴ M φ of a vector is its mass product over one sector.
    rigid : (size, r) rigid motions of this harmonic, mass-normalised over one sector; r = 0 for ν ≥ 2.
    """

    def __init__(self, space: SectorSpace, nodal_diameter: int):
        self.space, self.nodal_diameter = space, nodal_diameter
        angle = 2 * np.pi * nodal_diameter / space.teeth
        self.is_real = nodal_diameter == 0 or 2 * nodal_diameter == space.teeth
        self.phase = float(round(np.cos(angle))) if self.is_real else complex(np.cos(angle), np.sin(angle))
        self.dtype = float if self.is_real else complex
        self._surface = self._surface_motions()
        self.size = space.interior + space.cut + self._surface.shape[1]
        self.rigid = self._rigid_motions()
        self._mass_rigid = self.mass(self.rigid)
        self.elastic = self.size - self.rigid.shape[1]

    def _surface_motions(self) -> np.ndarray:
        """Motions of the rigid surface that belong to this harmonic, as columns: (motions of the space, amplitudes)."""
        patterns: dict[int, list[dict[int, complex]]] = {0: [{2: 1}, {5: 1}], 1: [{0: 1, 1: 1j}, {3: 1, 4: 1j}]}
        motions = list(self.space.motions)
        mine = [p for p in patterns.get(self.nodal_diameter, []) if set(p) <= set(motions)]
        columns = np.zeros((len(motions), len(mine)), self.dtype)
        for k, pattern in enumerate(mine):
            for motion, value in pattern.items():
                columns[motions.index(motion), k] = value if np.iscomplexobj(columns) else value.real
        return columns

    def _rigid_motions(self) -> np.ndarray:
        r, nu = self.space.rigid, self.nodal_diameter
        if nu == 0:
            fields = r[:, [2, 5]]
        elif nu == 1:
            fields = np.stack([r[:, 0] + 1j * r[:, 1], r[:, 3] + 1j * r[:, 4]], axis=1)
        else:
            return np.zeros((self.size, 0), self.dtype)
        fields = self._without_plus(fields)
        fields = fields[:, np.linalg.norm(fields, axis=0) > 1e-9 * np.linalg.norm(r)]
        gram = fields.conj().T @ self.mass(fields)
        return sl.solve_triangular(np.linalg.cholesky(gram), fields.conj().T, lower=True).conj().T

    def _without_plus(self, fields: np.ndarray) -> np.ndarray:
        """Fields of this harmonic in the sector's coordinates → in this harmonic's."""
        interior, cut = self.space.interior, self.space.cut
        kept = fields[: interior + cut]
        if not self._surface.shape[1]:
            return kept
        return np.concatenate([kept, np.linalg.pinv(self._surface) @ fields[interior + 2 * cut :]])

    def reduce(self, sector_loads: np.ndarray) -> np.ndarray:
        """Loads on the sector's coordinates (interior, minus, plus, rigid surface) → on this harmonic's coordinates."""
        interior, cut = self.space.interior, self.space.cut
        plus = interior + cut
        loads = sector_loads[:plus].astype(np.result_type(sector_loads, self.dtype))
        loads[interior:] += np.conj(self.phase) * sector_loads[plus : plus + cut]
        return self._with_surface(loads, sector_loads[plus + cut :])

    def _with_surface(self, loads: np.ndarray, on_surface: np.ndarray) -> np.ndarray:
        if not self._surface.shape[1]:
            return loads
        return np.concatenate([loads, self._surface.conj().T @ on_surface])

    def expand(self, vectors: np.ndarray) -> np.ndarray:
        """This harmonic's coordinates → the sector's coordinates (interior, minus, plus, rigid surface)."""
        return np.concatenate([vectors[: self.space.interior], self._expand_border(vectors[self.space.interior :])])

    def _expand_border(self, border: np.ndarray) -> np.ndarray:
        """(minus, amplitudes) → (minus, plus, rigid surface)."""
        cut = border[: self.space.cut]
        both = [cut, self.phase * cut]
        if len(self.space.motions):
            both.append(self._surface @ border[self.space.cut :])
        return np.concatenate(both)

    def mass(self, vectors: np.ndarray) -> np.ndarray:
        """M v over one sector."""
        return self.reduce(_real_times_any(self.space.mass_matrix, self.expand(vectors)))

    @cached_property
    def _cut_solver(self) -> tuple[np.ndarray, np.ndarray]:
        """LU of S_ν; its rigid null space is filled up, which changes nothing for balanced loads."""
        cut, schur = self.space.cut, self.space.schur
        minus, plus, surface = slice(0, cut), slice(cut, 2 * cut), slice(2 * cut, None)
        s = (
            schur[minus, minus]
            + schur[plus, plus]
            + self.phase * schur[minus, plus]
            + np.conj(self.phase) * schur[plus, minus]
        )
        if self._surface.shape[1]:
            mixed = (schur[minus, surface] + np.conj(self.phase) * schur[plus, surface]) @ self._surface
            own = self._surface.conj().T @ schur[surface, surface] @ self._surface
            s = np.block([[s, mixed], [mixed.conj().T, own]])
        rigid = self.rigid[self.space.interior :]
        if rigid.shape[1]:
            rigid = np.linalg.qr(rigid)[0]
            s = s + np.abs(s.diagonal()).mean() * (rigid @ rigid.conj().T)
        return sl.cho_factor(0.5 * (s + s.conj().T))

    def balance(self, loads: np.ndarray) -> np.ndarray:
        """Pᴴ f: loads together with the inertia forces of the rigid motion they cause."""
        if not self.rigid.shape[1]:
            return loads
        return loads - self._mass_rigid @ (self.rigid.conj().T @ loads)

    def gauge(self, vectors: np.ndarray) -> np.ndarray:
        """P u: displacement without its rigid part."""
        if not self.rigid.shape[1]:
            return vectors
        return vectors - self.rigid @ (self._mass_rigid.conj().T @ vectors)

    @cached_property
    def _held_inertia(self) -> np.ndarray:
        return self.space.solve_held(self._mass_rigid[: self.space.interior])

    def flexibility(self, loads: np.ndarray, held: np.ndarray | None = None) -> np.ndarray:
        """C_ν f = P K_ν⁺ Pᴴ f. `held` = `space.solve_held` of the interior loads, where it is known already."""
        space, interior, cut = self.space, self.space.interior, self.space.cut
        balanced = self.balance(loads)
        carried = _real_times_any(space.influence.T, balanced[:interior])
        on_border = balanced[interior:]
        on_cut = on_border[:cut] - carried[:cut] - np.conj(self.phase) * carried[cut : 2 * cut]
        if self._surface.shape[1]:
            on_surface = on_border[cut:] - self._surface.conj().T @ carried[2 * cut :]
            on_cut = np.concatenate([on_cut, on_surface])
        moved = sl.cho_solve(self._cut_solver, on_cut)
        border = self._expand_border(moved)
        if held is None:
            inside = space.solve_held(balanced[:interior] - _real_times_any(space.coupling, border))
        else:
            inside = (
                held - self._held_inertia @ (self.rigid.conj().T @ loads) - _real_times_any(space.influence, border)
            )
        return self.gauge(np.concatenate([inside, moved]))


def sector_spaces(sector: Sector) -> list[SectorSpace]:
    """The sector's field spaces: symmetric and antisymmetric about mid-width, or one space (parity 0) if it has no
    mirror.

    Raises MeshError when the cut faces do not match.
    """
    _check_cuts(sector)
    mirror = None if sector.helical else mirror_nodes(sector.nodes)
    if mirror is None:
        return [SectorSpace(sector, np.arange(len(sector.nodes)), 0)]
    return [SectorSpace(sector, mirror, parity) for parity in (1, -1)]


def mirror_nodes(nodes: np.ndarray) -> np.ndarray | None:
    """For each node the one at (x, y, −z), or None when the mesh is not its own mirror image."""
    image = nodes * np.array([1.0, 1.0, -1.0])
    distance, mirror = cKDTree(nodes).query(image)
    return mirror if distance.max() <= _MATCH * np.ptp(nodes, axis=0).max() else None


def _parity_basis(mirror: np.ndarray, parity: int) -> tuple[sp.csc_array, np.ndarray]:
    """Orthonormal fields of one parity, one per degree of freedom of the nodes at z ≥ 0, and their owner dofs."""
    node = np.arange(len(mirror))
    own = mirror == node
    first = np.minimum(node, mirror) == node
    sign = parity * np.array([1, 1, -1])
    keep = np.where(own[:, None], sign == 1, first[:, None])
    owner = np.flatnonzero(keep.ravel())
    partner, component = mirror[owner // 3], owner % 3
    alone = own[owner // 3]
    columns = np.arange(len(owner))
    weight = np.where(alone, 1.0, np.sqrt(0.5))
    rows = np.concatenate([owner, 3 * partner[~alone] + component[~alone]])
    values = np.concatenate([weight, (weight * sign[component])[~alone]])
    basis = sp.coo_array((values, (rows, np.concatenate([columns, columns[~alone]]))), (3 * len(mirror), len(owner)))
    return sp.csc_array(basis), owner


def _all_fields(sector: Sector) -> tuple[sp.csc_array, np.ndarray]:
    size = sector.nodes.size
    return sp.csc_array(sp.identity(size)), np.arange(size)


def _cells(elements: np.ndarray, mirror: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Elements as nodes of the mirrored half, without the nodes that are not among `kept` (−1)."""
    first = np.minimum(np.arange(len(mirror)), mirror)
    present = np.zeros(len(mirror), bool)
    present[kept] = True
    folded = np.sort(first[elements], axis=1)
    folded = np.unique(folded, axis=0)
    return np.where(present[folded], folded, -1)


def _check_cuts(sector: Sector) -> None:
    angle = 2 * np.pi / sector.teeth
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    if len(sector.cut_minus) != len(sector.cut_plus):
        raise MeshError(f"cut faces have {len(sector.cut_minus)} and {len(sector.cut_plus)} nodes; they must match")
    gap = sector.nodes[sector.cut_plus] - sector.nodes[sector.cut_minus] @ turn.T
    if np.abs(gap).max(initial=0.0) > _MATCH * np.ptp(sector.nodes, axis=0).max():
        raise MeshError(f"cut faces differ by up to {np.abs(gap).max():.3g} m after a turn by 2π/{sector.teeth}")


def _rigid_surface(sector: Sector, parity: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motions of the rigid surface with this parity (0 … 5: translation x, y, z, rotation x, y, z), the factors (6,)
    from rigid motion to their coordinates, and their displacement (3N, motions) per unit; no motions without one."""
    if sector.rigid is None or not len(sector.rigid):
        return np.empty(0, int), np.ones(6), np.zeros((sector.nodes.size, 0))
    motions = {1: np.array([0, 1, 5]), -1: np.array([2, 3, 4]), 0: np.arange(6)}[parity]
    points = sector.nodes[sector.rigid]
    length = np.repeat([1.0, np.hypot(points[:, 0], points[:, 1]).max()], 3)
    moved = np.zeros((len(sector.nodes), 3, 6))
    moved[sector.rigid] = rigid_fields(points) / length
    return motions, length, moved.reshape(-1, 6)[:, motions]


def _patch_motions(sector: Sector) -> np.ndarray:
    """Displacement (3N, 6) of the rigid patch, orthonormal; (3N, 0) without one."""
    if sector.patch is None:
        return np.zeros((sector.nodes.size, 0))
    moved = np.zeros((len(sector.nodes), 3, 6))
    fields = rigid_fields(sector.nodes[sector.patch] - sector.nodes[sector.patch].mean(axis=0))
    moved[sector.patch] = np.linalg.qr(fields.reshape(-1, 6))[0].reshape(fields.shape)
    return moved.reshape(-1, 6)


def _split(owner: np.ndarray, sector: Sector) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns on the minus cut, on the plus cut in the same order, and inside; without those of rigid surfaces."""
    column = np.full(sector.nodes.size, -1)
    column[owner] = np.arange(len(owner))
    pairs = np.stack([(3 * cut[:, None] + np.arange(3)).ravel() for cut in (sector.cut_minus, sector.cut_plus)])
    minus, plus = column[pairs]
    if np.any((minus < 0) != (plus < 0)):
        raise MeshError("the two cut faces have different node order about mid-width")
    minus, plus = minus[minus >= 0], plus[plus >= 0]
    inside = np.setdiff1d(np.arange(len(owner)), np.concatenate([minus, plus]))
    held = [nodes for nodes in (sector.rigid, sector.patch) if nodes is not None]
    if not held:
        return minus, plus, inside
    elastic = ~np.isin(owner // 3, np.concatenate(held))
    return minus[elastic[minus]], plus[elastic[plus]], inside[elastic[inside]]


def _turn_plus(sector: Sector) -> sp.csr_array:
    """Nodal components from the coordinates with the plus cut's dofs turned into the frame of the minus cut."""
    angle = 2 * np.pi / sector.teeth
    c, s = np.cos(angle), np.sin(angle)
    x = 3 * sector.cut_plus
    diagonal = np.ones(sector.nodes.size)
    diagonal[x] = diagonal[x + 1] = c
    turn = sp.coo_array((np.full(len(x), s), (x + 1, x)), (sector.nodes.size,) * 2).tocsr()
    return sp.csr_array(sp.diags(diagonal) + turn - turn.T)


def _real_times_any(matrix: sp.csr_array | np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Real matrix times real or complex dense, without a complex copy of the matrix."""
    if not np.iscomplexobj(vectors):
        return matrix @ vectors
    return (matrix @ np.ascontiguousarray(vectors).view(float)).view(complex)
