"""The constant of the contact's dashpots belongs to the modes that are stored: with half of them the path is longer,
and `same_loss` says with which constant the mesh loses the same."""

from __future__ import annotations

import numpy as np
import pytest
from by_hand import Pair
from dashpot import own_path, same_loss
from test_memory import of_few_modes

from gearfmu.body import Body
from gearfmu.stage import assemble
from gearfmu.stagefile.forms.general import Stage


def by_hand(spec: Stage, bodies: list[Body], force: float) -> float:
    """Slope of the local law of one tooth pair that carries `force`, and 95 % of what both teeth yield beyond their
    stored modes under 1 N over the width, mean over the roll, m/N."""
    pair, gears = Pair(spec, bodies), spec.written.geometry.gears
    a, c, beta = pair.local_law(tuple(np.sqrt(gear.r**2 - gear.r_b**2) for gear in gears))
    law = (c - 0.5 * a * (1 + np.log(beta * force / pair.width))) / pair.width
    static = [body.flank.static[0, 0, 0].diagonal(axis1=0, axis2=1)[0, 0] for body in bodies]
    modes = [((body.flank.rows[0, :, 0] / (2 * np.pi * body.frequency)) ** 2).sum(axis=1) for body in bodies]
    return float(law + 0.95 * sum((s - m).mean() for s, m in zip(static, modes, strict=True)))


def test_the_same_bodies_take_the_same_constant(relief_spec: Stage, bodies: list[Body]) -> None:
    assert same_loss(relief_spec, bodies, bodies) == pytest.approx(relief_spec.written.contact.damping, rel=1e-14)


def test_the_path_is_the_local_law_and_most_of_the_teeths_residual(relief_spec: Stage, bodies: list[Body]) -> None:
    """By hand at the pitch point, load shared evenly by the slices of two tooth pairs: the mean over the path of
    contact is near it."""
    torque = 0.5 * relief_spec.written.torque_max
    have = own_path(assemble(relief_spec, bodies), torque)
    want = by_hand(relief_spec, bodies, 0.5 * torque / relief_spec.written.geometry.gears[0].r_b)
    assert have == pytest.approx(want, rel=0.1)


def test_a_longer_path_takes_a_smaller_constant(relief_spec: Stage, bodies: list[Body]) -> None:
    """Of few modes: c falls with the square of the path."""
    fewer, torque = [of_few_modes(body) for body in bodies], 0.5 * relief_spec.written.torque_max
    own, longer = (own_path(assemble(relief_spec, some), torque) for some in (bodies, fewer))
    assert longer > 1.2 * own
    share = same_loss(relief_spec, bodies, fewer) / relief_spec.written.contact.damping
    assert share == pytest.approx((own / longer) ** 2, rel=1e-12)
