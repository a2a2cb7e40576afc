"""Rolling bearings against printed deflections, tables of load distribution, closed forms and their own symmetries."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import quad

from gearfmu.bearing.catalogue import filled_ball
from gearfmu.bearing.hertz import line_pressure, point
from gearfmu.bearing.law import Balls, Rollers, Rolling, Row
from gearfmu.bearing.rest import NoRestError, pass_orders, pass_swing, preloaded, rest

DEEP = Balls(8, 12e-3, 50e-3, (0.52, 0.53), 0.0, 10e-6)
ANGULAR = Balls(12, 9.5e-3, 46e-3, (0.515, 0.525), np.radians(30.0), 0.0)
ROLLERS = Rollers(13, 8e-3, 46e-3, 10e-3, 8e-6)
TAPER = Rollers(17, 7.5e-3, 50e-3, 14e-3, 0.0, np.radians(15.0))
KINDS = {
    "deep groove": Rolling((Row(DEEP),)),
    "angular": Rolling((Row(ANGULAR),)),
    "mirrored, beside the centre": Rolling((Row(ANGULAR, 20e-3, -1, 5e-6),)),
    "two in O arrangement": Rolling((Row(ANGULAR, -30e-3, 1, 8e-6), Row(ANGULAR, 30e-3, -1, 8e-6)), 4),
    "roller": Rolling((Row(ROLLERS),)),
    "taper": Rolling((Row(TAPER),)),
}
_AT = np.array([18e-6, -9e-6, 40e-6, 2e-4, -3e-4])
AT = {name: _AT * ([1, 1, -1, -1, -1] if "mirrored" in name else 1.0) for name in KINDS}  # where they carry


def load(*values: float) -> np.ndarray:
    """Fx, Fy, Fz, Mx, My; zeros for those that are not said."""
    return np.array([*values, *[0.0] * (5 - len(values))])


# Seven balls of 11.5 mm on 43.5 mm, grooves 0.52 and 0.53, E 210 GPa: deflections that a commercial program prints, as
# quoted in the tests of github.com/minzhun/ISO16281. Load N, N·m; clearance µm; radial and axial µm, tilt mrad.
PRINTED = [
    (load(1000), 0, (15.1101, 0, 0)),
    (load(0, 0, 1000), 0, (0, 133.5381, 0)),
    (load(1000), 10, (21.223, 0, 0)),
    (load(0, 0, 1000), 10, (0, 149.1717, 0)),
    (load(1000, 0, 1000), 10, (19.5923, 146.4603, 2.6872)),
    (load(0, 0, 0, 1), 0, (0, 0, 3.6957)),
    (load(1000, 0, 1000, 1), 10, (19.7144, 146.3084, 2.7239)),
]


def integrals(epsilon: float, exponent: float) -> tuple[float, float]:
    """J_r and J_a of Sjövall: means over the circle of (1 − (1 − cos ψ)/2ε)ⁿ cos ψ, and without cos ψ, where loaded."""
    end = math.acos(max(1 - 2 * epsilon, -1.0))

    def mean(weight: Callable[[float], float]) -> float:
        return (
            quad(lambda psi: (1 - (1 - math.cos(psi)) / (2 * epsilon)) ** exponent * weight(psi), 0, end)[0] / math.pi
        )

    return mean(math.cos), mean(lambda psi: 1.0)


def row(law: Balls | Rollers) -> Rolling:
    return Rolling((Row(law),))


@dataclass(frozen=True)
class Straight(Rollers):
    """Rollers without profile."""

    @property
    def profile(self) -> np.ndarray:
        return np.zeros_like(self.places)


@pytest.mark.parametrize(("force", "clearance", "printed"), PRINTED)
def test_printed_deflections(force: np.ndarray, clearance: float, printed: tuple[float, float, float]) -> None:
    """The lever of a tilt is the groove's centre here (ISO/TS 16281), the pitch circle there: 1.1 to 1.3 %."""
    law = Balls(7, 11.5e-3, 43.5e-3, (0.52, 0.53), 0.0, clearance * 1e-6, 210e9)
    d = rest(row(law), force).displacement
    radial, axial, tilt = printed
    if radial:
        assert 1e6 * math.hypot(*d[:2]) == pytest.approx(radial, rel=5e-4)
    if axial:
        assert 1e6 * d[2] == pytest.approx(axial, rel=5e-4)
    if tilt:
        assert 1e3 * math.hypot(*d[3:]) == pytest.approx(tilt, rel=0.015)


