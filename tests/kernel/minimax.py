"""Polynomial coefficients of gearfmu/kernel/src/base/gk_math.c, made from scratch:
`python tests/kernel/minimax.py` prints the C arrays.

Each kernel polynomial p(z) interpolates its function at the Chebyshev points of the argument range with 60 digits
(within a factor of about two of the true minimax polynomial: Powell, Computer J. 9, 1967) and its coefficients are then
rounded to double. `test_math.py` checks that the arrays in the C source are these numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mpmath as mp

mp.mp.dps = 60


@dataclass(frozen=True)
class Kernel:
    """One polynomial of the C source: name of the array, function of z, range [low, high] of z,
    number of coefficients."""

    name: str
    function: Callable[[mp.mpf], mp.mpf]
    low: mp.mpf
    high: mp.mpf
    terms: int


def _near_zero(closed: Callable, coefficient: Callable[[int], mp.mpf], threshold: float = 1e-3) -> Callable:
    """`closed` away from zero, its power series near it (where the closed form cancels)."""
    return lambda z: closed(z) if abs(z) > threshold else mp.fsum(coefficient(k) * z**k for k in range(40))


def _exp_tail(r: mp.mpf) -> mp.mpf:
    return (mp.e**r - 1 - r) / r**2


def _log_tail(z: mp.mpf) -> mp.mpf:
    s = mp.sqrt(z)
    return (2 * mp.atanh(s) / s - 2) / z


def _sin_tail(z: mp.mpf) -> mp.mpf:
    x = mp.sqrt(z)
    return (mp.sin(x) / x - 1) / z


def _cos_tail(z: mp.mpf) -> mp.mpf:
    return (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2


def _atan_tail(z: mp.mpf) -> mp.mpf:
    t = mp.sqrt(z)
    return (mp.atan(t) / t - 1) / z


def _asin_tail(z: mp.mpf) -> mp.mpf:
    s = mp.sqrt(z)
    return (mp.asin(s) / s - 1) / z


def _asin_coefficient(k: int) -> mp.mpf:
    n = k + 1
    return mp.binomial(2 * n, n) / (mp.mpf(4) ** n * (2 * n + 1))


_quarter = (mp.pi / 4 * (1 + mp.mpf(2) ** -20)) ** 2
_octant = (mp.sqrt(2) - 1) ** 2 * (1 + mp.mpf(2) ** -20)
_half_ln2 = mp.log(2) / 2 * (1 + mp.mpf(2) ** -20)
_s_max = ((mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)) ** 2 * (1 + mp.mpf(2) ** -20)

_zero = mp.mpf(0)
_exp = _near_zero(_exp_tail, lambda k: 1 / mp.factorial(k + 2))
_log = _near_zero(_log_tail, lambda k: mp.mpf(2) / (2 * k + 3))
_sin = _near_zero(_sin_tail, lambda k: (-1) ** (k + 1) / mp.factorial(2 * k + 3))
_cos = _near_zero(_cos_tail, lambda k: (-1) ** k / mp.factorial(2 * k + 4))
_atan = _near_zero(_atan_tail, lambda k: mp.mpf((-1) ** (k + 1)) / (2 * k + 3))
KERNELS = (
    Kernel("EXP", _exp, -_half_ln2, _half_ln2, 11),
    Kernel("LOG", _log, _zero, _s_max, 7),
    Kernel("SIN", _sin, _zero, _quarter, 6),
    Kernel("COS", _cos, _zero, _quarter, 6),
    Kernel("ATAN", _atan, _zero, _octant, 11),
    Kernel("ASIN", _near_zero(_asin_tail, _asin_coefficient), _zero, mp.mpf(1) / 4, 13),
)


def coefficients(kernel: Kernel) -> list[float]:
    """Ascending coefficients of the interpolating polynomial, rounded to double."""
    n = kernel.terms
    middle, half = (kernel.high + kernel.low) / 2, (kernel.high - kernel.low) / 2
    nodes = [middle + half * mp.cos(mp.pi * (2 * k + 1) / (2 * n)) for k in range(n)]
    matrix = mp.matrix([[x**j for j in range(n)] for x in nodes])
    return [float(c) for c in mp.lu_solve(matrix, mp.matrix([kernel.function(x) for x in nodes]))]


def largest_error(kernel: Kernel, points: int = 400) -> float:
    """Largest |p − f| over the range, p with the rounded coefficients in exact arithmetic."""
    c = [mp.mpf(v) for v in coefficients(kernel)]
    grid = [kernel.low + (kernel.high - kernel.low) * k / points for k in range(points + 1)]
    return float(max(abs(mp.polyval(c[::-1], z) - kernel.function(z)) for z in grid))


def pio2_parts() -> list[float]:
    """π/2 in four pieces of 23 bits and a double for the rest (Cody and Waite 1980, ch. 8)."""
    parts, rest = [], mp.pi / 2
    for _ in range(4):
        _, exponent = mp.frexp(rest)
        unit = mp.mpf(2) ** (exponent - 23)
        parts.append(mp.floor(rest / unit) * unit)
        rest -= parts[-1]
    return [float(p) for p in parts] + [float(rest)]


def main() -> None:
    for kernel in KERNELS:
        print(f"/* largest error {largest_error(kernel):.1e} */")
        print(f"static const double {kernel.name}[] = {{" + ", ".join(c.hex() for c in coefficients(kernel)) + "};")
    print("static const double PIO2[] = {" + ", ".join(p.hex() for p in pio2_parts()) + "};")
    constants = {"PI/4": mp.pi / 4, "PI/2": mp.pi / 2, "3PI/4": 3 * mp.pi / 4, "PI": mp.pi}
    constants |= {"1/LN2": 1 / mp.log(2), "2/PI": 2 / mp.pi}
    for name, value in constants.items():
        print(f"{name}: {float(value).hex()} + {float(value - float(value)).hex()}")
    ln2_high = mp.floor(mp.log(2) * 2**33) / 2**33
    print(f"LN2: {float(ln2_high).hex()} + {float(mp.log(2) - ln2_high).hex()}")


if __name__ == "__main__":
    main()
