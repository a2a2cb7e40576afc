"""Saved states: bitwise over a thousand rollbacks, in a fresh process, with other parameters; not from damage."""

from __future__ import annotations

import ctypes
import json
import math
import random
import subprocess
import sys

import pytest
from fmpy.fmi2 import fmi2FMUstate
from small_stage import references

from evidence.fmu_probes.probes import DISCARD, ERROR, OK, Subject

FRESH = """
import json, sys
from evidence.fmu_probes.probes import Subject
subject = Subject(sys.argv[1])
state = subject.fmu.deSerializeFMUstate(bytes.fromhex(sys.stdin.readline().strip()))
subject.fmu.setFMUstate(state)
subject.time = int(sys.argv[2])
print(json.dumps([subject.run(1).hex() for _ in range(int(sys.argv[3]))]))
"""


@pytest.fixture(scope="module")
def history(unpacked) -> list[bytes]:
    """Bits of all outputs after each of the first 60 steps of a plain run."""
    subject = Subject(unpacked).initialized()
    bits = [subject.run(1) for _ in range(60)]
    subject.close()
    return bits


def driven(subject: Subject, steps: int = 1) -> bytes:
    """Outputs of `steps` steps under inputs that follow from the number of the step alone: the torque reverses, so that
    the teeth part and meet again, and a clutch is opened and closed."""
    there = {v.name: v.valueReference for v in subject.variables if v.causality == "input"}
    bits = b""
    for _ in range(steps):
        t = subject.time * subject.step_size
        swing = 0.01 * math.sin(2 * math.pi * 450 * t)
        inputs = {
            "pinion.phi": 300 * t + swing,
            "pinion.w": 300.0,
            "wheel.phi": -200 * t,
            "wheel.w": -200.0,
            "pinion.clutch.capacity": 150.0 if math.sin(2 * math.pi * 300 * t) > 0 else 1.0,
        }
        for name in there.keys() & inputs:
            subject.fmu.setReal([there[name]], [inputs[name]])
        bits += subject.run(1)
    return bits


@pytest.fixture(scope="module", params=["pair", "clutch"])
def rig(request, unpacked, unpacked_chain) -> tuple[str, list[bytes]]:
    """Folder of an FMU and the bits of its outputs after each of 80 driven steps."""
    folder = unpacked if request.param == "pair" else unpacked_chain
    subject, seen = Subject(folder).initialized(), set()
    events = [v for v in subject.variables if v.name in ("mesh.contact", "pinion.clutch.locked")]
    bits = []
    for _ in range(80):
        bits.append(driven(subject))
        for v in events:
            read = subject.fmu.getBoolean if v.type == "Boolean" else subject.fmu.getInteger
            seen.add((v.name, bool(read([v.valueReference])[0])))
    assert len(seen) == 2 * len(events), f"teeth and clutch open and close: {seen}"
    subject.close()
    return folder, bits


def test_a_thousand_random_rollbacks(rig):
    folder, history = rig
    dice = random.Random(1)
    subject = Subject(folder).initialized()
    saved = {0: subject.fmu.getFMUstate()}
    compared = 0
    for _ in range(1000):
        subject.time = dice.choice(list(saved))
        subject.fmu.setFMUstate(saved[subject.time])
        for _ in range(min(dice.randint(1, 6), len(history) - subject.time)):
            assert driven(subject) == history[subject.time - 1]
            compared += 1
        if dice.random() < 0.3:
            old = saved.pop(subject.time, None)
            saved[subject.time] = subject.fmu.getFMUstate()
            if old is not None:
                subject.fmu.freeFMUstate(old)
    assert compared > 2000 and max(saved) > 40, "the walk came far enough to mean something"
    subject.close()


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_restore_in_a_fresh_process(unpacked, unpacked_python, history, runtime):
    folder = unpacked if runtime == "native" else unpacked_python
    subject = Subject(folder).initialized()
    subject.run(20)
    state = subject.fmu.getFMUstate()
    image = subject.fmu.serializeFMUstate(state)
    assert fresh_process(folder, image, 20, 20) == [bits.hex() for bits in history[20:40]]
    subject.close()


def test_parameters_travel_with_the_state(unpacked):
    """An instance with other parameters takes over those of the state, and can go back to its own."""
    coarse = with_parameters(unpacked, level=1, slices=3)
    coarse.run(5)
    state, own = coarse.fmu.getFMUstate(), None
    expected = coarse.run(10)
    image = coarse.fmu.serializeFMUstate(state)
    other = with_parameters(unpacked, level=2, slices=5)
    other.run(5)
    own = other.fmu.getFMUstate()
    own_expected = other.run(10)
    assert own_expected != expected
    foreign = other.fmu.deSerializeFMUstate(image)
    for saved, bits in ((foreign, expected), (own, own_expected), (foreign, expected)):
        other.fmu.setFMUstate(saved)
        other.time = 5
        assert other.run(10) == bits
    coarse.close()
    other.close()


def with_parameters(folder: str, **values: int) -> Subject:
    subject = Subject(folder)
    for name, value in values.items():
        subject.fmu.setInteger([references(subject)[name]], [value])
    return subject.initialized()


