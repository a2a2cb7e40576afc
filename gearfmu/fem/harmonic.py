"""One nodal diameter ν of a free body with z equal sectors: a small system on the cut faces (`cyclic`).

The interior of the sector is factorised once, real, with both cuts held, and condensed onto the cuts:
    S = K_BB − K_BI K_II⁻¹ K_IB,   S_ν = S_mm + S_pp + e^{iθ} S_mp + e^{−iθ} S_pm,
so that each harmonic costs a dense system of the size of one cut. S_ν is singular only for ν = 0 and 1, by the rigid
motions, which are known. Source: Thomas, Int. J. Numer. Meth. Eng. 14 (1979) 81 (cyclic symmetry).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as sl

if TYPE_CHECKING:
    from gearfmu.fem.cyclic import SectorSpace

_RIGID = {0: np.eye(6)[:, [2, 5]], 1: np.kron(np.eye(2), [[1.0], [1j], [0.0]])}  # of x, y, z, about x, y, z


class Harmonic:
    """One nodal diameter of one parity: a free body in complex coordinates (interior, minus cut, amplitudes of the
    rigid surface), real for ν = 0, z/2.

    Quantities are those of one sector: φᴴ M φ of a vector is its mass product over one sector.
    rigid : (size, r) rigid motions of this harmonic, mass-normalised over one sector; r = 0 for ν ≥ 2. rigid_parts :
    (6, r) the same as combinations of the rigid motions of the sector. surface (motions of the space, amplitudes):
    those motions of the rigid surface that belong to this harmonic. weight : 2 where it stands for ν and −ν, else 1.
    """

    def __init__(self, space: SectorSpace, nodal_diameter: int):
        self.space, self.nodal_diameter = space, nodal_diameter
        angle = 2 * np.pi * nodal_diameter / space.teeth
        self.is_real = nodal_diameter == 0 or 2 * nodal_diameter == space.teeth
        self.phase = float(round(np.cos(angle))) if self.is_real else complex(np.cos(angle), np.sin(angle))
        self.dtype = float if self.is_real else complex
        self.weight = 1 if self.is_real else 2
        self.surface = self._surface_motions()
        self.size = space.interior + space.cut + self.surface.shape[1]
        self.rigid_parts, self.rigid = self._rigid_motions()
        self._mass_rigid = self.mass(self.rigid)
        self.elastic = self.size - self.rigid.shape[1]

    def _surface_motions(self) -> np.ndarray:
        """Motions of the rigid surface that belong to this harmonic, as columns: (motions of the space, amplitudes)."""
        parts = _RIGID.get(self.nodal_diameter, np.zeros((6, 0)))
        mine = parts[self.space.motions][:, (np.delete(parts, self.space.motions, axis=0) == 0).all(axis=0)]
        return mine.astype(self.dtype)

    def _rigid_motions(self) -> tuple[np.ndarray, np.ndarray]:
        r, nu = self.space.rigid, self.nodal_diameter
        if nu > 1:
            return np.zeros((6, 0), self.dtype), np.zeros((self.size, 0), self.dtype)
        parts = _RIGID[nu]
        fields = self._without_plus(r @ parts)
        kept = np.linalg.norm(fields, axis=0) > 1e-9 * np.linalg.norm(r)
        parts, fields = parts[:, kept], fields[:, kept]
        lower = np.linalg.cholesky(fields.conj().T @ self.mass(fields))
        parts, fields = (sl.solve_triangular(lower, a.conj().T, lower=True).conj().T for a in (parts, fields))
        return parts, fields

    def _without_plus(self, fields: np.ndarray) -> np.ndarray:
        """Fields of this harmonic in the sector's coordinates → in this harmonic's."""
        interior, cut = self.space.interior, self.space.cut
        kept = fields[: interior + cut]
        if not self.surface.shape[1]:
            return kept
        return np.concatenate([kept, np.linalg.pinv(self.surface) @ fields[interior + 2 * cut :]])

    def reduce(self, sector_loads: np.ndarray) -> np.ndarray:
        """Loads on the sector's coordinates (interior, minus, plus, rigid surface) → on this harmonic's coordinates."""
        interior = self.space.interior
        border = self.reduce_border(sector_loads[interior:])
        return np.concatenate([sector_loads[:interior].astype(border.dtype, copy=False), border])

    def reduce_border(self, border: np.ndarray) -> np.ndarray:
        """Loads on (minus, plus, rigid surface) → on (minus, amplitudes)."""
        cut = self.space.cut
        loads = border[:cut] + np.conj(self.phase) * border[cut : 2 * cut]
        if not self.surface.shape[1]:
            return loads
        return np.concatenate([loads, self.surface.conj().T @ border[2 * cut :]])

    def expand(self, vectors: np.ndarray) -> np.ndarray:
        """This harmonic's coordinates → the sector's coordinates (interior, minus, plus, rigid surface)."""
        interior = self.space.interior
        return np.concatenate([vectors[:interior], self.expand_border(vectors[interior:])])

    def expand_border(self, border: np.ndarray) -> np.ndarray:
        """(minus, amplitudes) → (minus, plus, rigid surface)."""
        cut = border[: self.space.cut]
        both = [cut, self.phase * cut]
        if len(self.space.motions):
            both.append(self.surface @ border[self.space.cut :])
        return np.concatenate(both)

    def mass(self, vectors: np.ndarray) -> np.ndarray:
        """M v over one sector."""
        return self.reduce(real_times_any(self.space.mass_matrix, self.expand(vectors)))

    @cached_property
    def _cut_solver(self) -> tuple[np.ndarray, bool]:
        """Factor of S_ν; its rigid null space is filled up, which changes nothing for balanced loads."""
        s = self.reduce_border(self.reduce_border(self.space.factor.schur).conj().T)
        rigid = self.rigid[self.space.interior :]
        if rigid.shape[1]:
            rigid = np.linalg.qr(rigid)[0]
            s = s + np.abs(s.diagonal()).mean() * (rigid @ rigid.conj().T)
        return sl.cho_factor(0.5 * (s + s.conj().T), overwrite_a=True, check_finite=False)

    def solve_cut(self, loads: np.ndarray) -> np.ndarray:
        """S_ν⁻¹ of balanced loads on (minus, amplitudes), (c, k)."""
        return sl.cho_solve(self._cut_solver, loads, check_finite=False)

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

    def flexibility(self, loads: np.ndarray) -> np.ndarray:
        """C_ν f = P K_ν⁺ Pᴴ f."""
        return flexibilities([self], [loads])[0]


def flexibilities(harmonics: Sequence[Harmonic], loads: Sequence[np.ndarray]) -> list[np.ndarray]:
    """`Harmonic.flexibility` of several nodal diameters of one space, each with its loads: the interior answers to all
    of them at once, which takes half the time where each has few."""
    factor, interior = harmonics[0].space.factor, harmonics[0].space.interior
    balanced = [harmonic.balance(f) for harmonic, f in zip(harmonics, loads, strict=True)]
    inner, passed = factor.forward(_side_by_side([f[:interior] for f in balanced]))
    moved = [
        harmonic.solve_cut(f[interior:] + harmonic.reduce_border(here))
        for harmonic, f, here in zip(harmonics, balanced, _apart(passed, balanced), strict=True)
    ]
    border = [harmonic.expand_border(cut) for harmonic, cut in zip(harmonics, moved, strict=True)]
    inside = _apart(factor.backward(inner, _side_by_side(border)), moved)
    return [h.gauge(np.concatenate([f, cut])) for h, f, cut in zip(harmonics, inside, moved, strict=True)]


def _side_by_side(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Real and complex columns as real ones, of a complex column real and imaginary part."""
    return np.hstack([np.ascontiguousarray(part).view(float) for part in parts])


def _apart(columns: np.ndarray, like: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The reverse: columns of the kind and number of each of `like`."""
    widths = [part.shape[1] * (2 if np.iscomplexobj(part) else 1) for part in like]
    found = np.split(columns, np.cumsum(widths)[:-1], axis=1)
    return [np.ascontiguousarray(part).view(other.dtype) for part, other in zip(found, like, strict=True)]


def real_times_any(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Real matrix times real or complex dense, without a complex copy of the matrix."""
    if not np.iscomplexobj(vectors):
        return matrix @ vectors
    return (matrix @ np.ascontiguousarray(vectors).view(float)).view(complex)
