"""Free bodies with z equal sectors, one sector at a time: every nodal diameter ν is a small system on the cut faces.

Displacements are written in the frame of each sector; those of harmonic ν are u_j = U exp(2πiνj/z) in sector j. With
the dofs of the plus cut turned by −2π/z into the frame of the minus cut, u_plus = exp(iθ) u_minus, θ = 2πν/z.
The interior is factorised once, real, with both cuts held, and condensed onto the cuts:
    S = K_BB − K_BI K_II⁻¹ K_IB,   S_ν = S_mm + S_pp + e^{iθ} S_mp + e^{−iθ} S_pm,
so that each harmonic costs a dense system of the size of one cut. S_ν is singular only for ν = 0 and 1, by the rigid
motions, which are known. A sector that is its own mirror image about mid-width (z → −z) splits once more, exactly,
into symmetric and antisymmetric fields; one of a helical gear is not and has one space of all fields. Source: Thomas,
Int. J. Numer. Meth. Eng. 14 (1979) 81 (cyclic symmetry).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.fem.coupling import rigid_modes
from gearfmu.fem.factor import Factor

_MATCH = 1e-7  # of the mesh's size: nodes that should coincide


@dataclass(frozen=True)
class Sector:
    """Finite-element model of one sector, in its own frame.

    nodes (N, 3), m; elements (E, 20); stiffness, mass (3N, 3N) csr; teeth z ≥ 3; cut_minus, cut_plus (c,): paired
    nodes. helical: no mirror at mid-width is looked for.
    """

    nodes: np.ndarray
    elements: np.ndarray
    stiffness: sp.csr_array
    mass: sp.csr_array
    teeth: int
    cut_minus: np.ndarray
    cut_plus: np.ndarray
    helical: bool = False


class SectorSpace:
    """The fields of one mirror parity on a sector, condensed onto the cuts (see the head of this file).

    parity : +1 symmetric about mid-width (u_x, u_y even, u_z odd in z), −1 antisymmetric, 0 for a sector without that
    symmetry.
    to_nodes : (3N, n) sparse with orthonormal columns; columns ordered interior, minus cut, plus cut.
    """

    def __init__(self, sector: Sector, mirror: np.ndarray, parity: int):
        self.parity, self.teeth = parity, sector.teeth
        basis, owner = _parity_basis(mirror, parity) if parity else _all_fields(sector)
        minus, plus, interior = _split(owner, sector)
        self.interior, self.cut = len(interior), len(minus)
        self.to_nodes = sp.csc_array(_turn_plus(sector) @ basis[:, np.concatenate([interior, minus, plus])])
        self.from_nodes = sp.csr_array(self.to_nodes.T)
        stiffness = sp.csr_array(self.from_nodes @ sector.stiffness @ self.to_nodes)
        self.mass_matrix = sp.csr_array(self.from_nodes @ sector.mass @ self.to_nodes)
        self.rigid = self.from_nodes @ rigid_modes(sector.nodes)
        inside, border = slice(0, self.interior), slice(self.interior, None)
        inner = owner[interior] // 3
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
    """One nodal diameter of one parity: a free body in complex coordinates (interior, minus cut), real for ν = 0, z/2.

    Quantities are those of one sector: φᴴ M φ of a vector is its mass product over one sector.
    rigid : (size, r) rigid motions of this harmonic, mass-normalised over one sector; r = 0 for ν ≥ 2.
    """

    def __init__(self, space: SectorSpace, nodal_diameter: int):
        self.space, self.nodal_diameter = space, nodal_diameter
        angle = 2 * np.pi * nodal_diameter / space.teeth
        self.is_real = nodal_diameter == 0 or 2 * nodal_diameter == space.teeth
        self.phase = float(round(np.cos(angle))) if self.is_real else complex(np.cos(angle), np.sin(angle))
        self.dtype = float if self.is_real else complex
        self.size = space.interior + space.cut
        self.rigid = self._rigid_motions()
        self._mass_rigid = self.mass(self.rigid)
        self.elastic = self.size - self.rigid.shape[1]

    def _rigid_motions(self) -> np.ndarray:
        r, nu = self.space.rigid, self.nodal_diameter
        if nu == 0:
            fields = r[:, [2, 5]]
        elif nu == 1:
            fields = np.stack([r[:, 0] + 1j * r[:, 1], r[:, 3] + 1j * r[:, 4]], axis=1)
        else:
            return np.zeros((self.size, 0), self.dtype)
        fields = fields[: self.size]
        fields = fields[:, np.linalg.norm(fields, axis=0) > 1e-9 * np.linalg.norm(r)]
        gram = fields.conj().T @ self.mass(fields)
        return sl.solve_triangular(np.linalg.cholesky(gram), fields.conj().T, lower=True).conj().T

    def reduce(self, sector_loads: np.ndarray) -> np.ndarray:
        """Loads on the sector's coordinates (interior, minus, plus) → loads on this harmonic's coordinates."""
        interior, cut = self.space.interior, self.space.cut
        loads = sector_loads[: interior + cut].astype(np.result_type(sector_loads, self.dtype))
        loads[interior:] += np.conj(self.phase) * sector_loads[interior + cut :]
        return loads

    def expand(self, vectors: np.ndarray) -> np.ndarray:
        """This harmonic's coordinates → the sector's coordinates (interior, minus, plus)."""
        return np.concatenate([vectors, self.phase * vectors[self.space.interior :]])

    def mass(self, vectors: np.ndarray) -> np.ndarray:
        """M v over one sector."""
        return self.reduce(_real_times_any(self.space.mass_matrix, self.expand(vectors)))

    @cached_property
    def _cut_solver(self) -> tuple[np.ndarray, np.ndarray]:
        """LU of S_ν; its rigid null space is filled up, which changes nothing for balanced loads."""
        cut, schur = self.space.cut, self.space.schur
        s = (
            schur[:cut, :cut]
            + schur[cut:, cut:]
            + self.phase * schur[:cut, cut:]
            + np.conj(self.phase) * schur[cut:, :cut]
        )
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
        on_cut = balanced[interior:] - carried[:cut] - np.conj(self.phase) * carried[cut:]
        moved = sl.cho_solve(self._cut_solver, on_cut)
        border = np.concatenate([moved, self.phase * moved])
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


def _split(owner: np.ndarray, sector: Sector) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns on the minus cut, on the plus cut in the same order, and inside."""
    column = np.full(sector.nodes.size, -1)
    column[owner] = np.arange(len(owner))
    pairs = np.stack([(3 * cut[:, None] + np.arange(3)).ravel() for cut in (sector.cut_minus, sector.cut_plus)])
    minus, plus = column[pairs]
    if np.any((minus < 0) != (plus < 0)):
        raise MeshError("the two cut faces have different node order about mid-width")
    minus, plus = minus[minus >= 0], plus[plus >= 0]
    return minus, plus, np.setdiff1d(np.arange(len(owner)), np.concatenate([minus, plus]))


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
