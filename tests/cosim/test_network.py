"""Networks against closed forms: free vibration, backlash, prescribed motion, sources; saved states; errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analytic_stage import R1, R2, Plant, energy_of
from scipy.linalg import eigh

from gearfmu.cosim.network import Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Ramp
from gearfmu.errors import CouplingError


def started(network: Network, micro_step: float | None = None) -> PyUnit:
    unit = PyUnit(network, micro_step)
    unit.initialize(0.0)
    return unit


def chain(n: int, **first) -> Network:
    names = [f"j{k}" for k in range(n)]
    nodes = (Inertia(names[0], 0.1, **first), *(Inertia(name, 0.1 * (k + 2)) for k, name in enumerate(names[1:])))
    return Network(
        nodes, tuple(Spring(f"s{k}", {names[k]: 1.0, names[k + 1]: -1.0}, 1000.0 * (k + 1)) for k in range(n - 1))
    )


def test_free_vibration_equals_the_sum_of_eigenmodes():
    """Five inertias, one long step of 0.7 s: speeds as by the generalised eigenproblem."""
    network, t = chain(5, w=3.0), 0.7
    unit = started(network)
    unit.step(0.0, t)
    mass = np.diag([node.inertia for node in network.nodes])
    rows = unit.dynamics.extension
    stiffness = rows.T @ np.diag([spring.k for spring in network.springs]) @ rows
    values, modes = eigh(stiffness, mass)
    omega = np.sqrt(np.maximum(values, 0.0))
    omega[0] = 0.0
    speed = modes @ (np.cos(omega * t) * (modes.T @ mass @ np.array([3.0, 0, 0, 0, 0])))
    assert np.allclose(unit.get(unit.resolve([f"j{k}.w" for k in range(5)])), speed, rtol=0, atol=1e-11)


def test_dual_mass_flywheel_frequency_and_damping():
    """Two inertias and a damped spring: decay and frequency of the relative motion."""
    j1, j2, k, c = 0.16, 0.06, 573.0, 1.0
    network = Network((Inertia("a", j1, w=2.0), Inertia("b", j2)), (Spring("dmf", {"a": 1.0, "b": -1.0}, k, c),))
    unit, t = started(network), 0.043
    unit.step(0.0, t)
    sigma, omega = 0.5 * c * (1 / j1 + 1 / j2), math.sqrt(k * (1 / j1 + 1 / j2))
    damped = math.sqrt(omega**2 - sigma**2)
    assert unit.get(unit.resolve(["dmf.extension"]))[0] == pytest.approx(
        2.0 / damped * math.exp(-sigma * t) * math.sin(damped * t), abs=1e-14
    )


def rattle(speed: float, j1: float = 0.001, j2: float = 0.004, k: float = 2e8, backlash: float = 1e-4) -> Network:
    return Network(
        (Inertia("g1", j1, w=speed), Inertia("g2", j2)), (Spring("mesh", {"g1": R1, "g2": R2}, k, backlash=backlash),)
    )


def test_rattle_between_two_flanks_has_the_closed_form_period():
    """Free flight j/(r w) and half a contact period, forever: every impact at its instant, energy to 1e-9 after 400
    impacts."""
    speed, j1, j2, k, backlash = 10.0, 0.001, 0.004, 2e8, 1e-4
    unit = started(rattle(speed, j1, j2, k, backlash), micro_step=2e-5)
    contact, flight = math.pi / math.sqrt(k * (R1**2 / j1 + R2**2 / j2)), backlash / (R1 * speed)
    before = energy_of(unit)
    for n in range(200):
        unit.step(n * 1e-3, 1e-3)
    closed = [event for event in unit.state.events if event.what != "open"]
    closings, flanks = [event.time for event in closed], [event.what for event in closed]
    assert len(closings) > 400 and set(flanks[::2]) == {"drive"} and set(flanks[1::2]) == {"coast"}
    assert np.allclose(closings, closings[0] + (contact + flight) * np.arange(len(closings)), rtol=0, atol=1e-9)
    assert energy_of(unit) == pytest.approx(before, rel=1e-9)


def behind_a_driven_end() -> Network:
    return Network(
        (Driven("out"), Inertia("gear", 0.01)),
        (Spring("shaft", {"out": 1.0, "gear": -1.0}, 100.0),),
        motion_ports={"pinion": "out"},
    )


def test_prescribed_motion_through_a_spring_has_its_closed_form():
    """Constant acceleration of the outer end: torque k·e with e'' = a − (k/J) e, and the mean torque is the momentum
    over the step."""
    unit = PyUnit(behind_a_driven_end())
    unit.set(unit.resolve(["pinion.phi", "pinion.w", "pinion.a"]), [0.0, 0.0, 5.0])
    unit.initialize(0.0)
    unit.step(0.0, 0.02)
    omega = 100.0
    tau, mean, speed, work = unit.get(unit.resolve(["pinion.tau", "pinion.tau_mean", "gear.w", "energy.work"]))
    assert tau == pytest.approx(-100.0 * 5.0 / omega**2 * (1 - math.cos(omega * 0.02)), abs=1e-12)
    assert -mean * 0.02 == pytest.approx(0.01 * speed, abs=1e-14)
    assert work > 0.0


def test_a_jump_of_the_given_angle_is_blended_over_the_step():
    """The node arrives at the given angle's path at the end of the step; energy.work is the energy that came in."""
    unit = started(behind_a_driven_end(), micro_step=1e-6)
    unit.set(unit.resolve(["pinion.phi", "pinion.w", "pinion.a"]), [0.01, 2.0, 0.0])
    unit.step(0.0, 1e-3)
    phi, work = unit.get(unit.resolve(["out.phi", "energy.work"]))
    assert phi == pytest.approx(0.01 + 2.0 * 1e-3, abs=1e-15)
    assert work == pytest.approx(energy_of(unit), rel=1e-6)


