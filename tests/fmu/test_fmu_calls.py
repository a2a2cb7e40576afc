"""Who may call what when: the native FMU's answers to every call in every mode, and to what importers get wrong."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmpy.fmi2 import fmi2CallbackLoggerTYPE
from small_stage import references

from evidence.fmu_probes.everything import exchange_functions
from evidence.fmu_probes.probes import ERROR, OK, Subject

MODES = ("instantiated", "initialization", "step", "discarded", "terminated")
ALLOWED = {
    "setupExperiment": {"instantiated"},
    "enterInitializationMode": {"instantiated"},
    "exitInitializationMode": {"initialization"},
    "doStep": {"step"},
    "terminate": {"step", "discarded"},
    "reset": set(MODES),
    "getReal": {"initialization", "step", "discarded", "terminated"},
    "getInteger": {"initialization", "step", "discarded", "terminated"},
    "getBoolean": {"initialization", "step", "discarded", "terminated"},
    "setReal": {"instantiated", "initialization", "step"},
    "setInteger": {"instantiated", "initialization"},  # fixed parameters
    "getFMUstate": set(MODES),
    "setDebugLogging": set(MODES),
    "fmi2GetRealStatus": {"step", "discarded", "terminated"},
    "fmi2CancelStep": set(),
    "fmi2SetRealInputDerivatives": set(),
    "fmi2GetDirectionalDerivative": set(),
}


def in_mode(folder: str, mode: str) -> Subject:
    """A fresh instance brought into `mode`; a discarded step comes from a torque that no tooth can carry."""
    return brought(Subject(folder), mode)


def brought(subject: Subject, mode: str) -> Subject:
    if mode == "instantiated":
        return subject
    subject.fmu.setupExperiment(startTime=0.0)
    subject.fmu.enterInitializationMode()
    if mode == "initialization":
        return subject
    subject.fmu.exitInitializationMode()
    if mode == "discarded":
        subject.fmu.setReal([references(subject)["wheel.tau"]], [-1e7])
        statuses = [subject.status("doStep", k * 1e-4, 1e-4) for k in range(40)]
        assert 2 in statuses, "the overload was not noticed"
    if mode == "terminated":
        subject.fmu.terminate()
    return subject


def arguments(subject: Subject, call: str) -> tuple:
    real, level, truth = map(references(subject).get, ("pinion.phi", "level", "effect.hertz"))
    time, c = ctypes.c_double(), subject.fmu.component
    return {
        "doStep": (0.0, 1e-4),
        "getReal": ([real],),
        "getInteger": ([level],),
        "getBoolean": ([truth],),
        "setReal": ([real], [0.0]),
        "setInteger": ([level], [1]),
        "setDebugLogging": (True, ["logAll"]),
        "fmi2GetRealStatus": (c, 2, ctypes.byref(time)),
        "fmi2CancelStep": (c,),
        "fmi2SetRealInputDerivatives": (c, None, 0, None, None),
        "fmi2GetDirectionalDerivative": (c, None, 0, None, 0, None, None),
    }.get(call, ())


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("call", ALLOWED)
def test_every_call_in_every_mode(unpacked_other, call, mode):
    subject = in_mode(unpacked_other, mode)
    assert subject.status(call, *arguments(subject, call)) == (OK if mode in ALLOWED[call] else ERROR)
    subject.close()
    assert subject.status(call, *arguments(subject, call)) == ERROR, "a freed instance"


def test_discarded_step_tells_how_far_it_came_and_can_be_taken_back(unpacked_other):
    subject = in_mode(unpacked_other, "step")
    plain = Subject(unpacked_other).initialized().run()
    subject.excite()
    state = subject.fmu.getFMUstate()
    subject.fmu.setReal([references(subject)["wheel.tau"]], [-1e7])
    steps = 0
    while subject.status("doStep", steps * 1e-4, 1e-4) == OK:
        steps += 1
    reached, discarded = ctypes.c_double(), ctypes.c_int()
    assert subject.status("fmi2GetStatus", subject.fmu.component, 0, ctypes.byref(discarded)) == OK
    assert discarded.value == 2
    assert subject.status("fmi2GetRealStatus", subject.fmu.component, 2, ctypes.byref(reached)) == OK
    assert steps * 1e-4 - 1e-12 <= reached.value < (steps + 1) * 1e-4
    outputs = subject.fmu.getReal(subject.references("output", "Real"))
    assert all(map(math.isfinite, outputs)), "the last good values stay readable"
    subject.fmu.setFMUstate(state)
    reference_run = in_mode(unpacked_other, "step")
    reference_run.excite()
    assert subject.run() == reference_run.run() and plain
    subject.close()


def test_outputs_in_initialization_mode_follow_the_inputs(unpacked):
    subject = in_mode(unpacked, "initialization")
    phi, te = map(references(subject).get, ("pinion.phi", "mesh.te"))
    before = subject.fmu.getReal([te])
    subject.fmu.setReal([phi], [2e-3])
    loaded = subject.fmu.getReal([te])
    subject.fmu.setReal([phi], [0.0])
    assert loaded != before == subject.fmu.getReal([te]), "no trace of the settings in between"
    subject.close()


def test_stop_time_is_kept(unpacked):
    subject = Subject(unpacked)
    subject.fmu.setupExperiment(startTime=1.0, stopTime=1.0003)
    subject.fmu.enterInitializationMode()
    subject.fmu.exitInitializationMode()
    assert [subject.status("doStep", 1.0 + k * 1e-4, 1e-4) for k in range(4)] == [OK, OK, OK, ERROR]
    subject.close()


def instantiated(
    folder: str, location: bytes | None, name: bytes | None = b"x", kind: int = 1, guid: bytes = b""
) -> bool:
    """Whether fmi2Instantiate gives an instance, which is freed."""
    subject = Subject(folder)
    given = (name, kind, guid or subject.description.guid.encode(), location, ctypes.byref(subject.callbacks), 0, 0)
    component = subject.fmu.fmi2Instantiate(*given)
    if component:
        subject.fmu.fmi2FreeInstance(component)
    subject.close()
    return bool(component)


@pytest.mark.parametrize("spelling", ["{uri}", "{uri}/", "file://localhost{path}", "file:{path}", "{plain}"])
def test_resource_locations(unpacked, spelling):
    resources = Path(unpacked) / "resources"
    uri = resources.as_uri()
    assert "%" in uri, "the folder's name needs escapes"
    location = spelling.format(uri=uri, path=uri.removeprefix("file://"), plain=resources)
    assert instantiated(unpacked, location.encode())


@pytest.mark.parametrize("location", [b"", b"file:///%zz", b"file:///%00", b"file:///no/such/place", b"x" * 9000, None])
def test_bad_resource_locations(unpacked, location):
    assert not instantiated(unpacked, location)


@pytest.mark.parametrize("wrong", [{"name": b""}, {"name": None}, {"kind": 0}, {"guid": b"?"}])
def test_bad_instantiation(unpacked, wrong):
    assert not instantiated(unpacked, (Path(unpacked) / "resources").as_uri().encode(), **wrong)


def test_many_instances_live_side_by_side(unpacked):
    subjects = [Subject(unpacked) for _ in range(40)]
    for subject in subjects[::2]:
        subject.close()
    assert [s.status("enterInitializationMode") for s in subjects] == [ERROR, OK] * 20
    for subject in subjects[1::2]:
        subject.close()


# ---- what it says ----------------------------------------------------------------------------------------------------
@pytest.fixture
def heard(unpacked_other) -> Iterator[tuple[Subject, list[tuple[int, str, str]]]]:
    """A fresh instance and status, category and text of the messages it sends; with logging off."""
    messages: list[tuple[int, str, str]] = []
    subject = Subject(unpacked_other)
    subject.close()
    subject.callbacks.logger = fmi2CallbackLoggerTYPE(
        lambda _, name, status, category, text: messages.append((status, category.decode(), text.decode()))
    )
    subject.fmu.instantiate(callbacks=subject.callbacks, loggingOn=False)
    yield subject, messages
    subject.close()


REFUSALS = [  # mode, call, variable, value, words
    ("instantiated", "setReal", "level", 1.0, "is Integer or Enumeration"),
    ("instantiated", "setReal", "pinion.phi", math.nan, "nan"),
    ("instantiated", "setReal", "pinion.phi", 1e12, "allowed are from -1e+09 to 1e+09 rad"),
    ("instantiated", "setInteger", "slices", 21, "allowed are whole numbers from 1 to 20"),
    ("instantiated", "setInteger", "level", 9, "are 0, 1, ... for rigid|fast|standard|full|paper|explicit"),
    ("instantiated", "setReal", "mesh.te", 0.0, "is an output"),
    ("step", "setInteger", "level", 1, "before the initialisation ends"),
]


@pytest.mark.parametrize(("mode", "call", "name", "value", "words"), REFUSALS)
def test_refused_values_name_the_variable_and_what_it_takes(heard, mode, call, name, value, words):
    """Errors are told even with logging off."""
    subject, messages = heard
    reference = references(subject)[name]
    assert brought(subject, mode).status(call, [reference], [value]) == ERROR
    status, category, text = messages[-1]
    assert (status, category) == (ERROR, "logStatusError")
    assert f"{name} (value reference {reference})" in text and words in text


def test_calls_out_of_order_are_refused_in_words_and_events_are_told_on_request(heard):
    subject, messages = heard
    assert subject.status("doStep", 0.0, 1e-4) == ERROR and "'instantiated'" in messages[-1][2]
    subject.fmu.setDebugLogging(True, ["logEvents"])
    brought(subject, "step")
    assert messages[-1][1] == "logEvents"
    assert subject.status("setDebugLogging", True, ["logNonsense"]) == ERROR


def test_after_a_discarded_step_it_says_what_may_follow(heard):
    subject, messages = heard
    brought(subject, "discarded")
    told = next(text for _, _, text in messages if "stopped at" in text)
    assert "restore a saved state (fmi2SetFMUstate) or fmi2Reset, else fmi2Terminate" in told
    refused = messages[-1][2]
    assert "fmi2DoStep is not allowed in mode 'after a discarded step'; allowed are Terminate, Get, " in refused
    assert refused.endswith("SetFMUstate, Reset and FreeInstance") and "DoStep," not in refused


def test_model_exchange_is_refused_in_words(heard):
    """Some loaders look these functions up in every FMU."""
    subject, messages = heard
    library = ctypes.CDLL(subject.fmu.dll._name)
    for name in sorted(exchange_functions()):
        assert getattr(library, name)(ctypes.c_void_p(subject.fmu.component), None, 0, None) == ERROR
        assert messages[-1][2] == f"{name}: this FMU does not offer it (see modelDescription.xml)"