def test_half_the_circle_carries() -> None:
    """NSK, cat. E728g: F_a = 1.216 F_r tan α of points and 1.260 of lines, whose exponent is 1.1 there; Q_max = 4.37
    and 4.08 F_r/(Z cos α)."""
    for exponent, axial, largest in ((1.5, 1.216, 4.37), (1.1, 1.260, 4.08)):
        j_r, j_a = integrals(0.5, exponent)
        assert (j_a / j_r, 1 / j_r) == pytest.approx((axial, largest), abs=5e-3)


@pytest.mark.parametrize("epsilon", [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
def test_integrals_of_load_distribution(epsilon: float) -> None:
    """F_r = Z Q_max J_r cos α, F_a = Z Q_max J_a sin α. Angles hardly change under small loads; ε is
    ½ (1 + δ_a tan α / δ_r), without axial displacement ½ (1 − s/(2 δ_r))."""
    (radial, axial), (of_line, along_line) = integrals(epsilon, 1.5), integrals(epsilon, 10 / 9)
    alpha, most, turned = ANGULAR.contact_angle, 1e-9, 2 * epsilon - 1
    across = most / math.cos(alpha) / (1 + turned)
    d = load(across, 0, turned * across / math.tan(alpha))
    bearing = replace(row(ANGULAR), positions=200)
    force, largest = bearing.force(d), bearing.loads(d).max() * ANGULAR.count
    assert force[0] / largest / math.cos(alpha) == pytest.approx(radial, abs=1e-4)
    assert force[2] / largest / math.sin(alpha) == pytest.approx(axial, abs=1e-4)
    taper, alpha = Straight(17, 8e-3, 46e-3, 10e-3, 0.0, math.radians(20.0)), math.radians(20.0)
    across = 1e-5 / (1 + turned)
    bearing, d = replace(row(taper), positions=200), load(across, 0, turned * across / math.tan(alpha))
    force, largest = bearing.force(d), bearing.loads(d).max() * taper.count
    assert force[0] / largest / math.cos(alpha) == pytest.approx(of_line, abs=1e-4)
    assert force[2] / largest / math.sin(alpha) == pytest.approx(along_line, abs=1e-4)
    line = replace(row(Straight(12, 8e-3, 46e-3, 10e-3, -2 * turned * across)), positions=200)
    d = load(across)
    assert line.force(d)[0] / line.loads(d).max() / 12 == pytest.approx(of_line, abs=1e-4)


def test_largest_load_without_clearance() -> None:
    """4.37 F/Z of balls, 4.08 F/Z of rollers (NSK, cat. E728g, eqs. 4 and 5), to the digits that are printed."""
    balls = replace(row(replace(DEEP, clearance=0.0)), positions=64)
    assert rest(balls, load(300)).loads.max() * DEEP.count / 300 == pytest.approx(4.37, abs=5e-3)
    rollers = replace(row(Straight(13, 8e-3, 46e-3, 10e-3)), positions=64)
    assert rest(rollers, load(3000)).loads.max() * 13 / 3000 == pytest.approx(4.08, abs=5e-3)


@pytest.mark.parametrize("name", KINDS)
def test_forces_and_stiffness_are_derivatives(name: str) -> None:
    """Central differences over 1e-4 of the displacement: relative error about 1e-6. Where a slice of a roller just
    touches the second derivative of u jumps, so rollers have 1e-3."""
    bearing, at, scale = KINDS[name], AT[name], np.array([1.0, 1.0, 1.0, 0.023, 0.023])
    steps = 4e-9 / scale

    def difference(of, i: int) -> np.ndarray:
        step = np.eye(5)[i] * steps[i]
        return (of(at + step) - of(at - step)) / (2 * steps[i])

    force, stiffness = bearing.force(at), bearing.stiffness(at)
    slopes = np.array([difference(bearing.energy, i) for i in range(5)])
    assert np.abs((slopes - force) / scale).max() < 1e-6 * np.abs(force / scale).max()
    tangents = np.array([difference(bearing.force, i) for i in range(5)])
    apart = np.abs((tangents - stiffness) / np.outer(scale, scale)).max()
    assert apart < (1e-3 if name in ("roller", "taper") else 1e-6) * np.abs(stiffness / np.outer(scale, scale)).max()
    assert np.array_equal(stiffness, stiffness.T)
    values = np.linalg.eigvalsh(stiffness / np.outer(scale, scale))
    assert values[0] >= -1e-12 * values[-1]


@pytest.mark.parametrize("name", KINDS)
def test_a_load_is_found_again(name: str) -> None:
    bearing, at = KINDS[name], AT[name]
    force = bearing.force(at)
    found = rest(bearing, force)
    assert found.load == pytest.approx(force, rel=1e-8, abs=1e-6)
    assert bearing.energy(found.displacement) - force @ found.displacement <= bearing.energy(at) - force @ at + 1e-12


def test_a_mirrored_bearing_moves_in_the_mirror() -> None:
    """Mirrored at z = 0, forces across and moments about z keep their sign, the others change it."""
    mirror, force = np.array([1, 1, -1, -1, -1]), np.array([800.0, 300.0, 1500.0, 4.0, -2.0])
    one = rest(Rolling((Row(ANGULAR, 0.01, 1),)), force).displacement
    other = rest(Rolling((Row(ANGULAR, -0.01, -1),)), mirror * force).displacement
    assert other == pytest.approx(mirror * one, rel=1e-9)


@pytest.mark.parametrize("law", [DEEP, ANGULAR, ROLLERS, TAPER], ids=["deep", "angular", "roller", "taper"])
def test_load_and_displacement_turn_together(law: Balls | Rollers) -> None:
    """By the distance of two rolling elements; averaged over the cage, by parts of it too."""
    force = np.array([900.0, 200.0, 0.0 if law is ROLLERS else 700.0, 1.0, 0.5])
    for positions in (1, 8):
        turn = 2 * math.pi / law.count / positions
        c, s = math.cos(turn), math.sin(turn)
        plane = np.array([[c, -s], [s, c]])
        whole = np.zeros((5, 5))
        whole[:2, :2], whole[2, 2], whole[3:, 3:] = plane, 1.0, plane
        bearing = replace(row(law), positions=positions)
        one, other = (rest(bearing, of).displacement for of in (force, whole @ force))
        assert other == pytest.approx(whole @ one, rel=1e-7, abs=1e-13)


def test_balls_are_similar() -> None:
    """All lengths twice as large and forces four times: pressures equal, displacements twice as large, tilt equal."""
    large = replace(DEEP, diameter=2 * DEEP.diameter, pitch_diameter=2 * DEEP.pitch_diameter, clearance=20e-6)
    force = np.array([1000.0, 400.0, 600.0, 3.0, 1.0])
    one, other = rest(row(DEEP), force), rest(row(large), force * [4, 4, 4, 8, 8])
    assert other.displacement == pytest.approx(one.displacement * [2, 2, 2, 1, 1], rel=1e-8)
    assert other.pressure == pytest.approx(one.pressure, rel=1e-8)


@pytest.mark.parametrize("groove", [0.52, 0.54, 0.57])
def test_contact_against_formulas_without_elliptic_integrals(groove: float) -> None:
    """Brewe and Hamrock 1977: χ = 1.0339 (R_y/R_x)^0.636, E = 1.0003 + 0.5968/q, K = 1.5277 + 0.6023 ln q with q =
    R_y/R_x, within 3 %."""
    ball, gamma = 10e-3, 0.2
    own = point(ball, groove * ball, gamma)
    ratio = (2 / ball + 2 / ball * gamma / (1 - gamma)) / (2 / ball - 1 / (groove * ball))
    assert own.axes == pytest.approx(1.0339 * ratio**0.636, rel=0.03)
    assert own.second == pytest.approx(1.0003 + 0.5968 / ratio, rel=0.03)
    assert own.first == pytest.approx(1.5277 + 0.6023 * math.log(ratio), rel=0.03)


def test_pressures_of_hertz() -> None:
    """A ball in a groove that hardly bends it lies like a sphere on a plane: p = (6 F E*²/(π³ R²))^(1/3); a roller has
    p = √(w E*/(π R))."""
    e_star = 207e9 / (2 * 0.91)
    flat = point(10e-3, 1e6, 1e-9)
    assert flat.pressure(100.0) == pytest.approx((6 * 100 * e_star**2 / (math.pi**3 * 5e-3**2)) ** (1 / 3), rel=1e-4)
    assert line_pressure(1e5, 4e-3) == pytest.approx(math.sqrt(1e5 * e_star / (math.pi * 4e-3)), rel=1e-12)


def test_preload_unloads_at_two_to_the_three_halves() -> None:
    """Two equal angular contact bearings against each other: twice the stiffness of one, and the second is without load
    at 2^1.5 of the preload (Harris, 8.6), but for the change of the contact angle."""
    law, preload = replace(ANGULAR, contact_angle=math.radians(40.0)), 10.0
    one = preloaded(Row(law), preload)
    pair = Rolling((one, replace(one, side=-1)))
    alone = Rolling((one,))
    still = np.zeros(5)
    assert alone.force(still)[2] == pytest.approx(preload, rel=1e-9)
    assert pair.force(still)[2] == pytest.approx(0.0, abs=1e-9)
    assert pair.stiffness(still)[2, 2] == pytest.approx(2 * alone.stiffness(still)[2, 2], rel=1e-12)
    assert rest(pair, load(0, 0, 2.75 * preload)).loads[1].max() > 0.0
    assert rest(pair, load(0, 0, 2.90 * preload)).loads[1].max() == 0.0


def test_what_a_bearing_does_not_carry() -> None:
    with pytest.raises(NoRestError, match="along its axis"):
        rest(row(ROLLERS), load(100, 0, 10))
    with pytest.raises(NoRestError):
        rest(row(ANGULAR), load(0, 0, -100))
    with pytest.raises(NoRestError):
        preloaded(Row(ROLLERS), 100.0)


def test_numbers_of_balls_and_passes() -> None:
    """Balls of four common bearings; 6205-2RS of the Case Western Reserve bearing data: 3.5848 and 5.4152."""
    counts = [filled_ball(d, o, {"balls": None}).law.count for d, o in ((17, 40), (25, 52), (30, 62), (30, 72))]
    assert counts == [8, 9, 9, 8]
    assert pass_orders(Balls(9, 7.94e-3, 39.04e-3, (0.52, 0.53))) == pytest.approx((3.5848, 5.4152), abs=1e-4)


def test_passing_balls_move_a_ring_only_where_some_carry_nothing() -> None:
    """Under an axial load every position of the cage is alike; under a radial load with clearance it is not."""
    assert pass_swing(row(DEEP), load(0, 0, 500)).max() < 1e-12
    assert 1e-8 < pass_swing(row(DEEP), load(500))[0] < 2e-6


def test_a_taper_pressed_along_its_axis_carries_evenly() -> None:
    """Q = F/(Z sin α) on every roller, and preload leaves the rings at rest."""
    found = rest(row(TAPER), load(0, 0, 2000))
    assert found.loads == pytest.approx(np.full((1, 1, 17), 2000 / 17 / math.sin(TAPER.contact_angle)), rel=1e-8)
    pressed = preloaded(Row(TAPER), 2000.0)
    assert Rolling((pressed,)).force(np.zeros(5))[2] == pytest.approx(2000.0, rel=1e-9)
