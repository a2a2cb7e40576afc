"""Free bodies with z equal sectors, one sector at a time: every nodal diameter ν is a small system on the cut faces.

Displacements are written in the frame of each sector; those of harmonic ν are u_j = U exp(2πiνj/z) in sector j. With
the dofs of the plus cut turned by −2π/z into the frame of the minus cut, u_plus = exp(iθ) u_minus, θ = 2πν/z.
The interior is factorised once, real, with both cuts held, and condensed onto the cuts (`harmonic`).
A sector that is its own mirror image about mid-width (z → −z) splits once more, exactly, into symmetric and
antisymmetric fields; one of a helical gear is not and has one space of all fields. Source: Thomas, Int. J. Numer. Meth.
Eng. 14 (1979) 81 (cyclic symmetry).

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
import scipy.sparse as sp
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.fem.coupling import rigid_fields, rigid_modes
from gearfmu.fem.factor import CondensedFactor
from gearfmu.fem.harmonic import Harmonic
from gearfmu.geometry.plane import about_z

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
        basis, owner = _parity_basis(mirror, parity)
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
        inner = owner[interior] // 3
        if sector.patch is not None:
            mirror = mirror.copy()
            mirror[sector.patch] = first = sector.patch.min()  # stands for all of them
            inner = np.concatenate([inner, np.full(6, first)])
        self.stiffness = stiffness
        self._inner = _cells(sector.elements, mirror, inner), inner

    @cached_property
    def factor(self) -> CondensedFactor:
        """Of the interior, condensed onto the cuts; made when it is asked for, so that the sector can be gone by
        then."""
        return CondensedFactor(self.stiffness, *self._inner)

    def harmonic(self, nodal_diameter: int) -> Harmonic:
        """The body restricted to one nodal diameter 0 ≤ ν ≤ z/2."""
        return Harmonic(self, nodal_diameter)


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
    """Orthonormal fields of one parity, one per degree of freedom of the nodes at z ≥ 0, and their owner dofs; of
    parity 0 all fields."""
    if not parity:
        return sp.csc_array(sp.identity(3 * len(mirror))), np.arange(3 * len(mirror))
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


def _cells(elements: np.ndarray, mirror: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Elements as nodes of the mirrored half, without the nodes that are not among `kept` (−1)."""
    first = np.minimum(np.arange(len(mirror)), mirror)
    present = np.zeros(len(mirror), bool)
    present[kept] = True
    folded = np.sort(first[elements], axis=1)
    folded = np.unique(folded, axis=0)
    return np.where(present[folded], folded, -1)


def _check_cuts(sector: Sector) -> None:
    if len(sector.cut_minus) != len(sector.cut_plus):
        raise MeshError(f"cut faces have {len(sector.cut_minus)} and {len(sector.cut_plus)} nodes; they must match")
    turn = about_z(2 * np.pi / sector.teeth)
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
