"""Snapshot (POD) basis: the directions in which the body moved in a short training run, weighted in M.

The n left singular vectors of M^½ X, X the elastic displacements at all instants: of all bases of n vectors they lose
least of the run's mean kinetic measure ∫ uᵀMu dt. Nothing is matched elsewhere: a basis is as good as its training.
Training run when none is given: the full model from rest by Newmark's average acceleration, a few load cases in which
every interface row carries its own sum of lines in the band (fixed random phases). Rigid motion is left out (balanced
loads). Theory, eq. 25. Source: Sirovich, Quart. Appl. Math. 45 (1987) 561; Newmark, ASCE J. Eng. Mech. 85 (1959) 67;
paper section 2 and its reference [10].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.errors import BodyError
from gearfmu.reduction.basis import Basis, Growing, Size
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder

_CASES = 8
_SURPLUS = 2.5  # snapshots per basis vector
_STEPS_PER_PERIOD = 12  # of the upper end of the band
_CHUNK = 64


@dataclass(frozen=True)
class Training:
    """A training run: loads (steps, m, cases), N and N·m at the interface rows, on instants `step` (s) apart."""

    loads: np.ndarray
    step: float


def reduce(body: FullOrder, size: Size) -> Basis:
    """POD basis of a training run of the default kind."""
    return from_snapshots(body, training_run(body, default_training(body, size)), size.count)


def default_training(body: FullOrder, size: Size) -> Training:
    """Lines in the band on every interface row, enough instants for `size.count` vectors."""
    rng, rows = np.random.default_rng(4), body.rows().shape[0]
    cases = min(_CASES, rows)
    step = 1 / (_STEPS_PER_PERIOD * size.band[1])
    steps = int(np.ceil(_SURPLUS * size.count / cases)) + 2 * _STEPS_PER_PERIOD
    time = step * np.arange(1, steps + 1)
    lines = rng.uniform(max(size.band[0], 0.02 * size.band[1]), size.band[1], (1, rows, cases, 6))
    phase = rng.uniform(0, 2 * np.pi, lines.shape)
    loads = np.sin(2 * np.pi * lines * time[:, None, None, None] + phase).sum(axis=-1)
    return Training(loads / body.scales()[None, :, None], step)


def training_run(body: FullOrder, training: Training) -> np.ndarray:
    """Elastic displacements (N, steps · cases) of the full model from rest, average acceleration, undamped."""
    space, inputs = elastic(body), body.rows().T.toarray()
    h, (steps, _, cases) = training.step, training.loads.shape
    solver = space.shifted(-4 / h**2)
    loads = space.balance(inputs)
    u, v, a = (np.zeros((body.size, cases)) for _ in range(3))
    snapshots = np.empty((body.size, steps * cases), order="F")
    for k in range(steps):
        predicted = 4 / h**2 * u + 4 / h * v + a
        new = solver.solve(loads @ training.loads[k] + space.mass(predicted))
        a = 4 / h**2 * new - predicted
        v = 2 / h * (new - u) - v
        u = new
        snapshots[:, k * cases : (k + 1) * cases] = space.gauge(u)
    return snapshots


def from_snapshots(body: FullOrder, snapshots: np.ndarray, count: int) -> Basis:
    """POD basis of `count` vectors from displacements (N, k); fewer when the run shows fewer directions.

    Raises BodyError when the snapshots do not fit the body."""
    if snapshots.ndim != 2 or len(snapshots) != body.size:
        raise BodyError(f"{body.name}: snapshots have shape {snapshots.shape}, expected ({body.size}, number)")
    space = elastic(body)
    snapshots = space.gauge(snapshots)
    energy, turn = np.linalg.eigh(snapshots.T @ space.mass(snapshots))
    kept = np.flatnonzero(energy > 1e-15 * energy[-1])[::-1][:count]
    basis = Growing(space)
    for first in range(0, len(kept), _CHUNK):
        columns = kept[first : first + _CHUNK]
        basis.add(snapshots @ (turn[:, columns] / np.sqrt(energy[columns])))
    share = float(energy[kept].sum() / energy[energy > 0].sum())
    return Basis("snapshots", np.array(basis.vectors), {"snapshots": snapshots.shape[1], "captured": share})
