"""A real space of sector fields that holds the modes of a few nodal diameters, and starts the search for all others.

Modes of neighbouring nodal diameters differ smoothly. A mode found is split into the displacement of its cuts with the
static response of the interior, and a remainder that leaves both cuts at rest; real and imaginary parts of both join
the space, each cut free to move alone. Another nodal diameter joins the cuts by its own phase and is a dense problem
of a few hundred unknowns, whose modes start block Lanczos on the finite elements (`lanczos`). Source: Hurty, AIAA J. 3
(1965) 678 (components with static responses of their borders).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as sl

from gearfmu.fem.cyclic import SectorSpace
from gearfmu.fem.harmonic import Harmonic, real_times_any

_NEW = 1e-4  # size of the new part of a block of fields, relative to its largest, from which on it joins
_COLUMNS = 64


class LowFields:
    """Fields of one space, given by their interior (n, f): at rest on both cuts first, then responses to displacements
    of the minus cut, as many of the plus cut, and of the rigid surface."""

    def __init__(self, space: SectorSpace):
        self.space = space
        self._cuts = np.zeros((space.cut, 0))
        surface = self._response(np.eye(len(space.factor.schur))[:, 2 * space.cut :])
        self._groups = [np.zeros((space.interior, 0))] * 3 + [surface]

    def add(self, harmonic: Harmonic, shapes: np.ndarray) -> None:
        """Take in fields (size, k) of a nodal diameter."""
        space, cut = self.space, self.space.cut
        border = harmonic.expand_border(shapes[space.interior :])
        fresh = _fresh(self._cuts, _parts(border[:cut]))
        for side in (0, 1):
            moved = np.zeros((len(border), fresh.shape[1]))
            moved[side * cut : (side + 1) * cut] = fresh
            self._groups[1 + side] = np.hstack([self._groups[1 + side], self._response(moved)])
        self._cuts = np.hstack([self._cuts, fresh])
        rest = shapes[: space.interior].copy()
        of_cuts = (real_times_any(self._cuts.T, side) for side in (border[:cut], border[cut : 2 * cut]))
        for group, known in zip(self._groups[1:], [*of_cuts, border[2 * cut :]], strict=True):
            rest -= real_times_any(group, known)
        self._groups[0] = np.hstack([self._groups[0], _fresh(self._groups[0], _parts(rest))])
        self.__dict__.pop("_matrices", None)

    def modes(self, harmonic: Harmonic, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Approximate ω² (k,) of the lowest elastic modes of a nodal diameter, ascending, from above, and their
        coordinates for `fields`, (m, k); fewer than `count` where the space is small."""
        join = self._join(harmonic)
        stiffness, mass = (join.conj().T @ matrix @ join for matrix in self._matrices)
        rigid = harmonic.rigid.shape[1]
        last = min(rigid + count, len(mass)) - 1
        squared, vectors = sl.eigh(stiffness, mass, subset_by_index=(0, last), check_finite=False)
        return squared[rigid:], vectors[:, rigid:]

    def fields(self, harmonic: Harmonic, coordinates: np.ndarray) -> np.ndarray:
        """Displacement in the harmonic's coordinates without rigid motion, (size, k)."""
        joined = self._join(harmonic) @ coordinates
        ends = np.cumsum([group.shape[1] for group in self._groups])[:-1]
        parts = zip(self._groups, np.split(joined, ends), strict=True)
        inner = sum(real_times_any(group, amplitude) for group, amplitude in parts)
        first, count = self._groups[0].shape[1], self._cuts.shape[1]
        cut = real_times_any(self._cuts, coordinates[first : first + count])
        return harmonic.gauge(np.concatenate([inner, cut, coordinates[first + count :]]))

    def _response(self, border: np.ndarray) -> np.ndarray:
        return self.space.factor.backward(np.zeros((self.space.interior, border.shape[1])), border)

    def _join(self, harmonic: Harmonic) -> np.ndarray:
        """(at rest, displacement of a cut, amplitudes of the rigid surface) → columns of all groups."""
        one = np.eye(self._cuts.shape[1])
        at_rest = np.eye(self._groups[0].shape[1])
        return sl.block_diag(at_rest, np.vstack([one, harmonic.phase * one]), harmonic.surface)

    @cached_property
    def _matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and mass of all fields."""
        space, count = self.space, self._groups[0].shape[1]
        border = sl.block_diag(self._cuts, self._cuts, np.eye(len(space.motions)))
        fields = np.zeros((space.interior + len(border), count + border.shape[1]))
        np.concatenate(self._groups, axis=1, out=fields[: space.interior])
        fields[space.interior :, count:] = border
        mass = np.empty((fields.shape[1],) * 2)
        stiffness = np.zeros_like(mass)
        for first in range(0, len(mass), _COLUMNS):
            columns = slice(first, first + _COLUMNS)
            mass[:, columns] = fields.T @ (space.mass_matrix @ fields[:, columns])
            resting = slice(first, min(first + _COLUMNS, count))
            stiffness[:count, resting] = (space.stiffness @ fields[:, resting]).T.dot(fields[:, :count]).T
        stiffness[count:, count:] = border.T @ space.factor.schur @ border
        return stiffness, 0.5 * (mass + mass.T)


def _parts(fields: np.ndarray) -> np.ndarray:
    return np.hstack([fields.real, fields.imag]) if np.iscomplexobj(fields) else fields


def _fresh(known: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Orthonormal columns that with the orthonormal `known` span the fields."""
    size = np.linalg.norm(fields, axis=0).max(initial=0.0)
    for _ in range(2):
        fields = fields - known @ (known.T @ fields)
    left, values, _ = np.linalg.svd(fields, full_matrices=False)
    return left[:, values > _NEW * size]
