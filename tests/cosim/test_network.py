"""Networks against closed forms: free vibration, constant speed, sources; saved states; errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analytic_stage import Plant, values
from scipy.linalg import eigh

from gearfmu.cosim.network import Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Ramp


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
    squares, modes = eigh(stiffness, mass)
    omega = np.sqrt(np.maximum(squares, 0.0))
    omega[0] = 0.0
    speed = modes @ (np.cos(omega * t) * (modes.T @ mass @ np.array([3.0, 0, 0, 0, 0])))
    assert np.allclose(values(unit, [f"j{k}.w" for k in range(5)]), speed, rtol=0, atol=1e-11)


def test_dual_mass_flywheel_frequency_and_damping():
    """Two inertias and a damped spring: decay and frequency of the relative motion."""
    j1, j2, k, c = 0.16, 0.06, 573.0, 1.0
    network = Network((Inertia("a", j1, w=2.0), Inertia("b", j2)), (Spring("dmf", {"a": 1.0, "b": -1.0}, k, c),))
    unit, t = started(network), 0.043
    unit.step(0.0, t)
    sigma, omega = 0.5 * c * (1 / j1 + 1 / j2), math.sqrt(k * (1 / j1 + 1 / j2))
    damped = math.sqrt(omega**2 - sigma**2)
    assert values(unit, ["dmf.extension"])[0] == pytest.approx(
        2.0 / damped * math.exp(-sigma * t) * math.sin(damped * t), abs=1e-14
    )


def test_a_shaft_of_constant_speed_has_its_closed_form():
    """Torque k·e with e'' = −(k/J) e, and the mean torque is the momentum over the step."""
    network = Network(
        (Driven("out", w=3.0), Inertia("gear", 0.01)), (Spring("shaft", {"out": 1.0, "gear": -1.0}, 100.0),)
    )
    unit, omega, h = started(network), 100.0, 0.02
    unit.step(0.0, h)
    tau, mean, speed = values(unit, ["out.tau", "out.tau_mean", "gear.w"])
    assert tau == pytest.approx(-100.0 * 3.0 / omega * math.sin(omega * h), abs=1e-12)
    assert -mean * h == pytest.approx(0.01 * speed, abs=1e-14)


def test_sources_converge_with_second_order():
    """A pendulum: torque −sin φ, against half the step."""

    def angle(h):
        unit = started(
            Network((Inertia("j", 1.0, w=1.5),), sources=(Source("g", "j", lambda t, phi, w: -math.sin(phi)),))
        )
        for n in range(round(2.0 / h)):
            unit.step(n * h, h)
        return values(unit, ["j.phi"])[0]

    fine = angle(1 / 512)
    errors = [abs(angle(h) - fine) for h in (1 / 8, 1 / 16, 1 / 32)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(rates - 2.0) < 0.15), rates


def test_restored_state_gives_the_same_bits():
    """Chain with clutch: save, go on, restore, go on again, also in a second unit of the same network."""
    plant = Plant(chain=True, capacity=Ramp(((0.0, 0.0), (0.02, 150.0))), engine_w=180.0, ripple=120.0)
    names = ["engine.phi", "gear1.w", "mesh.tau", "clutch.slip", "clutch.locked", "energy.stored"]
    unit, other = started(plant.monolithic(), plant.micro_step), started(plant.monolithic(), plant.micro_step)
    step = 1e-4
    for n in range(150):
        unit.step(n * step, step)
    state = unit.save()

    def onward(u: PyUnit) -> bytes:
        rows = []
        for n in range(150, 300):
            u.step(n * step, step)
            rows.append(values(u, names).tobytes())
        return b"".join(rows)

    first = onward(unit)
    events = unit.state.events
    unit.restore(state)
    assert unit.state.events == tuple(event for event in events if event.time <= 0.015)
    assert onward(unit) == first and unit.state.events == events
    other.restore(state)
    assert onward(other) == first
