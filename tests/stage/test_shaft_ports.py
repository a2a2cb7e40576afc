"""A torque given to a port acts from the start of the communication step, not half a step later: exact motion, energy
under torques that jump. Order where a torque follows a speed: tests/cosim/test_wiring.py. A port spring with play
(gk_row_play.c): exact motion of a body that bounces between its sides, order of the step, energy, and a loaded side,
which is a spring without play."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun, give, stepped
from flat import FlatContact, flat_blob, rigid_block

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import PortSpec

DG4, EM, RK45, CENTRAL = 0.0, 1.0, 2.0, 3.0
CONSERVING = {"effect.contact_damping": 0.0, "effect.modal_damping": 0.0, "effect.roll_motion": 0.0}
GIVEN = PortSpec(kind="torque")
TORQUE, RATIO = 302.0, 24 / 16  # of the pair: N·m of the pinion


@pytest.fixture(scope="module")
def pair(relief_spec: Stage, bodies: list[Body]) -> StageModel:
    return assemble(with_ports(relief_spec, {"pinion": GIVEN, "wheel": GIVEN}), bodies)


# ---- a free body: exact ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("integrator", [DG4, EM, RK45, CENTRAL])
def test_a_free_body_moves_by_the_integral_of_the_torque(integrator: float) -> None:
    """m v = Σ F h after every step, for forces that change at random from step to step."""
    h, mass = 1e-5, 100.0
    plates = flat_blob("plates", [rigid_block(mass)] * 2, FlatContact(gap=1.0))
    kernel = Kernel(plates, {"h": h, "level": 3.0, "integrator": integrator})
    kernel.initialize()
    force = np.random.default_rng(1).normal(0.0, 300.0, 50)
    speed = stepped(kernel, len(force), h, "left.gear.w", before=lambda i: kernel.set("left.tau", force[i]))[:, 0]
    assert speed * mass == pytest.approx(np.cumsum(force) * h, abs=1e-9)


# ---- energy ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [1.0, 3.0])
def test_energy_is_kept_under_torques_that_jump(pair: StageModel, level: float) -> None:
    """Undamped, at a frozen position: stored energy changes by the work of the ports and nothing else."""
    h = 5e-6
    loads = {"pinion.tau": TORQUE, "wheel.tau": TORQUE * RATIO}
    kernel = begun(pair.kernel(level=level, h=h, **CONSERVING), loads)
    factors = np.random.default_rng(3).uniform(0.5, 1.5, 1000)
    jump = lambda i: give(kernel, {name: load * factors[i] for name, load in loads.items()})  # noqa: E731
    left, stored = stepped(kernel, len(factors), h, "energy.residual", "energy.stored", before=jump).T
    assert np.ptp(left) < 1e-6 * max(stored) and kernel.get("solver.retried_steps") == 0


# ---- a spring with play ----------------------------------------------------------------------------------------------
MASS, K, PLAY, SPEED = 2.0, 8e6, 4e-4, 0.5  # kg, N/m, m, m/s: a flat stage's spins are translations
PERIOD = 2 * PLAY / SPEED + 2 * math.pi * math.sqrt(MASS / K)  # there and back: two flights, two half periods


def plate(play: float, h: float, c: float = 0.0, **parameters: float) -> Kernel:
    """A rigid body on a spring with play, another that it never meets."""
    sections = dict(read_blob(flat_blob("plates", [rigid_block(MASS)] * 2, FlatContact(gap=1.0))))
    sections["port_kinds"] = np.array([[0, 0, 0], [1, 1, 0]], np.int32)
    sections["ports"] = np.array([[K, c, 1.0, 1.0, 1.0, 0.0], [1.0, 0.0, 1.0, 1.0, 1.0, 0.0]])
    if play:
        sections["port_play"] = np.array([play, 0.0])
    return Kernel(write_blob(sections), {"h": h, "level": 3.0, **parameters})


def bounced(h: float, end: float, c: float = 0.0, play: float = PLAY, **parameters: float) -> np.ndarray:
    """Place (m) and speed (m/s) of the body after every step, (n, 2): thrown from the middle, its outer end held."""
    kernel = begun(plate(play, h, c, **parameters), {"left.w": SPEED})
    kernel.set("left.w", 0.0)
    return stepped(kernel, round(end / h), h, "left.gear.phi", "left.gear.w")


def exact(time: np.ndarray) -> np.ndarray:
    """Place (m) of the body at `time`, by flights and half sines."""
    flight, half = PLAY / SPEED, math.pi * math.sqrt(MASS / K)
    phase = (np.asarray(time) + 0.5 * flight) % (2 * (flight + half))
    way, sign = phase % (flight + half), np.where(phase < flight + half, 1.0, -1.0)
    deep = SPEED * half / math.pi * np.sin(math.pi * np.clip(way - flight, 0.0, half) / half)
    return sign * (np.minimum(SPEED * way, PLAY) - 0.5 * PLAY + deep)


@pytest.mark.parametrize("integrator", [DG4, EM, RK45])
def test_a_body_bounces_between_the_sides_as_flights_and_half_sines(integrator: float) -> None:
    h, end = 5e-6, 3 * PERIOD
    found = bounced(h, end, integrator=integrator)
    time = h * np.arange(1, len(found) + 1)
    assert np.abs(found[:, 0] - exact(time)).max() < 5e-3 * PLAY
    assert np.abs(found[:, 1]).max() == pytest.approx(SPEED, rel=1e-3)


def test_bouncing_is_of_second_order_and_keeps_its_energy() -> None:
    errors = []
    for h in (10e-6, 5e-6, 2.5e-6):
        found = bounced(h, 3 * PERIOD)
        time = h * np.arange(1, len(found) + 1)
        errors.append(np.abs(found[:, 0] - exact(time)).max())
        flying = np.abs(found[:, 0]) < 0.4 * PLAY
        assert np.abs(found[flying, 1]) == pytest.approx(SPEED, rel=1e-12), "no energy is lost or won at a side"
    assert math.log(errors[0] / errors[-1], 4) > 1.8


def test_a_damper_takes_energy_only_while_a_side_is_closed() -> None:
    """Logarithmic decrement of half a period: exp(−π ζ/√(1 − ζ²)) at every bounce, to the first order in ζ."""
    zeta, h = 0.02, 2e-6
    found = bounced(h, 2.2 * PERIOD, c=2 * zeta * math.sqrt(K * MASS))
    flying = np.abs(found[:, 0]) < 0.4 * PLAY
    speeds = np.unique(np.round(np.abs(found[flying, 1]), 6))[::-1]
    assert speeds[0] == pytest.approx(SPEED, rel=1e-6) and len(speeds) == 5
    assert speeds[1:] / speeds[:-1] == pytest.approx(math.exp(-math.pi * zeta), rel=3e-3)


def test_an_outer_end_within_the_play_carries_no_torque() -> None:
    kernel = begun(plate(PLAY, 5e-6), {"left.phi": 0.4 * PLAY})
    assert kernel.get("left.tau") == 0.0 and abs(kernel.get("left.gear.phi") - 0.4 * PLAY) <= 0.5 * PLAY
