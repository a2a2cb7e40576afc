"""Modes of many nodal diameters from a small space against block Lanczos of each; condensation within the factor."""

from __future__ import annotations

import numpy as np
import pytest
from small_gear import BETA, coarse

from gearfmu.fem import refined
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
    [(refined._NEAR, (0, 6), 1e-7), (0.0, (0, 3, 6), 1e-9), (1.0, (0, 3, 6), 1e-3)],
    ids=["from a poor space", "always Lanczos", "one step alone"],
)
def test_modes_are_those_of_each_nodal_diameter(
    near: float, samples: tuple[int, ...], error: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    low = space_of(samples)
    monkeypatch.setattr(refined, "_NEAR", near)
    found = {h.nodal_diameter: (h, s, x) for h, s, x in refined.refined_modes(low, dict.fromkeys(range(7), COUNT))}
    assert sorted(found) == list(range(7))
    for harmonic, squared, shapes in found.values():
        exact, _ = lowest_modes(harmonic, COUNT)
        assert np.allclose(squared, exact, rtol=error)
        assert np.all(squared > exact * (1 - 1e-8))
        assert np.allclose(shapes.conj().T @ harmonic.mass(shapes), np.eye(COUNT), atol=1e-7)
