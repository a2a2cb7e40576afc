"""Modes are followed by shape: where frequencies cross, columns do not."""

from __future__ import annotations

import numpy as np
import pytest

from gearfmu.modes.linear import followed


@pytest.mark.parametrize("seed", range(5))
def test_modes_whose_order_changes_keep_their_columns(seed: int) -> None:
    """Fixed mass-normalised shapes, a little disturbed and with any sign, in another order at every position."""
    dice = np.random.default_rng(seed)
    mass = dice.uniform(0.5, 2.0, 12)
    basis = np.linalg.qr(dice.normal(size=(12, 12)))[0][:, :8] / np.sqrt(mass)[:, None]
    shown = [dice.permutation(8) for _ in range(6)]
    shapes = [basis[:, order] * dice.choice([-1, 1], 8) + 0.02 * dice.normal(size=(12, 8)) for order in shown]
    columns = [order[own] for order, own in zip(shown, followed(mass, shapes), strict=True)]
    assert all(np.array_equal(column, columns[0]) for column in columns)
