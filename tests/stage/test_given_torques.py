"""A torque given to a port acts from the start of the communication step, not half a step later: exact motion, energy
under torques that jump. Order where a torque follows a speed: tests/cosim/test_wiring.py."""

from __future__ import annotations

import numpy as np
import pytest
from driven import begun, give, stepped
from flat import FlatContact, flat_blob, rigid_block

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
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
