"""Tolerances of ISO 1328-1:2013 by hand, and what is drawn within them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfmu.geometry.iso1328 import Stream, Tolerances, draw, rounded, seed_of

CLASS_5 = Tolerances.of(5, 100e-3, 2e-3, 20e-3)


def test_class_5_by_hand() -> None:
    """d = 100 mm, m_n = 2 mm, b = 20 mm in µm: f_pT 0.1 + 0.8 + 5; F_pT 0.2 + 5.5 + 1.4 + 12; f_HαT 0.8 + 0.1 + 4;
    f_HβT 0.5 + 1.565 + 4."""
    found = {name: round(1e6 * value, 3) for name, value in vars(CLASS_5).items()}
    assert found == {"single_pitch": 6.0, "cumulative_pitch": 19.0, "profile_slope": 4.9, "helix_slope": 6.0}


def test_a_class_is_root_two_of_the_one_before() -> None:
    """Class 9 is four times class 5, before it is rounded: f_pT 5.9 → 23.6 → 24 µm, F_pT 19.1 → 76.4 → 76 µm."""
    coarse = Tolerances.of(9, 100e-3, 2e-3, 20e-3)
    assert (coarse.single_pitch, coarse.cumulative_pitch) == (pytest.approx(24e-6), pytest.approx(76e-6))


@pytest.mark.parametrize(
    ("value", "shown"), [(12.49, 12), (10.4, 10), (9.8, 10), (7.3, 7.5), (7.2, 7), (4.96, 5), (4.94, 4.9)]
)
def test_tolerances_are_rounded_as_the_standard_does(value: float, shown: float) -> None:
    assert rounded(value) == pytest.approx(shown, rel=1e-12)


@pytest.mark.parametrize("per_tooth", [True, False])
def test_what_is_drawn_keeps_its_class_and_uses_it_up(per_tooth: bool) -> None:
    for seed in range(50):
        found = draw(CLASS_5, 37, math.radians(20), (seed,), per_tooth)
        single = np.abs(found.index - np.roll(found.index, 1, axis=1)).max() / CLASS_5.single_pitch
        total = np.ptp(found.index, axis=1).max() / CLASS_5.cumulative_pitch
        assert max(single, total) == pytest.approx(1.0) and min(single, total) > 0.4
        assert np.abs(found.profile).max() <= CLASS_5.profile_slope
        assert np.abs(found.helix).max() <= CLASS_5.helix_slope
        assert bool(np.ptp(found.profile, axis=1).all()) is per_tooth


def test_flanks_of_both_sides_share_an_eccentricity() -> None:
    """The first order of either side leads the other's by 2 α_t, as those of a toothing beside its axis do."""
    shift = []
    for seed in range(40):
        lines = np.fft.rfft(draw(CLASS_5, 60, math.radians(20), (seed,)).index, axis=1)[:, 1]
        shift.append(lines[1] / lines[0] / abs(lines[1] / lines[0]))
    assert np.angle(np.mean(shift)) == pytest.approx(2 * math.radians(20), abs=0.02)


def test_a_seed_gives_the_same_numbers_on_every_machine() -> None:
    """Pinned: raw bits of PCG64, and what is made of them."""
    numbers = Stream((1, 2))
    assert [numbers.even() for _ in range(2)] == [0.44841514333227195, 0.4308819875443376]
    first, again, other = (draw(CLASS_5, 20, 0.35, seed_of(7, name)).index for name in ("sun", "sun", "planet1"))
    assert np.array_equal(first, again) and not np.allclose(first, other, atol=1e-7)


def test_normal_numbers_are_normal() -> None:
    numbers = Stream((5,))
    sample = np.array([numbers.normal() for _ in range(20_000)])
    assert abs(sample.mean()) < 0.02 and sample.std() == pytest.approx(1, abs=0.02)
    assert np.mean(np.abs(sample) < 1) == pytest.approx(0.6827, abs=0.01)
