"""A real space of sector fields that holds the modes of a few nodal diameters, and starts the search for all others;
modes of many nodal diameters from their approximations in it, by one step for all of them.

Modes of neighbouring nodal diameters differ smoothly. A mode found is split into the displacement of its cuts with the
static response of the interior, and a remainder that leaves both cuts at rest; real and imaginary parts of both join
the space, each cut free to move alone. Another nodal diameter joins the cuts by its own phase and is a dense problem
of a few hundred unknowns, whose modes start block Lanczos on the finite elements (`lanczos`). Source: Hurty, AIAA J. 3
(1965) 678 (components with static responses of their borders).

With approximate modes X, ω₀² and Y = C M X the modes are those of the span of X and Y (Rayleigh and Ritz, in K and M):
K Y = M X is known without the stiffness. The error of ω² is of the order of the square of what Y leaves undone. How
near X was is seen from C M x − x/ω₀²: where it is too far, block Lanczos goes on from X, and the space grows.
Source: Saad, Numerical methods for large eigenvalue problems, 2nd ed., 5.3 (subspace iteration with projection).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy.linalg as sl

from gearfmu.fem.cyclic import SectorSpace
from gearfmu.fem.harmonic import Harmonic, flexibilities, real_times_any
from gearfmu.fem.lanczos import lowest_modes

_NEW = 1e-4  # size of the new part of a block of fields, relative to its largest, from which on it joins
_COLUMNS = 64
_NEAR = 2e-3  # residual of approximations, relative to 1/ω², that one step takes to some 1e-4
_SOLVED = 1e-5  # residual of modes that are found by Lanczos
_BESIDE = 3  # modes beyond those wanted that are carried along
_SMALL = 1e-11  # energy of a step, relative to that of the mode, that changes nothing any more
_DEPENDENT = 1e-6  # energy of a combination of steps at which it is one of the others
_ANSWERED = 128  # real columns that the interior answers at once

Found = tuple[Harmonic, np.ndarray, np.ndarray]


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


def refined_modes(low: LowFields, wanted: Mapping[int, int]) -> Iterator[Found]:
    """The lowest elastic modes of nodal diameters, how many of each says `wanted`: harmonic, ω² (k,) ascending,
    rad²/s², and mass-normalised shapes (size, k). Raises ModesError as `lowest_modes`."""
    batch: list[Harmonic] = []
    columns = 0
    for nu in sorted(wanted, key=_halving):
        count = wanted[nu]
        batch.append(low.space.harmonic(nu))
        columns += (1 if batch[-1].is_real else 2) * (count + _BESIDE)
        if columns > _ANSWERED - 2 * (count + _BESIDE):
            yield from _refined(low, batch, wanted)
            batch, columns = [], 0
    yield from _refined(low, batch, wanted)


def _halving(number: int) -> int:
    """Place in an order that halves what is between those before: the space grows evenly where it is too small."""
    return int(f"{number:016b}"[::-1], 2)


def _refined(low: LowFields, harmonics: Sequence[Harmonic], wanted: Mapping[int, int]) -> Iterator[Found]:
    near: list[tuple[Harmonic, np.ndarray, np.ndarray]] = []
    for harmonic in harmonics:
        count = wanted[harmonic.nodal_diameter]
        squared, coordinates = low.modes(harmonic, count + _BESIDE)
        if len(squared) < count + _BESIDE:  # a body of few unknowns
            yield harmonic, *lowest_modes(harmonic, count, _SOLVED)
        else:
            near.append((harmonic, squared, low.fields(harmonic, coordinates)))
    if not near:
        return
    inertia = [harmonic.mass(x) for harmonic, _, x in near]
    answers = flexibilities([harmonic for harmonic, _, _ in near], inertia)
    for (harmonic, squared, x), mx, y in zip(near, inertia, answers, strict=True):
        count = wanted[harmonic.nodal_diameter]
        step = y * squared - x
        inertia_step = harmonic.mass(step)
        far = np.sqrt(np.abs(np.einsum("ij,ij->j", step.conj(), inertia_step)))
        if far[:count].max() > _NEAR:
            found, shapes = lowest_modes(harmonic, count, _SOLVED, start=x)
            low.add(harmonic, shapes)
            yield harmonic, found, shapes
        else:
            found, turn = _ritz((x, mx, squared), (step, inertia_step))
            shapes = x @ turn[: x.shape[1]] + step @ turn[x.shape[1] :]
            yield harmonic, found[:count], shapes[:, :count]


def _ritz(
    first: tuple[np.ndarray, np.ndarray, np.ndarray], step: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Ritz values and coefficients of x and of the steps d = y ω₀² − x: first = x, M x, ω₀²; step = d, M d.

    K y = M x, so that xᴴ K d = xᴴ M x ω₀² − xᴴ K x and dᴴ K d follow; xᴴ K x is diagonal, ω₀² by its making."""
    (x, mx, squared), (d, md) = first, step
    own_mass, own = x.conj().T @ mx, np.diag(squared)
    mixed = own_mass * squared - own
    other = ((d + x).conj().T @ mx) * squared - mixed - mixed.conj().T - own
    steps = _independent(0.5 * (other + other.conj().T), squared)
    stiffness = _joined(own, mixed @ steps, steps.conj().T @ other @ steps)
    mass = _joined(own_mass, (x.conj().T @ md) @ steps, steps.conj().T @ (d.conj().T @ md) @ steps)
    inverse, turn = sl.eigh(mass, stiffness, check_finite=False)
    inverse, turn = inverse[::-1], turn[:, ::-1]
    turn = turn / np.sqrt(np.maximum(inverse, np.finfo(float).tiny))
    return 1 / inverse, np.concatenate([turn[: len(squared)], steps @ turn[len(squared) :]])


def _independent(stiffness: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """Combinations of steps that are orthonormal in stiffness, without steps that are small beside what they correct
    (ω₀²) and without combinations that vanish."""
    energy = stiffness.diagonal().real
    kept = np.flatnonzero(energy > _SMALL * squared)
    scale = 1 / np.sqrt(energy[kept])
    values, turn = np.linalg.eigh(stiffness[np.ix_(kept, kept)] * np.multiply.outer(scale, scale))
    there = values > _DEPENDENT
    steps = np.zeros((len(squared), int(there.sum())), stiffness.dtype)
    steps[kept] = scale[:, None] * turn[:, there] / np.sqrt(values[there])
    return steps


def _joined(own: np.ndarray, mixed: np.ndarray, other: np.ndarray) -> np.ndarray:
    whole = np.block([[own, mixed], [mixed.conj().T, other]])
    return 0.5 * (whole + whole.conj().T)
