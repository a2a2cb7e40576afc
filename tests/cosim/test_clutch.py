"""Dry clutches against closed forms: when they lock, when they break loose, what they transmit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analytic_stage import Plant, Smooth, energy_of, values
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from gearfmu.cosim.events import sticking_torques
from gearfmu.cosim.network import Clutch, Driven, Inertia, Network, Source, Spring
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Ramp

J1, J2 = 0.2, 0.7
BOTH = 1 / J1 + 1 / J2


def two_inertias(capacity, torque=lambda t, phi, w: 0.0, w1=0.0, w2=0.0, peak=1.0) -> PyUnit:
    network = Network(
        (Inertia("a", J1, w=w1), Inertia("b", J2, w=w2)),
        clutches=(Clutch("clutch", "a", "b", capacity, peak),),
        sources=(Source("drive", "a", torque),),
    )
    unit = PyUnit(network)
    unit.initialize(0.0)
    return unit


def constant(capacity: float) -> Ramp:
    return Ramp(((0.0, capacity),))


def advance(unit: PyUnit, h: float, steps: int) -> None:
    for n in range(steps):
        unit.step(n * h, h)


@pytest.mark.parametrize("slip", [52.0, -52.0])
def test_constant_capacity_locks_at_the_closed_form_instant(slip):
    """Lock after Δw / (T (1/J1 + 1/J2)), at the speed of conserved momentum; then T_stick = T_drive J2 / (J1 + J2)."""
    capacity, drive = 40.0, 7.0
    unit = two_inertias(constant(capacity), lambda t, phi, w: drive, w1=slip)
    sign = math.copysign(1.0, slip)
    instant = abs(slip) / (capacity * BOTH - sign * drive / J1)
    advance(unit, 1e-2, 100)
    assert [(event.part, event.what) for event in unit.state.events] == [("clutch", "lock")]
    assert unit.state.events[0].time == pytest.approx(instant, abs=1e-13)
    speed, slip_now, torque, locked = values(unit, ["a.w", "clutch.slip", "clutch.tau", "clutch.locked"])
    assert speed == pytest.approx((J1 * slip + drive * 1.0) / (J1 + J2), abs=1e-11)
    assert abs(slip_now) < 1e-13 and locked == 1.0
    assert torque == pytest.approx(drive * J2 / (J1 + J2), abs=1e-12)


@pytest.mark.parametrize(
    ("points", "slip", "instant"),
    [
        (((0.0, 0.0), (1.0, 900.0)), 30.0, math.sqrt(2 * 30.0 / (900.0 * BOTH))),  # slip Δw − r t²/2 (1/J1 + 1/J2)
        (((0.1, 0.0), (0.1, 20.0)), 10.0, 0.1 + 10.0 / (20.0 * BOTH)),  # nothing before a jump
    ],
    ids=["ramp", "jump"],
)
def test_changing_capacity_locks_at_the_closed_form_instant(points, slip, instant):
    unit = two_inertias(Ramp(points), w1=slip)
    advance(unit, 1e-2, 100)
    assert unit.state.events[0].time == pytest.approx(instant, abs=1e-12)


@pytest.mark.parametrize("peak", [1.0, 1.3])
def test_breaks_loose_when_the_sticking_torque_exceeds_the_static_capacity(peak):
    """Drive torque r t: sticks until r t J2/(J1+J2) = peak·T; afterwards J2 accelerates with T."""
    rate, capacity = 200.0, 25.0
    unit = two_inertias(constant(capacity), lambda t, phi, w: rate * t, peak=peak)
    advance(unit, 7e-3, 50)
    instant = peak * capacity * (J1 + J2) / (J2 * rate)
    assert [event.what for event in unit.state.events] == ["slip"]
    rounding = 1e-10  # TORQUE_TOLERANCE over the rate of the torque
    assert unit.state.events[0].time == pytest.approx(instant, abs=rounding)
    expected = 0.5 * rate * instant**2 / (J1 + J2) + capacity / J2 * (0.35 - instant)
    assert values(unit, ["b.w"])[0] == pytest.approx(expected, abs=1e-8)


def test_sticks_through_a_reversal_of_torque_and_slips_both_ways():
    """±60 N·m, 1 Hz, against 30 N·m: slips forward, sticks, slips backward, as often as the drive turns over."""
    unit = two_inertias(constant(30.0), lambda t, phi, w: 60.0 * math.sin(2 * math.pi * t))
    advance(unit, 1e-3, 3000)
    assert [event.what for event in unit.state.events] == ["slip", "lock"] * 5 + ["slip"]
    loose = [event.time for event in unit.state.events[::2]]
    assert loose[0] == pytest.approx(math.asin(30.0 * (J1 + J2) / J2 / 60.0) / (2 * math.pi), abs=1e-6)


@settings(max_examples=30)
@given(
    speeds=st.lists(st.floats(-50, 50), min_size=4, max_size=4),
    capacities=st.lists(st.floats(0.0, 40.0), min_size=3, max_size=3),
    stiffness=st.floats(10.0, 1e4),
)
@example(speeds=[3.25, 0.0, -0.875, 23.0], capacities=[40.0, 30.0, 0.0], stiffness=9366.0)
def test_energy_never_grows_and_momentum_stays(speeds, capacities, stiffness):
    """Four inertias, three clutches and a spring around them, no torque from outside. Micro-steps of a twentieth: in
    the example a slip comes back after a third of a step, which a unit without them does not see (4e-8 of the energy).
    """
    names = ("a", "b", "c", "d")
    network = Network(
        tuple(Inertia(name, 0.1 + 0.2 * k, w=w) for k, (name, w) in enumerate(zip(names, speeds, strict=True))),
        springs=(Spring("spring", {"a": 1.0, "d": -1.0}, stiffness),),
        clutches=tuple(Clutch(f"clutch{k}", names[k], names[k + 1], constant(c)) for k, c in enumerate(capacities)),
    )
    unit = PyUnit(network, micro_step=5e-5)
    unit.initialize(0.0)
    log = unit.log(["energy.stored", *(f"{name}.w" for name in names), *(f"clutch{k}.tau" for k in range(3))], 40)
    inertias = np.array([node.inertia for node in network.nodes])
    energy, momentum, scale = energy_of(unit), inertias @ speeds, 1.0 + np.abs(inertias * speeds).sum()
    for n in range(40):
        unit.step(n * 1e-3, 1e-3)
        log.take()
    for row in log.rows():
        assert row[0] <= energy * (1 + 1e-10) + 1e-12
        assert abs(inertias @ row[1:5] - momentum) < 1e-10 * scale
        assert np.all(np.abs(row[5:]) <= np.array(capacities) * (1 + 1e-9) + 1e-9)
        energy = row[0]


@settings(max_examples=100)
@given(
    entries=st.lists(st.floats(-1, 1), min_size=16, max_size=16),
    wanted=st.lists(st.floats(-100, 100), min_size=4, max_size=4),
    bound=st.lists(st.floats(0, 20), min_size=4, max_size=4),
)
def test_sticking_torques_solve_the_complementarity_problem(entries, wanted, bound):
    """Inside the bounds the slip acceleration is zero; at a bound it points the way of the torque."""
    a = np.array(entries).reshape(4, 4)
    delassus, wanted, bound = a @ a.T + 0.5 * np.eye(4), np.array(wanted), np.array(bound)
    torque = sticking_torques(delassus, wanted, bound)
    left = wanted - delassus @ torque
    assert np.all(np.abs(torque) <= bound)
    inside = np.abs(torque) < bound * (1 - 1e-12)
    tolerance = 1e-9 * (1 + np.abs(wanted).max())
    assert np.all(np.abs(left[inside]) < tolerance)
    assert np.all(left[~inside] * np.sign(torque[~inside]) > -tolerance)


def test_a_smooth_capacity_converges_with_second_order():
    """Capacity is taken linear over a step."""

    def final(h):
        unit = two_inertias(Smooth(lambda t: 30.0 * (1 + math.sin(9 * t))), w1=400.0)
        advance(unit, h, round(0.2 / h))
        return values(unit, ["a.w"])[0]

    exact = 400.0 - 30.0 * (0.2 + (1 - math.cos(1.8)) / 9) / J1
    errors = [abs(final(h) - exact) for h in (0.04, 0.02, 0.01)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05) and errors[1] / errors[2] == pytest.approx(
        4.0, rel=0.05
    )


# ---- networks against closed forms: free vibration, constant speed, sources; saved states ----------------------------
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