def fresh_process(folder: str, image: bytes, time: int, steps: int) -> list[str]:
    """Output bits (hex) of `steps` steps in a new process that only knows the bytes of the state."""
    done = subprocess.run(
        [sys.executable, "-c", FRESH, folder, str(time), str(steps)],
        input=image.hex() + "\n",
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


def test_states_of_every_mode(unpacked, history):
    """Also before and within the initialisation, and after the end."""
    subject = Subject(unpacked)
    subject.excite()
    states = [subject.fmu.getFMUstate()]
    subject.fmu.setupExperiment(startTime=0.0)
    subject.fmu.enterInitializationMode()
    states.append(subject.fmu.getFMUstate())
    subject.fmu.exitInitializationMode()
    subject.run(7)
    subject.fmu.terminate()
    states.append(subject.fmu.getFMUstate())
    images = [subject.fmu.serializeFMUstate(state) for state in states]
    other = Subject(unpacked)
    for image, mode in zip(images, ("instantiated", "initialization", "terminated"), strict=True):
        other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(image))
        if mode == "instantiated":
            other.fmu.setupExperiment(startTime=0.0)
            other.fmu.enterInitializationMode()
        if mode != "terminated":
            other.fmu.exitInitializationMode()
            other.time = 0
            assert other.run(3) == b"".join(history[:3])
        else:
            assert other.outputs() == history[6] and other.status("doStep", 7e-4, 1e-4) == ERROR
    subject.close()
    other.close()


def timed(folder: str, steps: int, stop: int | None) -> Subject:
    """An instance that has taken `steps` steps, and has a stop time after `stop` of them or none."""
    subject = Subject(folder)
    subject.fmu.setupExperiment(startTime=0.0, stopTime=None if stop is None else stop * subject.step_size)
    subject.fmu.enterInitializationMode()
    subject.excite()
    subject.fmu.exitInitializationMode()
    subject.run(steps)
    return subject


def last_good(subject: Subject) -> float:
    """LastSuccessfulTime of fmi2GetRealStatus, s."""
    time = ctypes.c_double()
    assert subject.status("fmi2GetRealStatus", subject.fmu.component, 2, ctypes.byref(time)) == OK
    return time.value


@pytest.mark.parametrize("own, stop", [(None, 10), (6, 10), (6, None), (20, 5)])
@pytest.mark.parametrize("by", ["handle", "bytes"])
def test_times_travel_with_the_state(unpacked, by, own, stop):
    """Stop time, or that there is none, and the last good time are those of the state, whatever the instance had."""
    origin = timed(unpacked, 4, stop)
    image = origin.fmu.serializeFMUstate(origin.fmu.getFMUstate())
    if by == "bytes":
        subject = timed(unpacked, 3, own)
        subject.fmu.setFMUstate(subject.fmu.deSerializeFMUstate(image))
    else:  # back in the same instance, which has meanwhile taken over a state with other times
        subject, state, other = origin, origin.fmu.getFMUstate(), timed(unpacked, 2, own)
        foreign = other.fmu.serializeFMUstate(other.fmu.getFMUstate())
        subject.fmu.setFMUstate(subject.fmu.deSerializeFMUstate(foreign))
        assert last_good(subject) == 2 * subject.step_size
        subject.fmu.setFMUstate(state)
        other.close()
    h = subject.step_size
    assert last_good(subject) == 4 * h
    statuses = [subject.status("doStep", k * h, h) for k in range(4, 25)]
    allowed = 21 if stop is None else stop - 4
    assert statuses == [OK] * allowed + [ERROR] * (21 - allowed)
    assert last_good(subject) == pytest.approx((4 + allowed) * h, rel=1e-12)
    subject.close()


def test_a_discarded_step_travels_with_the_state(unpacked_other):
    """Last good time within the step, and the status of the step."""
    origin = Subject(unpacked_other).initialized()
    h, steps = origin.step_size, 0
    origin.fmu.setReal([references(origin)["wheel.tau"]], [-1e7])
    while origin.status("doStep", steps * h, h) == OK:
        steps += 1
    reached = last_good(origin)
    image = origin.fmu.serializeFMUstate(origin.fmu.getFMUstate())
    subject = Subject(unpacked_other).initialized()
    subject.run(steps + 3)
    assert last_good(subject) == pytest.approx((steps + 3) * h, rel=1e-12)
    subject.fmu.setFMUstate(subject.fmu.deSerializeFMUstate(image))
    assert last_good(subject) == reached < (steps + 1) * h
    status = ctypes.c_int()
    assert subject.status("fmi2GetStatus", subject.fmu.component, 0, ctypes.byref(status)) == OK
    assert status.value == DISCARD and subject.status("doStep", reached, h) == ERROR
    for each in (origin, subject):
        each.close()


def test_foreign_and_freed_states_are_refused(unpacked, unpacked_other):
    first, second, stranger = Subject(unpacked).initialized(), Subject(unpacked).initialized(), Subject(unpacked_other)
    state = first.fmu.getFMUstate()
    image = first.fmu.serializeFMUstate(state)
    assert second.status("setFMUstate", state) == ERROR, "a handle belongs to its instance"
    assert stranger.status("deSerializeFMUstate", image) == ERROR, "a state belongs to its model"
    assert first.status("setFMUstate", fmi2FMUstate(4096)) == ERROR
    copy = fmi2FMUstate(state.value)
    first.fmu.freeFMUstate(state)
    assert first.status("setFMUstate", copy) == ERROR and first.status("freeFMUstate", copy) == ERROR
    assert first.status("freeFMUstate", fmi2FMUstate()) == OK, "freeing NULL does nothing"
    for subject in (first, second, stranger):
        subject.close()
