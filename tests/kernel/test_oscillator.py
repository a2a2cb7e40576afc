"""Coefficients of one oscillator (docs/theory.md, eq. 9) against the same equations in 50 digits: exact damped flow,
response exact at rest and at the mesh mode, energy, loss, speeds.

What is compared are properties: the response of the discrete step, from its coefficients, with that of the oscillator
q̈ + 2ζωq̇ + ω²q = f.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from pathlib import Path

import mpmath as mp
import pytest

mp.mp.dps = 50
HZ = 2 * mp.pi
H = 10e-6
MATCHED = float(HZ * 8.06e3)  # rad/s: the mesh mode of fzg_c
EXPONENTIAL = [1e-4, 0.02, 0.3, 0.506, 0.9, 1.4, 1.59]  # ωh; one close to that of the mesh mode
FAST = [1.61, 2.0, 2.9, 3.2, 6.0, 40.0]
DIGITS = 1e-11  # of coefficients in double; measured: 4e-12


@dataclass(frozen=True)
class Step:
    """The coefficients of a step in 50 digits: E (2, 2), B (2, 1) for the force at either end, κ, weight of the energy;
    speed of the state = unit ẋ + lead ḟ + hold f; κ of a free mass."""

    h: float
    E: mp.matrix
    B: mp.matrix
    kappa: mp.mpf
    weight: mp.mpf
    unit: mp.mpf
    lead: mp.mpf
    hold: mp.mpf
    free: mp.mpf

    def response(self, frequency: float) -> mp.mpc:
        """Displacement by a force e^(iΩt), sampled: e₁ᵀ (z − E)⁻¹ B (z + 1) − κ."""
        z = mp.expjpi(mp.mpf(frequency) * self.h / mp.pi)
        return (mp.lu_solve(z * mp.eye(2) - self.E, self.B) * (z + 1))[0] - self.kappa


@dataclass(frozen=True)
class Oscillators:
    """Calls the kernel's coefficients."""

    library: ctypes.CDLL

    def step(self, omega: float, zeta: float, gamma: float = 1.0, matched: float = MATCHED, h: float = H) -> Step:
        pace, out = (ctypes.c_double * 3)(h, gamma, matched), (ctypes.c_double * 12)()
        self.library.probe_oscillator(pace, ctypes.c_double(omega), ctypes.c_double(zeta), out)
        value = [mp.mpf(x) for x in out]
        return Step(h, mp.matrix([value[:2], value[2:4]]), mp.matrix(value[4:6]), *value[6:])


@pytest.fixture(scope="module")
def oscillators(inner_library: Path) -> Oscillators:
    return Oscillators(ctypes.CDLL(str(inner_library)))


def exact(omega: float, zeta: float, frequency: float) -> mp.mpc:
    """1/(ω² − Ω² + 2iζωΩ)."""
    w, s = mp.mpf(omega), mp.mpf(frequency)
    return 1 / (w**2 - s**2 + 2j * mp.mpf(zeta) * w * s)


def off(found: mp.mpf, wanted: mp.mpf, scale: mp.mpf | None = None) -> float:
    return float(abs(found - wanted) / abs(wanted if scale is None else scale))


@pytest.mark.parametrize("zeta", [0.0, 1e-3, 0.05])
@pytest.mark.parametrize("x", EXPONENTIAL)
@pytest.mark.parametrize("gamma", [1.0, 0.6, 0.3, 0.0])
def test_the_flow_is_the_exact_damped_one(oscillators: Oscillators, x: float, zeta: float, gamma: float) -> None:
    if x > 1.6 * min(1.0, max(0.5, 0.5 + 2 * (gamma - 0.5))):
        pytest.skip("too fast for this γ")
    w = mp.mpf(x / H)
    wanted = mp.expm(mp.matrix([[0, 1], [-(w**2), -2 * mp.mpf(zeta) * w]]) * H)
    found = oscillators.step(float(w), zeta, gamma).E
    for i, j, unit in ((0, 0, 1), (0, 1, 1 / w), (1, 0, w), (1, 1, 1)):
        assert off(found[i, j], wanted[i, j], unit) < 1e-15


@pytest.mark.parametrize("matched", [0.0, MATCHED])
@pytest.mark.parametrize("gamma", [1.0, 0.8, 0.6, 0.3, 0.0])
@pytest.mark.parametrize("x", EXPONENTIAL + FAST)
def test_exact_at_rest_and_at_the_mesh_mode(oscillators: Oscillators, x: float, gamma: float, matched: float) -> None:
    """At rest with damping too; at Ω while the correction is whole. A mode that is too fast and near Ω is matched at
    .7 of its own frequency."""
    omega = x / H
    for zeta in (0.0, 0.01):
        step = oscillators.step(omega, zeta, gamma, matched)
        assert off(step.response(0.0), exact(omega, 0.0, 0.0)) < max(DIGITS, 1e-15 / x**2)
    step = oscillators.step(omega, 0.0, gamma, matched)
    if gamma < 0.5 or not matched:
        return
    at = matched if x < 1.6 else min(matched, 0.7 * omega)
    assert off(step.response(at), exact(omega, 0.0, at), max(abs(exact(omega, 0.0, at)), H**2)) < max(
        DIGITS, 1e-15 / x**2
    )


