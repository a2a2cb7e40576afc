"""Calls that an FMU must answer well. A crash brings the process down: `gearfmu validate` runs first."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from fmpy import calloc, free, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.model_description import ScalarVariable

from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.fmu.description import value_text
from gearfmu.fmu.units import unit_of
from gearfmu.kernel import Kernel, Variable
from gearfmu.kernel.build import SUFFIX, host_platform

OK, DISCARD, ERROR, FATAL = 0, 2, 3, 4
STIMULUS = {"rad": 1e-4, "rad/s": 1.0, "rad/s2": 10.0, "N.m": 1.0}
UNKNOWN = 0xFFFFFFF0
STEPS = 10
Findings = Iterator[tuple[str, str, str]]  # field, value, what to do


class Subject:
    """One instance of the FMU under test; every call returns its status instead of raising."""

    def __init__(self, folder: str, guid: str | None = None) -> None:
        self.description = read_model_description(folder, validate=False)
        self.variables = self.description.modelVariables
        self.native = not self.description.coSimulation.needsExecutionTool
        self.step_size = float(getattr(self.description.defaultExperiment, "stepSize", None) or 1e-4)
        self.fmu = FMU2Slave(
            guid=guid or self.description.guid,
            unzipDirectory=folder,
            instanceName="probe",
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        self.time = 0
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(lambda *_: None)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmu.instantiate(callbacks=self.callbacks)

    def close(self) -> None:
        """Free the instance; the library stays loaded for the next one."""
        self.fmu.fmi2FreeInstance(self.fmu.component)

    def status(self, method: str, *arguments: Any) -> int:
        """Status of a method of fmpy's FMU2Slave."""
        try:
            getattr(self.fmu, method)(*arguments)
        except FMICallException as error:
            return error.status
        return OK

    def references(self, causality: str, *types: str) -> list[int]:
        """Value references of the variables of this causality and these XML types."""
        return [v.valueReference for v in self.variables if v.causality == causality and v.type in types]

    def excite(self) -> None:
        """Inputs away from zero, so that a comparison compares something."""
        for v in self.variables:
            if v.causality == "input" and v.unit in STIMULUS:
                self.fmu.setReal([v.valueReference], [float(v.start) + STIMULUS[v.unit]])

    def initialized(self) -> Subject:
        """Itself, with inputs set, ready to step."""
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.excite()
        self.fmu.exitInitializationMode()
        return self

    def run(self, steps: int = STEPS) -> bytes:
        """Step on and return the bits of all outputs after every step."""
        bits = b""
        for _ in range(steps):
            self.fmu.doStep(self.time * self.step_size, self.step_size)
            self.time += 1
            bits += self.outputs()
        return bits

    def outputs(self) -> bytes:
        """Bits of all numeric outputs."""
        reals = self.fmu.getReal(self.references("output", "Real"))
        whole = self.fmu.getInteger(self.references("output", "Integer", "Enumeration"))
        truths = self.fmu.getBoolean(self.references("output", "Boolean"))
        return struct.pack(f"<{len(reals)}d{len(whole) + len(truths)}i", *reals, *whole, *truths)


def _refused(subject: Subject, mode: str, calls: dict[str, tuple[Any, ...]]) -> Findings:
    for call, arguments in calls.items():
        status = subject.status(call, *arguments)
        if status != ERROR:
            yield f"{call} in {mode}", f"status {status}", "the call is out of order there: it must return fmi2Error"


def wrong_order(folder: str) -> Findings:
    """Calls that FMI 2.0 (4.2.4) does not allow in a mode are refused; the run goes on as if nothing happened."""
    subject = Subject(folder)
    if not subject.native:
        return
    expected = _plain_run(folder)
    outputs, inputs = subject.references("output", "Real")[:1], subject.references("input", "Real")[:1]
    step = {"doStep": (0.0, subject.step_size)}
    setup = {"setupExperiment": (), "enterInitializationMode": ()}
    yield from _refused(
        subject, "instantiated mode", {"exitInitializationMode": (), **step, "getReal": (outputs,), "terminate": ()}
    )
    subject.fmu.setupExperiment(startTime=0.0)
    subject.fmu.enterInitializationMode()
    yield from _refused(subject, "initialization mode", {**setup, **step, "terminate": ()})
    subject.excite()
    subject.fmu.exitInitializationMode()
    fixed = subject.references("parameter", "Real")[:1]
    yield from _refused(subject, "step mode", {**setup, "exitInitializationMode": ()})
    yield from _refused(subject, "step mode, of a fixed parameter", {"setReal": (fixed, [1e-6])} if fixed else {})
    if subject.run() != expected:
        yield "refused calls", "the outputs differ afterwards", "a refused call must change nothing"
    subject.fmu.terminate()
    yield from _refused(subject, "terminated mode", {"terminate": (), **step, "setReal": (inputs, [0.0] * len(inputs))})
    subject.close()


