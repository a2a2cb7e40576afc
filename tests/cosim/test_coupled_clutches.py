"""Modelica Standard Library, Rotational.Examples.CoupledClutches: three clutches in a row, against a converged Dymola
result."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from analytic_stage import Smooth, values

from gearfmu.cosim.network import Clutch, Inertia, Network, Source
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.cosim.signals import Ramp

FACTS = json.loads((Path(__file__).parent.parent / "reference" / "coupled_clutches.json").read_text())[
    "coupled_clutches"
]
MU, PEAK, FORCE = FACTS["params"]["mu"], FACTS["params"]["peak"], FACTS["params"]["fn_max"]


def coupled_clutches() -> Network:
    closing = Smooth(lambda t: max(MU * FORCE * math.cos(0.4 * math.pi * t), 0.0))
    steps = [Ramp(((at, 0.0), (at, MU * FORCE))) for at in (0.4, 0.9)]
    names = ("J1", "J2", "J3", "J4")
    return Network(
        nodes=tuple(Inertia(name, 1.0, w=w) for name, w in zip(names, FACTS["params"]["w0"], strict=True)),
        clutches=tuple(
            Clutch(f"clutch{k + 1}", names[k], names[k + 1], capacity, PEAK)
            for k, capacity in enumerate((closing, *steps))
        ),
        sources=(Source("torque", "J1", lambda t, phi, w: 10.0 * math.sin(10.0 * math.pi * t)),),
    )


@pytest.fixture(scope="module")
def run() -> tuple[PyUnit, dict[str, list[float]]]:
    unit, h, samples = PyUnit(coupled_clutches()), 1e-3, {}
    unit.initialize(0.0)
    speeds = [f"J{k}.w" for k in (1, 2, 3, 4)]
    for n in range(1500):
        unit.step(n * h, h)
        for label in FACTS["samples"]:
            if abs((n + 1) * h - float(label)) < 1e-9:
                samples[label] = list(values(unit, speeds))
    return unit, samples


def test_events_within_1e_4_s(run):
    """Every lock and slip that Dymola reports happens, at its instant."""
    events = run[0].state.events
    expected = [
        ("clutch1", "lock", "clutch1_lock"),
        ("clutch1", "slip", "clutch1_slip"),
        ("clutch1", "lock", "clutch1_lock2"),
        ("clutch1", "slip", "clutch1_slip2"),
        ("clutch2", "lock", "clutch2_lock"),
        ("clutch3", "lock", "clutch3_lock"),
    ]
    for part, what, key in expected:
        times = [event.time for event in events if (event.part, event.what) == (part, what)]
        assert min(abs(time - FACTS["events_dymola"][key]) for time in times) < 1e-4, (key, times)


def test_nothing_else_happens(run):
    """Between 0.4 s and 1.25 s there are exactly the events of the reference."""
    after = [(event.part, event.what) for event in run[0].state.events if 0.5 < event.time < 1.25]
    assert after == [
        ("clutch2", "lock"),
        ("clutch1", "lock"),
        ("clutch1", "slip"),
        ("clutch1", "lock"),
        ("clutch1", "slip"),
        ("clutch3", "lock"),
    ]


def test_speeds_within_1e_4(run):
    for label, expected in FACTS["samples"].items():
        for k, (got, want) in enumerate(zip(run[1][label], expected, strict=True)):
            assert abs(got - want) < 1e-4, (label, k, got, want)
