"""FmuUnit: an FMI 2.0 co-simulation FMU as a unit, through fmpy's low-level interface with buffers allocated once.

Serialised states of our FMUs hold those of the kernel: the same bytes of gk_data, behind a head and the settings
(src/fmi2/fmi2_state.c)."""

from __future__ import annotations

import shutil
import struct
import tempfile
from collections.abc import Mapping, Sequence
from ctypes import CFUNCTYPE, c_double, c_int, c_size_t, c_void_p, cast
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    byref,
    fmi2Boolean,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Discard,
    fmi2Integer,
    fmi2LastSuccessfulTime,
    fmi2Real,
    fmi2True,
    fmi2ValueReference,
    fmi2Warning,
)
from fmpy.logging import addLoggerProxy

from gearfmu.cosim.kernel_unit import RowLog
from gearfmu.cosim.units import Variable
from gearfmu.errors import CouplingError, FmuError, GearfmuError, SimulationError
from gearfmu.kernel.binding import OUTCOMES, load
from gearfmu.kernel.build import SUFFIX, host_platform

HEAD = struct.Struct("<8sQQ64s3d4IQ")  # face_head of fmi2_face.h
SIZE, CHECK, LAST_GOOD, MODE, BYTES = 1, 2, 6, 8, 11  # places in it
CHECKED_FROM = struct.calcsize("<8sQQ")
STEP_MODE = 4  # MODE_STEP
KINDS = {
    "Real": ("Real", fmi2Real),
    "Integer": ("Integer", fmi2Integer),
    "Enumeration": ("Integer", fmi2Integer),
    "Boolean": ("Boolean", fmi2Boolean),
}
TYPES = dict(KINDS.values())
MESSAGES_KEPT = 200
# calls at every communication step, by address and number: fmpy's own declarations cost three times as much
_ACCESS = CFUNCTYPE(c_int, c_void_p, c_void_p, c_size_t, c_void_p)
_STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)


@dataclass(frozen=True)
class _Group:
    """Variables of one FMI type: one call gets or sets them all."""

    call: str  # Real, Integer or Boolean
    references: Any  # ctypes array of value references
    values: Any  # address of the memory that the FMU reads or fills
    view: np.ndarray  # the same memory
    places: np.ndarray  # positions in the handle's buffer


@dataclass(frozen=True)
class FmuHandle:
    """Resolved variables and their buffers; when all are Real, the one group's memory is the buffer."""

    groups: tuple[_Group, ...]
    buffer: np.ndarray
    real: bool