@pytest.mark.parametrize("matched", [0.0, MATCHED], ids=["at rest", "at the mesh mode"])
@pytest.mark.parametrize("omega", [1e3, 2e4, 6e4])
def test_the_response_is_of_fourth_order(oscillators: Oscillators, omega: float, matched: float) -> None:
    """Fourth, of modes slow and fast, at half the mesh mode."""
    frequency = 0.5 * MATCHED
    errors = []
    for h in (H, H / 2, H / 4):
        step = oscillators.step(omega, 0.0, matched=matched, h=h)
        errors.append(abs(step.response(frequency) - exact(omega, 0.0, frequency)))
    rates = [float(mp.log(a / b, 2)) for a, b in zip(errors[:-1], errors[1:], strict=True)]
    assert rates[-1] == pytest.approx(4, abs=0.1), rates


@pytest.mark.parametrize("x", EXPONENTIAL + FAST)
def test_a_step_keeps_the_energy_that_the_mean_force_brings(oscillators: Oscillators, x: float) -> None:
    """Undamped: ½(f₀ + f₁)(q₁ − q₀) is the change of weight (½v² + ½ω²q²), for any state and forces."""
    omega = mp.mpf(x / H)
    for gamma in (1.0, 0.8, 0.6, 0.3, 0.0):
        step = oscillators.step(float(omega), 0.0, gamma)
        for q, v, forces in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0.3, -0.7, 0.4)):
            start = mp.matrix([q, v * omega])
            end = step.E * start + step.B * (forces * omega**2)
            change = step.weight * 0.5 * (end[1] ** 2 - start[1] ** 2 + omega**2 * (end[0] ** 2 - start[0] ** 2))
            assert abs(0.5 * forces * omega**2 * (end[0] - start[0]) - change) < 1e-14 * omega**2 * step.weight


@pytest.mark.parametrize("zeta", [1e-3, 0.01, 0.05])
@pytest.mark.parametrize("x", EXPONENTIAL + FAST)
def test_no_damped_oscillator_gives_energy_at_any_frequency(oscillators: Oscillators, x: float, zeta: float) -> None:
    """Im H ≤ 0 on the whole unit circle; slow forces lose what they lose in the oscillator."""
    step = oscillators.step(x / H, zeta)
    assert max(mp.im(step.response(mp.pi * k / 64 / H)) for k in range(1, 64)) <= 1e-13 * mp.mpf(H) ** 2
    slow = 1e-3 * min(x, 1.0) / H
    assert off(mp.im(step.response(slow)), mp.im(exact(x / H, zeta, slow))) < max(1e-4, 0.35 * x**2 * (x < 1.6))


@pytest.mark.parametrize("zeta", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("gamma", [1.0, 0.8, 0.6, 0.3, 0.0])
@pytest.mark.parametrize("x", EXPONENTIAL + FAST)
def test_speed_of_the_state_by_that_of_the_motion(
    oscillators: Oscillators, x: float, gamma: float, zeta: float
) -> None:
    """Under a force 1 + t/h the state that a step reproduces, one line on, has the speed unit ẋ + lead ḟ + hold f,
    with ẋ = ḟ/ω²; its displacement is that of the oscillator, but for what damping does to it in a step."""
    omega = mp.mpf(x / H)
    step = oscillators.step(float(omega), zeta, gamma)
    slope = 1 / mp.mpf(H)
    there = mp.lu_solve(mp.eye(2) - step.E, 2 * step.B)  # by f = 1
    rate = there * slope
    start = mp.lu_solve(mp.eye(2) - step.E, step.B * slope * H - rate * H)
    found = start[1] + there[1]
    wanted = step.unit * slope / omega**2 + step.lead * slope + step.hold
    assert off(found, wanted, slope / omega**2) < 1e-9 * max(1.0, 1e-5 / x**2)
    assert x > 1.6 or gamma < 0.75 or step.unit == 1.0


@pytest.mark.parametrize("matched", [0.0, 1e-3 / H, 0.0501 / H, MATCHED, 2.2 / H])
def test_a_free_mass_is_exact_at_the_mesh_mode(oscillators: Oscillators, matched: float) -> None:
    """¼h² (z + 1)²/(z − 1)² − κ = −1/Ω²; h²/6 where nothing is matched."""
    free = oscillators.step(1.0, 0.0, matched=matched).free
    b = mp.mpf(matched) * H / 2
    wanted = mp.mpf(H) ** 2 / 6 if not matched else mp.mpf(H) ** 2 / 4 * (1 + 1 / b**2 - 1 / mp.sin(b) ** 2)
    assert off(free, wanted) < 1e-12
    assert oscillators.step(1.0, 0.0, gamma=0.25, matched=matched).free == pytest.approx(0.5 * float(free), rel=1e-15)
