"""Modes of many nodal diameters from their approximations in a small space (`low_fields`): one step for all of them.

With approximate modes X, ω₀² and Y = C M X the modes are those of the span of X and Y (Rayleigh and Ritz, in K and M):
K Y = M X is known without the stiffness. The error of ω² is of the order of the square of what Y leaves undone. How
near X was is seen from C M x − x/ω₀²: where it is too far, block Lanczos goes on from X, and the space grows.
Source: Saad, Numerical methods for large eigenvalue problems, 2nd ed., 5.3 (subspace iteration with projection).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import scipy.linalg as sl

from gearfmu.fem.harmonic import Harmonic, flexibilities
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.low_fields import LowFields

_NEAR = 2e-3  # residual of approximations, relative to 1/ω², that one step takes to some 1e-4
_SOLVED = 1e-5  # residual of modes that are found by Lanczos
_BESIDE = 3  # modes beyond those wanted that are carried along
_SMALL = 1e-11  # energy of a step, relative to that of the mode, that changes nothing any more
_DEPENDENT = 1e-6  # energy of a combination of steps at which it is one of the others
_COLUMNS = 128  # real columns that the interior answers at once

Found = tuple[Harmonic, np.ndarray, np.ndarray]


def refined_modes(low: LowFields, wanted: Mapping[int, int]) -> Iterator[Found]:
    """The lowest elastic modes of nodal diameters, how many of each says `wanted`: harmonic, ω² (k,) ascending,
    rad²/s², and mass-normalised shapes (size, k). Raises ModesError as `lowest_modes`."""
    batch: list[Harmonic] = []
    columns = 0
    for nu in sorted(wanted, key=_halving):
        count = wanted[nu]
        batch.append(low.space.harmonic(nu))
        columns += (1 if batch[-1].is_real else 2) * (count + _BESIDE)
        if columns > _COLUMNS - 2 * (count + _BESIDE):
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