class FmuUnit:
    """Unit of an FMU.

    path : the .fmu, unpacked into a temporary folder; parameters : start values by name, numbers, booleans or the items
    of an enumeration. Raises FmuError when the FMU cannot be loaded, knows no such variable or refuses a call;
    SimulationError when it discards a step. `close` frees the instance.
    """

    def __init__(self, path: str | Path, parameters: Mapping[str, float | bool | str] | None = None) -> None:
        self.path = Path(path)
        self.messages: list[str] = []
        self._folder = tempfile.mkdtemp(prefix="gearfmu-")
        try:
            self._load(self._folder)
            self._instantiate(parameters or {})
        except GearfmuError:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise
        except Exception as error:  # whatever a damaged file or a foreign binary makes of it
            shutil.rmtree(self._folder, ignore_errors=True)
            raise FmuError(f"{self.path}: cannot be loaded: {error} {self._last_message()}") from error

    def _load(self, folder: str) -> None:
        self.description = read_model_description(str(self.path), validate=False)
        if self.description.coSimulation is None or not self.description.fmiVersion.startswith("2"):
            raise FmuError(f"{self.path}: not an FMI 2.0 co-simulation FMU (it is FMI {self.description.fmiVersion})")
        extract(str(self.path), folder)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self._fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=self.description.modelName,
            libraryPath=_own_library(folder, self.description.coSimulation.modelIdentifier),
        )
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(byref(self._callbacks))

    def _log(self, environment: object, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode("utf-8", "replace"))
        del self.messages[:-MESSAGES_KEPT]

    # -- life ----------------------------------------------------------------------------------------------------------
    def _instantiate(self, parameters: Mapping[str, float | bool | str]) -> None:
        """A fresh instance with these start values."""
        self._fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        self._component = c_void_p(self._fmu.component)
        dll = self._fmu.dll
        self._step = _STEP(_address(dll.fmi2DoStep))
        self._getters = {kind: _ACCESS(_address(getattr(dll, f"fmi2Get{kind}"))) for kind in TYPES}
        self._setters = {kind: _ACCESS(_address(getattr(dll, f"fmi2Set{kind}"))) for kind in TYPES}
        if parameters:
            self.set(self.resolve(list(parameters)), [self._number(name, value) for name, value in parameters.items()])

    def initialize(self, time: float) -> None:
        """Enter and leave initialisation mode at `time`, with the inputs set so far. Raises FmuError with the FMU's
        own message."""
        try:
            self._fmu.setupExperiment(startTime=time)
            self._fmu.enterInitializationMode()
            self._fmu.exitInitializationMode()
        except FMICallException as error:
            raise FmuError(f"{self.path}: {error} {self._last_message()}") from error

    def close(self) -> None:
        """Free the instance and the unpacked files; a second call does nothing."""
        if self._fmu.component is not None:
            self._fmu.freeInstance()
            self._fmu.component = None
        shutil.rmtree(self._folder, ignore_errors=True)

    # -- variables -----------------------------------------------------------------------------------------------------
    def outputs(self) -> dict[str, Variable]:
        """The numeric outputs of the FMU, in its order."""
        return {
            name: Variable(_plain(variable.unit), variable.description or "", variable.type != "Real")
            for name, variable in self.variables.items()
            if variable.causality == "output" and variable.type in KINDS
        }

    def resolve(self, names: Sequence[str]) -> FmuHandle:
        """Handle of variables; raises CouplingError naming those that the FMU does not have."""
        unknown = [name for name in names if name not in self.variables]
        if unknown:
            raise CouplingError(
                f"{self.path}: no variable {', '.join(unknown)}; take an FMU exported with the ports that this needs"
            )
        buffer, groups = np.zeros(len(names)), []
        for call, kind in TYPES.items():
            places = [k for k, name in enumerate(names) if KINDS.get(self.variables[name].type) == (call, kind)]
            if places:
                real = len(places) == len(names) and call == "Real"
                view = buffer if real else np.zeros(len(places), dtype=np.dtype(kind))
                references = (fmi2ValueReference * len(places))(
                    *[self.variables[names[k]].valueReference for k in places]
                )
                groups.append(_Group(call, references, c_void_p(view.ctypes.data), view, np.array(places)))
        return FmuHandle(tuple(groups), buffer, len(groups) == 1 and groups[0].view is buffer)

    def set(self, handle: FmuHandle, values: Sequence[float] | np.ndarray) -> None:
        """Set variables, one call a type. Raises FmuError when the FMU refuses a value."""
        handle.buffer[:] = values
        for group in handle.groups:
            if not handle.real:
                group.view[:] = handle.buffer[group.places]
            setter = self._setters[group.call]
            if setter(self._component, group.references, len(group.places), group.values) > fmi2Warning:
                raise FmuError(f"{self.path}: fmi2Set{group.call} refused. {self._last_message()}")

    def get(self, handle: FmuHandle) -> np.ndarray:
        """Values (k,) in the handle's buffer, one call a type."""
        for group in handle.groups:
            getter = self._getters[group.call]
            if getter(self._component, group.references, len(group.places), group.values) > fmi2Warning:
                raise FmuError(f"{self.path}: fmi2Get{group.call} refused. {self._last_message()}")
            if not handle.real:
                handle.buffer[group.places] = group.view
        return handle.buffer

    def log(self, names: Sequence[str], points: int) -> RowLog:
        """Keeps these outputs at up to `points` times."""
        return RowLog(partial(self.get, self.resolve(names)), len(names), points)

    def step(self, time: float, h: float) -> None:
        """fmi2DoStep. Raises SimulationError with outcome and last successful time on discard, FmuError on error."""
        status = self._step(self._component, time, h, fmi2True)
        if status <= fmi2Warning:
            return
        if status == fmi2Discard:
            reached = fmi2Real(time)
            self._fmu.dll.fmi2GetRealStatus(self._component, fmi2LastSuccessfulTime, byref(reached))
            message = self._last_message()
            raise SimulationError(f"{self.path}: {message}", outcome_of(message), reached.value)
        raise FmuError(f"{self.path}: fmi2DoStep({time:g}, {h:g}) refused. {self._last_message()}")

    # -- state ---------------------------------------------------------------------------------------------------------
    def save(self) -> bytes:
        """The FMU's state as bytes. Raises FmuError when it cannot be saved."""
        if not (
            self.description.coSimulation.canGetAndSetFMUstate and self.description.coSimulation.canSerializeFMUstate
        ):
            raise FmuError(f"{self.path}: this FMU cannot save its state; use a master without rollback")
        state = self._fmu.getFMUstate()
        try:
            return self._fmu.serializeFMUstate(state)
        finally:
            self._fmu.freeFMUstate(state)

    def restore(self, state: bytes) -> None:
        """Back to a saved state."""
        own = self._fmu.deSerializeFMUstate(state)
        try:
            self._fmu.setFMUstate(own)
        finally:
            self._fmu.freeFMUstate(own)

    # -- small helpers -------------------------------------------------------------------------------------------------
    def _number(self, name: str, value: float | bool | str) -> float:
        if not isinstance(value, str):
            return float(value)
        declared = getattr(self.variables.get(name), "declaredType", None)
        items = {item.name: int(item.value) for item in (declared.items if declared and declared.items else [])}
        if value not in items:
            raise FmuError(
                f"{self.path}: {name} = {value!r}: use one of {', '.join(items) or 'the numbers of its range'}"
            )
        return float(items[value])

    def _last_message(self) -> str:
        return self.messages[-1] if self.messages else "The FMU gave no message."


