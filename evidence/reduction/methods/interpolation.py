"""Interpolation between bodies reduced at parameter values (web thickness, rim, material): the parametric way.

Bodies of one mesh topology, any method each. Their bases V_i are expressed in one reference R, the dominant directions
of all of them, T_i = (Rᵀ M̄ V_i)⁻¹, so that equal coordinates mean nearly equal displacements; then the matrices

    K*(p) = Σ w_i(p) T_iᵀ K_i T_i,   M*(p) = Σ w_i(p) T_iᵀ T_i,   B*(p) = Σ w_i(p) B_i T_i

and those of rigid motion and static compliance are interpolated entry by entry with Lagrange weights. Matched: each
sample exactly (a change of coordinates moves no transfer function); between them the error falls with the samples as
fast as that of a polynomial, as long as the bases span nearly the same space. Theory, eq. 28. Source: Panzer,
Mohring, Eid & Lohmann, at – Automatisierungstechnik 58 (2010) 475; compare Amsallem & Farhat, SIAM J. Sci. Comput. 33
(2011) 2169.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp

from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Basis
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.oscillators import Oscillators, oscillators

_ALIGNED = 0.3  # least singular value of RᵀM̄V_i: below it a basis has a direction the others know little of


@dataclass(frozen=True)
class Sample:
    """A body reduced at one parameter value."""

    value: float
    body: FullOrder
    basis: Basis


@dataclass(frozen=True)
class ParametricBody:
    """Reduced matrices of all samples in common coordinates.

    values (s,) ascending; stiffness, mass (s, n, n); rows (s, m, n); models : the samples' own oscillators.
    """

    values: np.ndarray
    stiffness: np.ndarray
    mass: np.ndarray
    rows: np.ndarray
    models: tuple[Oscillators, ...]

    def at(self, value: float) -> Oscillators:
        """The body at a parameter value between the samples. Raises BodyError outside, or where the interpolated
        matrices are no longer positive definite (samples too far apart)."""
        if not self.values[0] <= value <= self.values[-1]:
            raise BodyError(f"parameter {value:g} lies outside the samples, {self.values[0]:g} … {self.values[-1]:g}")
        weights = _lagrange(self.values, value)
        stiffness, mass, rows = (np.tensordot(weights, part, 1) for part in (self.stiffness, self.mass, self.rows))
        try:
            squared, shapes = sl.eigh(stiffness, mass)
        except np.linalg.LinAlgError as error:
            raise BodyError(f"parameter {value:g}: the samples lie too far apart to interpolate; add one") from error
        if not squared.min() > 0:
            raise BodyError(f"parameter {value:g}: the samples lie too far apart to interpolate; add one")
        rigid_rows, rigid_mass, static, damping, scales = (
            np.tensordot(weights, np.stack([getattr(m, name) for m in self.models]), 1)
            for name in ("rigid_rows", "rigid_mass", "static", "damping_ratio", "scales")
        )
        return replace(
            self.models[0],
            method=f"interpolated {self.models[0].method}",
            omega=np.sqrt(squared),
            damping_ratio=damping,
            rows=rows @ shapes,
            scales=scales,
            rigid_rows=rigid_rows,
            rigid_mass=rigid_mass,
            static=static,
        )


def interpolate(samples: Sequence[Sample], damping_ratio: float) -> ParametricBody:
    """Common coordinates for bodies reduced at several parameter values (two or more, all different).

    Raises BodyError when meshes, interfaces or sizes differ or when the bases span too different spaces."""
    samples = sorted(samples, key=lambda sample: sample.value)
    if problems := _problems(samples):
        raise BodyError("; ".join(problems))
    mass = sum(sample.body.mass for sample in samples) / len(samples)
    turns = _alignment([sample.basis.vectors for sample in samples], mass)
    models = tuple(oscillators(s.body, s.basis, damping_ratio) for s in samples)
    stiffness, masses, rows = [], [], []
    for sample, turn in zip(samples, turns, strict=True):
        projected = sample.basis.vectors.T @ (sample.body.stiffness @ sample.basis.vectors)
        stiffness.append(turn.T @ projected @ turn)
        masses.append(turn.T @ turn)
        rows.append(sample.body.rows() @ sample.basis.vectors @ turn)
    values = np.array([sample.value for sample in samples])
    return ParametricBody(values, np.stack(stiffness), np.stack(masses), np.stack(rows), models)


def _problems(samples: Sequence[Sample]) -> list[str]:
    first, values = samples[0], [sample.value for sample in samples]
    problems = [] if len(samples) > 1 else ["interpolation needs two samples or more"]
    if len(set(values)) < len(values):
        problems.append("two samples have the same parameter value")
    for s in samples[1:]:
        at = f"sample at {s.value:g}"
        if s.body.size != first.body.size or not np.array_equal(s.body.cells, first.body.cells):
            problems.append(f"{at}: its mesh has other elements than the first: one topology, nodes moved, is needed")
        if [i.name for i in s.body.interfaces] != [i.name for i in first.body.interfaces]:
            problems.append(f"{at}: other interfaces than the first")
        if s.basis.size != first.basis.size:
            problems.append(f"{at}: {s.basis.size} vectors, the first {first.basis.size}: reduce to one number")
    return problems


def _alignment(bases: list[np.ndarray], mass: sp.csr_array) -> list[np.ndarray]:
    """T_i = (Rᵀ M̄ V_i)⁻¹ with R the dominant directions of all bases, orthonormal in M̄."""
    count = bases[0].shape[1]
    together = np.hstack(bases)
    strength, turn = np.linalg.eigh(together.T @ (mass @ together))
    chosen = slice(-count, None)
    common = together @ (turn[:, chosen] / np.sqrt(strength[chosen]))
    overlaps = [common.T @ (mass @ basis) for basis in bases]
    for overlap in overlaps:
        if np.linalg.svd(overlap, compute_uv=False)[-1] < _ALIGNED:
            raise BodyError("the bases of the samples span too different spaces to interpolate; take samples closer")
    return [np.linalg.inv(overlap) for overlap in overlaps]


def _lagrange(values: np.ndarray, at: float) -> np.ndarray:
    """Weights w_i with Σ w_i g(p_i) the interpolating polynomial at `at`."""
    weights = np.ones(len(values))
    for i, own in enumerate(values):
        others = np.delete(values, i)
        weights[i] = np.prod((at - others) / (own - others))
    return weights