def bad_values(folder: str) -> Findings:
    """NaN, infinite and wrongly typed values and unknown references are refused and change nothing."""
    subject = Subject(folder).initialized()
    expected = _plain_run(folder)
    inputs = subject.references("input", "Real")
    wanted = (ERROR,) if subject.native else (OK, ERROR, FATAL)  # pythonfmu cannot return fmi2Error from a setter
    for value in (math.nan, math.inf, -math.inf):
        before = subject.fmu.getReal(inputs)
        status = subject.status("setReal", inputs, [*before[1:], value]) if inputs else ERROR
        if status not in wanted or subject.fmu.getReal(inputs) != before:
            yield f"setReal of {value}", f"status {status}", "refuse it with fmi2Error and keep the old values"
    if not subject.native:
        return
    truth = subject.references("parameter", "Boolean")[:1]
    yield from _refused(
        subject,
        "step mode, of an unknown reference",
        {"getReal": ([UNKNOWN],), "getInteger": ([UNKNOWN],), "setBoolean": ([UNKNOWN], [True])},
    )
    yield from _refused(subject, "step mode, of a Boolean", {"getReal": (truth,)} if truth else {})
    if subject.run() != expected:
        yield "refused values", "the outputs differ afterwards", "a refused call must change nothing"
    subject.close()


def bad_steps(folder: str) -> Findings:
    """Negative, zero, not finite and misplaced steps are refused and change nothing."""
    subject = Subject(folder).initialized()
    expected = _plain_run(folder)
    h, wanted = subject.step_size, (ERROR,) if subject.native else (DISCARD, ERROR)
    for time, size in ((0.0, -h), (0.0, 0.0), (0.0, math.nan), (0.0, math.inf), (math.nan, h), (1.0, h), (-h, h)):
        status = subject.status("doStep", time, size)
        if status not in wanted:
            yield f"doStep({time:g}, {size:g})", f"status {status}", "refuse it with fmi2Error"
    if subject.run() != expected:
        yield "refused steps", "the outputs differ afterwards", "a refused step must change nothing"
    subject.close()


def start_values(folder: str) -> Findings:
    """In initialisation mode every input and parameter has the start value of modelDescription.xml."""
    subject = Subject(folder)
    subject.fmu.setupExperiment(startTime=0.0)
    subject.fmu.enterInitializationMode()
    getters = {
        "Real": subject.fmu.getReal,
        "Integer": subject.fmu.getInteger,
        "Enumeration": subject.fmu.getInteger,
        "Boolean": subject.fmu.getBoolean,
    }
    for v in subject.variables:
        if v.causality in ("input", "parameter") and v.type in getters:
            value = getters[v.type]([v.valueReference])[0]
            declared = float(v.start == "true") if v.type == "Boolean" else float(v.start)
            if float(value) != declared:
                yield v.name, repr(value), f"modelDescription.xml declares start={v.start}: export again"
    subject.close()


def saved_state(folder: str) -> Findings:
    """A restored state goes on with the same bits, here and, from its bytes, elsewhere; damaged bytes are refused."""
    subject = Subject(folder).initialized()
    if not subject.description.coSimulation.canGetAndSetFMUstate:
        return
    subject.run()
    state, time = subject.fmu.getFMUstate(), subject.time
    expected = subject.run()
    subject.fmu.setFMUstate(state)
    subject.time = time
    if subject.run() != expected:
        yield "fmi2SetFMUstate", "the outputs differ", "a restored state must give the same bits"
    if subject.description.coSimulation.canSerializeFMUstate:
        yield from _serialized(folder, subject.fmu.serializeFMUstate(state), time, expected, subject.native)
    subject.fmu.freeFMUstate(state)
    if subject.native:
        yield from _refused(subject, "step mode", {"setFMUstate": (state,)})
    subject.close()


