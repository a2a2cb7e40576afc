"""Modes of many nodal diameters from a small space against block Lanczos of each; condensation within the factor."""

from __future__ import annotations

import numpy as np
import pytest
from blocks import STEEL, ring
from small_gear import BETA, coarse

from gearfmu.fem import hex20, low_fields
from gearfmu.fem.factor import CondensedFactor
from gearfmu.fem.harmonic import flexibilities
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.low_fields import LowFields

COUNT = 6


def space_of(samples: tuple[int, ...]) -> LowFields:
    """The space of the modes of some of the seven nodal diameters of a small helical gear."""
    (space,) = coarse(BETA).spaces
    low = LowFields(space)
    for nu in samples:
        low.add(space.harmonic(nu), lowest_modes(space.harmonic(nu), COUNT + 6, 1e-4)[1])
    return low


@pytest.mark.parametrize(
    ("near", "samples", "error"),
    [(low_fields._NEAR, (0, 6), 1e-7), (0.0, (0, 3, 6), 1e-9), (1.0, (0, 3, 6), 1e-3)],
    ids=["from a poor space", "always Lanczos", "one step alone"],
)
def test_modes_are_those_of_each_nodal_diameter(
    near: float, samples: tuple[int, ...], error: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    low = space_of(samples)
    monkeypatch.setattr(low_fields, "_NEAR", near)
    found = {h.nodal_diameter: (h, s, x) for h, s, x in low_fields.refined_modes(low, dict.fromkeys(range(7), COUNT))}
    assert sorted(found) == list(range(7))
    for harmonic, squared, shapes in found.values():
        exact, _ = lowest_modes(harmonic, COUNT)
        assert np.allclose(squared, exact, rtol=error)
        assert np.all(squared > exact * (1 - 1e-8))
        assert np.allclose(shapes.conj().T @ harmonic.mass(shapes), np.eye(COUNT), atol=1e-7)


def test_the_space_gives_bounds_from_above_and_holds_what_it_was_given() -> None:
    low = space_of((0, 3, 6))
    for nu in range(7):
        harmonic = low.space.harmonic(nu)
        exact, near = lowest_modes(harmonic, COUNT)[0], low.modes(harmonic, COUNT)[0]
        assert np.all(near > exact * (1 - 1e-9))
        if nu in (0, 3, 6):
            assert np.allclose(near, exact, rtol=1e-4)


def test_loads_of_several_nodal_diameters_are_answered_at_once_as_one_by_one() -> None:
    (space,) = coarse(BETA).spaces
    harmonics = [space.harmonic(nu) for nu in (0, 1, 3, 6)]
    rng = np.random.default_rng(0)
    loads = [rng.standard_normal((h.size, 2)).astype(h.dtype) for h in harmonics]
    for harmonic, load, answer in zip(harmonics, loads, flexibilities(harmonics, loads), strict=True):
        alone = harmonic.flexibility(load)
        assert np.abs(answer - alone).max() < 1e-12 * np.abs(alone).max()
        again = harmonic.mass(answer) if harmonic.rigid.shape[1] else None
        assert again is None or np.abs(harmonic.rigid.conj().T @ again).max() < 1e-9 * np.abs(again).max()


def test_the_factor_condenses_onto_the_unknowns_that_stay() -> None:
    nodes, elements = ring((2, 6, 2), 0.02, 0.05, 0.03)
    matrix, _ = hex20.assemble(nodes, elements, STEEL)
    stays = np.repeat(nodes[:, 0] > 0.03, 3)
    order = np.concatenate([np.flatnonzero(~stays), np.flatnonzero(stays)])
    inner = int((~stays).sum())
    kept = np.where(stays[::3][elements], -1, elements)
    factor = CondensedFactor(matrix[order][:, order], kept, order[:inner] // 3)
    dense = matrix.toarray()[np.ix_(order, order)]
    a, b, c = dense[:inner, :inner], dense[:inner, inner:], dense[inner:, inner:]
    rng = np.random.default_rng(0)
    load, moved = rng.standard_normal((inner, 3)), 1e-9 * rng.standard_normal((len(c), 3))
    exact = np.linalg.solve(a, np.hstack([b, load, load - b @ moved]))
    influence, answer, both = np.split(exact, [len(c), len(c) + 3], axis=1)
    y, passed = factor.forward(load)
    assert np.abs(factor.schur - (c - b.T @ influence)).max() < 1e-10 * np.abs(c).max()
    assert np.abs(passed + b.T @ answer).max() < 1e-9 * np.abs(passed).max()
    assert np.abs(y.T @ y - load.T @ answer).max() < 1e-9 * np.abs(load.T @ answer).max()
    assert np.abs(factor.backward(y, moved) - both).max() < 1e-9 * np.abs(both).max()
