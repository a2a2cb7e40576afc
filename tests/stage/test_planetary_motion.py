"""The planetary set in motion: what the turning axes of the carrier do to the masses in them (docs/theory.md, 3.10)."""

from __future__ import annotations

import numpy as np
import pytest
from driven import begun, stepped

from gearfmu.body import load_bodies
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.stage import load_stage

H, STEP = 5e-6, 2e-5


def turning(model: StageModel, torque: float, carrier: float, **parameters: float) -> Kernel:
    """At rest under `torque` (N·m) on the carrier, the sun's in balance, then at these speeds (rad/s) of rolling."""
    kernel = model.kernel(**{"level": 0.0, "h": H, **parameters})
    loads = {"carrier.tau": torque, "sun.tau": -torque / 4}
    return begun(kernel, loads | {"carrier.w_start": carrier, "sun.w_start": 4 * carrier})


def test_pins_hold_the_planets_against_their_centrifugal_load(planetary: StageModel) -> None:
    """m a Ω² outward, at once and exactly: the set is unloaded, no mesh touches."""
    planet, radius, speed = load_bodies(load_stage("planetary54"))[1], 0.045, 85.0
    load = planet.total_mass * radius * speed**2
    for on in (1.0, 0.0):
        kernel = turning(planetary, 0.0, speed, **{"effect.centrifugal": on})
        outward = [kernel.get("pin.planet1.fx"), kernel.get("pin.planet2.fy"), -kernel.get("pin.planet3.fx")]
        assert outward == pytest.approx([on * load] * 3, rel=1e-9, abs=1e-9)
        across = [kernel.get("pin.planet1.fy"), kernel.get("pin.planet2.fx")]
        assert across == pytest.approx([0.0, 0.0], abs=1e-6 * load)


def test_two_integrators_see_the_same_set(planetary: StageModel) -> None:
    """The step with its rotation in half steps, and the explicit peer with the same forces as accelerations, at one
    step: pairs of the ring end with their flanks, and when that is seen depends on the step (0.8 % from 0.5 to
    0.25 µs on either method). Coriolis forces are 7 % of a pin's ripple at 300 rad/s, the methods differ by 0.2 %."""
    names = ("sun_planet1.te", "pin.planet1.fx")
    methods = {}
    for name, settings in {
        "dg4": {"h": 5e-7},
        "central": {"h": 5e-7, "integrator": 3.0},
        "without": {"h": 5e-7, "effect.coriolis": 0.0},
    }.items():
        kernel = turning(planetary, 600.0, 300.0, **{"effect.contact_damping": 0.0, **settings})
        methods[name] = stepped(kernel, 20, STEP, *names)
    swing = methods["dg4"].std(axis=0)
    apart = {name: np.sqrt(((method - methods["dg4"]) ** 2).mean(axis=0)) / swing for name, method in methods.items()}
    assert np.all(apart["central"] < 3e-3) and np.all(apart["without"] > 5e-3)


def test_the_load_of_an_uneven_set_turns_with_the_carrier() -> None:
    """One pin out of its place: what the sun's bearing carries keeps its size and turns by the carrier's angle."""
    spec = load_stage("planetary54/stage_pin_error")
    kernel = turning(assemble(spec, load_bodies(spec)), 600.0, 85.0, h=1e-5)
    found = stepped(kernel, 800, STEP, "bearing.sun.fx", "bearing.sun.fy", "carrier.gear.phi")
    own = (found[:, 0] + 1j * found[:, 1]) * np.exp(-1j * found[:, 2])
    early, late = own[100:300].mean(), own[600:].mean()
    assert found[-1, 2] > 1.2 and abs(early) > 20.0
    assert abs(late - early) < 0.05 * abs(early)
