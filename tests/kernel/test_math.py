"""Elementary functions of the kernel against mpmath: at most 2 ulp everywhere, exact at the special points,
the same bits from every compiler."""

from __future__ import annotations

import re
from collections.abc import Callable

import minimax
import mpmath as mp
import numpy as np
import pytest
from probes import Probes, source_folder

LIMIT = 2.0  # ulp
RNG = np.random.default_rng(20150712)
N = 3000

HALF_PI = mp.pi / 2


def near_multiples_of_half_pi(count: int) -> np.ndarray:
    """Doubles next to k π/2 for k below 6.3e8, where the reduction loses the most."""
    k = np.unique(np.concatenate([np.arange(1, 200), RNG.integers(1, int(6.3e8), count)]))
    return np.array([float(int(i) * HALF_PI) for i in k])


def signed(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x, -x])


def beside(joint: float) -> np.ndarray:
    """Neighbouring doubles around a joint of the reductions."""
    return joint + np.arange(-300, 300) * np.spacing(joint)


EXP_POINTS = np.r_[
    RNG.uniform(-745, 709.7, N),
    signed(10.0 ** RNG.uniform(-20, 0, N)),
    np.arange(-708, 709) * np.log(2),
    beside(np.log(2) / 2),
    RNG.uniform(-745.13, -708, 500),
]
LOG_POINTS = np.r_[
    np.exp(RNG.uniform(-700, 700, N)),
    RNG.uniform(0.5, 2, N),
    1 + signed(10.0 ** RNG.uniform(-15.5, -1, N)),
    10.0 ** RNG.uniform(-323, -308, 500),
    beside(np.sqrt(0.5)),
]
CIRCLE_POINTS = np.r_[
    signed(10.0 ** RNG.uniform(-300, 9, N)),
    RNG.uniform(-8, 8, N),
    near_multiples_of_half_pi(N),
    beside(np.pi / 4),
    signed(np.array([1e9])),
]
ACOS_POINTS = np.r_[
    RNG.uniform(-1, 1, N),
    1 - 10.0 ** RNG.uniform(-16, 0, N),
    -1 + 10.0 ** RNG.uniform(-16, 0, N),
    signed(10.0 ** RNG.uniform(-300, 0, N)),
    signed(beside(0.5)),
]


def ulps(value: np.ndarray, exact: list[mp.mpf]) -> np.ndarray:
    """Error in units of the last place of the exact value."""
    unit = [mp.mpf(float(np.spacing(abs(float(e))))) for e in exact]
    return np.array([float(abs(mp.mpf(float(v)) - e) / u) for v, e, u in zip(value, exact, unit, strict=True)])


@pytest.mark.parametrize(
    ("name", "function", "points"),
    [
        ("exp", mp.exp, EXP_POINTS),
        ("log", mp.log, LOG_POINTS),
        ("sin", mp.sin, CIRCLE_POINTS),
        ("cos", mp.cos, CIRCLE_POINTS),
        ("acos", mp.acos, ACOS_POINTS),
    ],
)
def test_error_of_functions_of_one_variable(probes: Probes, name: str, function: Callable, points: np.ndarray) -> None:
    error = ulps(probes.one(name, points), [function(mp.mpf(float(x))) for x in points])
    worst = int(np.argmax(error))
    assert error[worst] <= LIMIT, f"{name}({points[worst]!r}) is {error[worst]:.3f} ulp off"


def test_error_of_atan2(probes: Probes) -> None:
    radius, angle = 10.0 ** RNG.uniform(-150, 150, 3 * N), RNG.uniform(-np.pi, np.pi, 3 * N)
    y = np.concatenate([radius * np.sin(angle), signed(10.0 ** RNG.uniform(-320, 308, N)), RNG.uniform(0.41, 0.42, N)])
    x = np.concatenate([radius * np.cos(angle), signed(10.0 ** RNG.uniform(-320, 308, N)), np.ones(N)])
    exact = [mp.atan2(mp.mpf(float(a)), mp.mpf(float(b))) for a, b in zip(y, x, strict=True)]
    error = ulps(probes.one("atan2", y, x), exact)
    worst = int(np.argmax(error))
    assert error[worst] <= LIMIT, f"atan2({y[worst]!r}, {x[worst]!r}) is {error[worst]:.3f} ulp off"


def test_special_points(probes: Probes) -> None:
    inf, nan = np.inf, np.nan
    for name, x, y in (
        ("exp", [0.0, -0.0, 710.0, -746.0, inf, -inf, nan], [1, 1, inf, 0, inf, 0, nan]),
        ("log", [1.0, 0.0, -1.0, inf, -inf, nan], [0, -inf, nan, inf, nan, nan]),
        ("acos", [1.0, -1.0, 0.0, 1.0000000000000002, nan, inf], [0, np.pi, np.pi / 2, nan, nan, nan]),
    ):
        np.testing.assert_array_equal(probes.one(name, np.array(x)), y)
    outside = np.array([1.0000000000000002e9, -2e9, inf, -inf, nan])
    assert np.all(np.isnan(probes.one("sin", outside))) and np.all(np.isnan(probes.one("cos", outside)))


def test_signs_of_zero_and_quadrants(probes: Probes) -> None:
    assert list(np.signbit(probes.one("sin", np.array([-0.0, 0.0])))) == [True, False]
    values = np.array([0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, 1.7e308])
    y, x = (v.ravel() for v in np.meshgrid(values, values))
    with np.errstate(all="ignore"):
        expected = np.arctan2(y, x)
    got = probes.one("atan2", y, x)
    np.testing.assert_allclose(got, expected, rtol=4e-16)
    np.testing.assert_array_equal(np.signbit(got[~np.isnan(got)]), np.signbit(expected[~np.isnan(got)]))


def test_coefficients_in_the_source_are_those_of_the_generator() -> None:
    text = "".join((source_folder() / name).read_text() for name in ("base/gk_math.h", "base/gk_math.c"))
    arrays = {k.name: minimax.coefficients(k) for k in minimax.KERNELS} | {"PIO2": minimax.pio2_parts()}
    for name, expected in arrays.items():
        found = re.search(rf"static const double (?:GK_)?{name}\[\d*\] = \{{([^}}]*)\}}", text)
        assert found, f"no array {name} in gk_math.h or .c"
        assert [float.fromhex(c) for c in found.group(1).replace("\n", " ").split(",")] == expected, name
