"""A torque given to a port acts from the start of the communication step, not half a step later: exact motion, second
order of stages whose torque follows their speed, energy under torques that jump."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun
from flat import FlatBody, FlatContact, flat_blob

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import PortSpec

DG4, EM, RK45, CENTRAL = 0.0, 1.0, 2.0, 3.0
CONSERVING = {"effect.contact_damping": 0.0, "effect.modal_damping": 0.0, "effect.roll_motion": 0.0}
GIVEN = PortSpec(kind="torque")
GRID, END = 40e-6, 4e-3  # s
STEEP = 10.0  # of a brake: relative change of torque per relative change of speed
TORQUE, SPEED, RATIO = 302.0, 200.0, 24 / 16  # of the pair: N·m and rad/s of the pinion


@pytest.fixture(scope="module")
def pair(relief_spec: Stage, bodies: list[Body]) -> StageModel:
    return assemble(with_ports(relief_spec, {"pinion": GIVEN, "wheel": GIVEN}), bodies)


def turning(pair: StageModel, h: float, speed: float = SPEED, **parameters: float) -> Kernel:
    """The pair in equilibrium under its torques, then at this speed (rad/s) of the pinion."""
    loads = {"pinion.tau": TORQUE, "wheel.tau": TORQUE * RATIO}
    kernel = pair.kernel(**{"level": 1.0, "h": h, **parameters})
    return begun(kernel, loads | {"pinion.w_start": speed, "wheel.w_start": -speed / RATIO})


# ---- a free body: exact ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("integrator", [DG4, EM, RK45, CENTRAL])
def test_a_free_body_moves_by_the_integral_of_the_torque(integrator: float) -> None:
    """m v = Σ F h after every step, for forces that change at random from step to step."""
    none, rows, h, mass = np.zeros(0), np.zeros((1, 0)), 1e-5, 100.0
    body = FlatBody(mass, none, none, rows, np.array([[0.0]]))
    kernel = Kernel(
        flat_blob("plates", [body, body], FlatContact(gap=1.0)), {"h": h, "level": 3.0, "integrator": integrator}
    )
    kernel.initialize()
    pushed = 0.0
    for i, force in enumerate(np.random.default_rng(1).normal(0.0, 300.0, 50)):
        kernel.set("left.tau", force)
        kernel.step(i * h, h)
        pushed += force * h
        assert kernel.get("left.gear.w") * mass == pytest.approx(pushed, abs=1e-9)


# ---- a brake that follows the speed: second order --------------------------------------------------------------------
def braked(pair: StageModel, h: float) -> np.ndarray:
    """Transmission error at every point of GRID. The torque of a step is set for the speed in its middle."""
    kernel, found = turning(pair, h), []
    last = kernel.get("wheel.gear.w")
    for i in range(round(END / h)):
        now = kernel.get("wheel.gear.w")
        speed, last = 1.5 * now - 0.5 * last, now
        kernel.set("wheel.tau", TORQUE * RATIO * (1.0 - STEEP * (speed * RATIO / SPEED + 1.0)))
        kernel.step(i * h, h)
        if (i + 1) % round(GRID / h) == 0:
            found.append(kernel.get("mesh.te"))
    return np.array(found)


def test_a_pair_braked_by_its_speed_is_of_second_order(pair: StageModel) -> None:
    """Between runs at 10 and 2.5 µs, against one at 0.625 µs. With half a step of delay it is 1.3."""
    exact = braked(pair, 0.625e-6)
    errors = [np.sqrt(np.mean((braked(pair, h) - exact) ** 2)) for h in (10e-6, 2.5e-6)]
    order = math.log(errors[0] / errors[1], 4)
    print(f"errors {np.array(errors) / exact.std()} of the ripple, order {order:.2f}")
    assert order > 1.7


# ---- energy ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [1.0, 3.0])
def test_energy_is_kept_under_torques_that_jump(pair: StageModel, level: float) -> None:
    """Undamped, at a frozen position: stored energy changes by the work of the ports and nothing else."""
    h = 5e-6
    kernel = turning(pair, h, 0.0, level=level, **CONSERVING)
    left, stored = [], []
    for i, factor in enumerate(np.random.default_rng(3).uniform(0.5, 1.5, 1000)):
        kernel.set("pinion.tau", TORQUE * factor)
        kernel.set("wheel.tau", TORQUE * RATIO * factor)
        kernel.step(i * h, h)
        left.append(kernel.get("energy.residual"))
        stored.append(kernel.get("energy.stored"))
    print(f"residual {np.ptp(left):.1e} J of {max(stored):.3f} J")
    assert np.ptp(left) < 1e-6 * max(stored) and kernel.get("solver.retried_steps") == 0