def test_sources_converge_with_second_order():
    """A pendulum: torque −sin φ, against half the step."""

    def angle(h):
        unit = started(
            Network((Inertia("j", 1.0, w=1.5),), sources=(Source("g", "j", lambda t, phi, w: -math.sin(phi)),))
        )
        for n in range(round(2.0 / h)):
            unit.step(n * h, h)
        return unit.get(unit.resolve(["j.phi"]))[0]

    fine = angle(1 / 512)
    errors = [abs(angle(h) - fine) for h in (1 / 8, 1 / 16, 1 / 32)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(rates - 2.0) < 0.15), rates


def test_restored_state_gives_the_same_bits():
    """Chain with clutch and backlash: save, go on, restore, go on again, also in a second unit of the same network."""
    plant = Plant(chain=True, backlash=1e-4, capacity=Ramp(((0.0, 0.0), (0.02, 150.0))), engine_w=180.0, ripple=120.0)
    names = ["engine.phi", "gear1.w", "mesh.tau", "clutch.slip", "clutch.locked", "energy.stored"]
    unit, other = started(plant.monolithic(), plant.micro_step), started(plant.monolithic(), plant.micro_step)
    handle, step = unit.resolve(names), 1e-4
    for n in range(150):
        unit.step(n * step, step)
    state = unit.save()

    def onward(u: PyUnit) -> bytes:
        rows = []
        for n in range(150, 300):
            u.step(n * step, step)
            rows.append(u.get(u.resolve(names)).tobytes())
        return b"".join(rows)

    first = onward(unit)
    events = unit.state.events
    unit.restore(state)
    assert unit.state.events == tuple(event for event in events if event.time <= 0.015)
    assert onward(unit) == first and unit.state.events == events
    other.restore(state)
    assert onward(other) == first
    assert len(unit.get(handle)) == len(names)


def test_unknown_variables_and_outputs_as_inputs_are_refused():
    unit = started(chain(2))
    with pytest.raises(CouplingError, match="no variable nonsense"):
        unit.resolve(["nonsense", "j0.w"])
    with pytest.raises(CouplingError, match="are inputs"):
        unit.set(unit.resolve(["j0.w"]), [1.0])
