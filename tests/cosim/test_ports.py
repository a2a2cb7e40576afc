"""Ports and logs of drivetrains: two methods, one answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_stage import values

from gearfmu.cosim.masters import KEYS
from gearfmu.cosim.network import Clutch, Inertia, Network, Spring
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.scene_run import drive_of
from gearfmu.cosim.signals import Ramp
from gearfmu.scenefile.scene import load_scene
from gearfmu.stagefile.stage import load_stage


def network(name: str) -> Network:
    return drive_of(load_scene(name), load_stage("fzg_c")).partner(lambda torques: {})


def drivetrain(name: str) -> PyUnit:
    return PyUnit(network(name))


def torques(n: int) -> list[float]:
    """As a stage might give them: smooth, different at both shafts."""
    return [-80.0 + 30.0 * np.sin(0.2 * n), 100.0 - 20.0 * np.cos(0.3 * n)]


def driven(unit: PyUnit, h: float, steps: int) -> np.ndarray:
    """(steps, 8): motion ahead, then port torque work and throughput so far."""
    unit.initialize(0.0)
    unit.hold(torques(0))
    rows, motion = [], np.zeros(6)
    for n in range(steps):
        unit.ahead(n * h, h, motion)
        unit.drive(torques(n), n * h, h)
        rows.append([*motion, *unit.exchanged])
    return np.array(rows)


@pytest.mark.parametrize("name", ["clutch_closure", "pair_loaded"])
def test_products_give_what_steps_give(name):
    """One product a step against save, step, restore, step: the same but for the sources' end values, O(h³). A clutch
    between two idle inertias beside the drivetrain, which never touches it, takes the products away."""
    h, steps, plain = 1e-4, 300, network(name)
    idle = (Inertia("a", 1.0), Inertia("b", 1.0))
    beside = replace(plain, nodes=plain.nodes + idle, clutches=(Clutch("idle", "a", "b", Ramp(((0.0, 1.0),))),))
    a, b = driven(PyUnit(plain), h, steps), driven(PyUnit(beside), h, steps)
    assert np.abs(a - b).max(axis=0) == pytest.approx(np.zeros(8), abs=1e-7 * np.abs(b).max())


def test_ahead_ends_where_the_step_ends():
    """φ + wH + ½aH² is the angle after the step under the held torque, with micro-steps too."""
    for micro_step in (None, 1e-4):
        unit = PyUnit(network("clutch_closure"), micro_step)
        motion, h = np.zeros(6), 1e-3
        unit.initialize(0.0)
        unit.hold([-50.0, 70.0])
        unit.ahead(0.0, h, motion)
        phi, w, a = motion[0::3], motion[1::3], motion[2::3]
        unit.drive([-50.0, 70.0], 0.0, h)
        reached = values(unit, ["pinion.phi", "wheel.phi"])
        assert reached == pytest.approx(phi + w * h + 0.5 * a * h**2, rel=1e-12)


def clutch_network() -> Network:
    """An inertia behind a clutch that locks after some milliseconds."""
    return Network(
        (Inertia("in", 0.1, w=20.0), Inertia("out", 0.2)),
        (Spring("ground", {"out": 1.0}, 500.0, 0.3),),
        (Clutch("clutch", "in", "out", Ramp(((0.0, 0.0), (5e-3, 300.0)))),),
        torque_ports={"in": "in"},
    )


@pytest.mark.parametrize("kind", ["car", "rig", "clutch"])
def test_the_motion_of_the_ports_is_that_of_the_log(kind):
    """φ, w, a at every instant, through stick and slip and sources."""
    unit = {
        "car": lambda: drivetrain("clutch_closure"),
        "rig": lambda: drivetrain("pair_light"),
        "clutch": lambda: PyUnit(clutch_network()),
    }[kind]()
    log = unit.log([f"{port}.{key}" for port in unit.ports for key in KEYS], 50)
    rows: np.ndarray = np.zeros((50, 3 * len(unit.ports)))
    unit.initialize(0.0)
    for n in range(50):
        log.take()
        unit.now(rows[n])
        unit.step(n * 2e-4, 2e-4)
    assert kind != "clutch" or unit.state.events
    scale = np.abs(rows).max(axis=0)
    assert np.all(np.abs(log.rows() - rows) <= 1e-12 * (1.0 + scale))  # accelerations: rounding of terms that cancel