def outcome_of(message: str) -> str:
    """The kernel's name of the outcome whose text the message ends with ("diverged", "penetration", "energy");
    "discarded" for another FMU's words."""
    texts = {name: load().gk_outcome_text(number).decode() for number, name in enumerate(OUTCOMES)}
    return next((name for name, text in texts.items() if message.rstrip().endswith(text)), "discarded")


def _own_library(folder: str, identifier: str) -> str | None:
    """This machine's binary of an FMU; None leaves the search to fmpy, which takes linux64 for any processor."""
    library = Path(folder, "binaries", host_platform(), identifier + SUFFIX[host_platform()])
    return str(library) if library.is_file() else None


def _plain(unit: str | None) -> str:
    """A trace's word for a unit of a model description: numbers without one are "1" there and "" here."""
    return "" if unit in (None, "1") else unit


def _address(function: Any) -> int:
    found = cast(function, c_void_p).value
    assert found is not None, "a function of a loaded library has an address"
    return found


def kernel_bytes(state: bytes) -> bytes:
    """The kernel's part of an FMU's serialised state, as `Kernel.save` gives it."""
    head = HEAD.unpack_from(state)
    return state[len(state) - head[BYTES] :]


def with_kernel_bytes(fresh: bytes, kernel: bytes, time: float) -> bytes:
    """The serialised state of an FMU in step mode at `time` (s): settings of `fresh`, the state of an instance that is
    not initialised, and a state of the kernel with the same parameters."""
    head = list(HEAD.unpack_from(fresh))
    settings = fresh[HEAD.size : len(fresh) - head[BYTES]]
    head[SIZE], head[BYTES] = HEAD.size + len(settings) + len(kernel), len(kernel)
    head[CHECK], head[LAST_GOOD], head[MODE] = 0, time, STEP_MODE
    body = HEAD.pack(*head) + settings + kernel
    head[CHECK] = fnv(body[CHECKED_FROM:])
    return HEAD.pack(*head) + settings + kernel


def fnv(data: bytes) -> int:
    """FNV-1a, 64 bit."""
    check = 14695981039346656037
    for byte in data:
        check = ((check ^ byte) * 1099511628211) & 0xFFFFFFFFFFFFFFFF
    return check
