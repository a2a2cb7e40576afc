"""The error norm on signals whose errors are known by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearfmu.stage import Trace
from gearfmu.study.norm import Signals, band_error, band_levels, errors, kept_signals, lock_time

STEP = 1e-4
TIME = STEP * np.arange(4000)
SINE = np.sin(2 * np.pi * 500 * TIME)  # 200 periods


def signals(**changes: object) -> Signals:
    """Sines of 1 µm and 100 N about means; the second bearing has no x force."""
    bearing = np.stack([30 * SINE, 40 * SINE, 0 * SINE, 50 * SINE], 1) + 7.0
    made = Signals(1e-6 * SINE + 40e-6, 100 * SINE + 3000, bearing, None, STEP, 0.0, True)
    return replace(made, **changes)


def test_alternating_part_and_mean_apart() -> None:
    beside = 10 * np.cos(2 * np.pi * 500 * TIME)
    found = signals(te=1.02e-6 * SINE + 40e-6 + 0.05e-6, force=100 * SINE + 3000 + beside)
    e = errors(found, signals())
    assert e.te == pytest.approx(0.02, rel=1e-9)
    assert e.te_mean == pytest.approx(0.05 * np.sqrt(2), rel=1e-9)  # over the rms of a sine of 1 µm
    assert e.force == pytest.approx(0.1, rel=1e-9) and e.bearing == pytest.approx(0.0, abs=1e-12)


def test_meshes_of_a_train_count_together() -> None:
    both = np.stack([3e-6 * SINE, 4e-6 * SINE], 1)
    found = signals(te=both + 0.5e-6 * SINE[:, None] * [0.0, 1.0])
    assert errors(found, signals(te=both)).te == pytest.approx(0.1, rel=1e-9)


def test_bearing_is_the_worse_of_two_vectors() -> None:
    bearing = signals().bearing.copy()
    bearing[:, 1] += 5 * SINE  # 5 of √(30² + 40²)
    assert errors(signals(bearing=bearing), signals()).bearing == pytest.approx(0.1, rel=1e-9)
    bearing[:, 2] += 20 * SINE  # 20 of 50 beside it
    assert errors(signals(bearing=bearing), signals()).bearing == pytest.approx(0.4, rel=1e-9)


def test_transient_takes_the_references_moving_average_away() -> None:
    """A ramp of 100 µm would hide the sine of 1 µm in a plain standard deviation."""
    ramp = 100e-6 * TIME / TIME[-1]
    wanted = signals(te=1e-6 * SINE + ramp, steady=False)
    found = signals(te=1.1e-6 * SINE + ramp, steady=False)
    assert errors(found, wanted).te == pytest.approx(0.1, rel=0.03)
    plain = errors(replace(found, steady=True), replace(wanted, steady=True)).te
    assert plain < 0.01


def test_a_run_that_stopped_has_no_error() -> None:
    short = signals(te=SINE[:100], force=SINE[:100])
    assert all(np.isnan(value) for value in vars(errors(short, signals())).values())


def test_last_locking_counts() -> None:
    locked = np.zeros(4000, bool)
    locked[1000:1500] = locked[2000:] = True
    assert lock_time(signals(locked=locked)) == pytest.approx(0.2, abs=1e-12)
    locked[-1] = False
    assert np.isnan(lock_time(signals(locked=locked))) and np.isnan(lock_time(signals()))


def test_bands_hold_the_rms_of_a_sine() -> None:
    levels = band_levels(100 * SINE, STEP)
    assert levels[500.0] == pytest.approx(100 / np.sqrt(2), rel=1e-6)
    assert max(levels[125.0], levels[2000.0]) < 0.1
    louder, window = signals(force=110 * SINE + 3000 + np.random.default_rng(0).normal(size=4000)), slice(0, 4000)
    noisy = signals(force=signals().force + np.random.default_rng(0).normal(size=4000))
    assert band_error(louder, noisy, window) == pytest.approx(20 * np.log10(1.1), rel=0.01)
    assert np.isnan(band_error(louder, noisy, slice(0, 10)))


@pytest.mark.parametrize("meshes", [1, 2])
def test_kept_signals_read_back(tmp_path, meshes: int) -> None:
    """Of a pair, and of a train with two meshes."""
    columns = {name: np.stack([SINE] * meshes, 1).squeeze() for name in ("te", "force")}
    made = signals(locked=SINE > 0, steady=False, **columns)
    made.trace({}).save(tmp_path / "s.h5")
    read = kept_signals(Trace.load(tmp_path / "s.h5"))
    for name in ("te", "force", "bearing", "locked"):
        assert np.array_equal(getattr(read, name), getattr(made, name))
    assert (read.interval, read.start, read.steady) == (made.interval, made.start, made.steady)