def _serialized(folder: str, image: bytes, time: int, expected: bytes, native: bool) -> Findings:
    other = Subject(folder)
    if native:
        flipped = [image[:k] + bytes([image[k] ^ 1]) + image[k + 1 :] for k in (0, len(image) // 2, len(image) - 1)]
        for damaged in (b"", image[:-1], image + b"\0", *flipped):
            yield from _refused(other, "instantiated mode, of damaged bytes", {"deSerializeFMUstate": (damaged,)})
    else:
        other.initialized()
    state = other.fmu.deSerializeFMUstate(image)
    other.fmu.setFMUstate(state)
    other.time = time
    if other.run() != expected:
        yield "fmi2DeSerializeFMUstate", "the outputs differ", "its bytes must give the same run elsewhere"
    other.fmu.freeFMUstate(state)
    other.close()


def instances(folder: str) -> Findings:
    """Two instances that step in turn, and one that was reset, give the bits of one alone."""
    expected = _plain_run(folder)
    first, second = Subject(folder).initialized(), Subject(folder).initialized()
    in_turn = [(first.run(1), second.run(1)) for _ in range(STEPS)]
    if any(b"".join(bits) != expected for bits in zip(*in_turn, strict=True)):
        yield "two instances", "the outputs differ from those of one alone", "instances must share nothing that changes"
    first.fmu.reset()
    first.time = 0
    if first.initialized().run() != expected:
        yield "fmi2Reset", "the outputs differ", "after a reset an instance must behave as a fresh one"
    first.close()
    second.close()
    if first.native and first.status("doStep", 0.0, 1e-4) != ERROR:
        yield "a freed instance", "was not refused", "recognise freed instances and return fmi2Error"


def clocks(folder: str) -> Findings:
    """Times as n·H and times that accumulate rounding (t += H) give the same bits."""
    expected, subject = _plain_run(folder, 20 * STEPS), Subject(folder).initialized()
    time, bits = 0.0, b""
    for _ in range(20 * STEPS):
        after = time + subject.step_size
        subject.fmu.doStep(time, after - time)
        bits += subject.outputs()
        time = after
    if bits != expected:
        yield "fmi2DoStep", "n·H and accumulated times differ", "take steps equal up to rounding as equal"
    subject.close()


def wrong_guid(folder: str) -> Findings:
    """An instance with the GUID of another model is refused."""
    subject = Subject(folder)
    subject.close()
    if not subject.native:
        return
    try:
        Subject(folder, guid="0" * 64).close()
    except Exception:
        pass
    else:
        yield "fmi2Instantiate", "accepts a foreign GUID", "compare the GUID with the model's hash"


def kernel_table(folder: str) -> Findings:
    """modelDescription.xml says what the binary's own table of variables says, which is the truth; nothing for an FMU
    whose binary has no table of ours."""
    library, blob = kernel_library(Path(folder)), Path(folder, "resources", "model.gkb")
    if library is None or not blob.is_file():
        return
    kernel = Kernel(blob.read_bytes(), library=library)
    description = read_model_description(folder, validate=False)
    listed = {v.name: v for v in description.modelVariables}
    table = kernel.variables
    for name in sorted(table.keys() ^ listed.keys()):
        yield name, "only in " + ("the binary" if name in table else "modelDescription.xml"), "export again"
    for name in table.keys() & listed.keys():
        for field, ours, theirs in _fields(table[name], listed[name]):
            if ours != theirs:
                yield f"{name}: {field}", str(theirs), f"the binary says {ours}: export again"


def kernel_library(folder: Path) -> Path | None:
    """The host's kernel library inside an unpacked FMU: its binary, or with runtime python a file in resources."""
    suffix = SUFFIX[host_platform()]
    places = [folder / "binaries" / host_platform(), folder / "resources"]
    files = [file for place in places for file in sorted(place.glob(f"*{suffix}"))]
    return next((file for file in files if "gk_variable" in exported_symbols(file)), None)


def _fields(ours: Variable, theirs: ScalarVariable) -> Iterator[tuple[str, object, object]]:
    yield "valueReference", ours.reference, theirs.valueReference
    yield "type", ours.type, theirs.type
    yield "causality", ours.causality, theirs.causality
    yield "unit", unit_of(ours), theirs.unit
    if ours.causality != "output":
        yield "start", value_text(ours, ours.start), theirs.start


def _plain_run(folder: str, steps: int = STEPS) -> bytes:
    subject = Subject(folder).initialized()
    bits = subject.run(steps)
    subject.close()
    return bits


CHECKS: dict[str, Callable[[str], Findings]] = {
    check.__name__: check
    for check in (
        wrong_guid,
        kernel_table,
        start_values,
        wrong_order,
        bad_values,
        bad_steps,
        saved_state,
        instances,
        clocks,
    )
}
