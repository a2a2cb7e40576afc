"""One running instance of a stage model in this process, and rows of outputs over many communication steps."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from gearfmu.errors import ModelError, SimulationError
from gearfmu.kernel.binding import CAUSALITIES, MESSAGE, OUTCOMES, TYPES, RecordingInfo, VariableInfo, aligned, load
from gearfmu.kernel.linear import LinearInfo, LinearModel, linear_model, room_for

PLACES = 8
SLICES = 20
REFUSALS = ("bad_variable", "bad_value", "bad_call")
INSTANCES = 256  # value references: 256 × number of the variable + number of its instance


@dataclass(frozen=True)
class Variable:
    """One row of the kernel's table of variables (src/model/gk_variables.inc)."""

    reference: int
    name: str
    type: str
    causality: str
    unit: str
    items: tuple[str, ...]
    description: str
    start: float
    minimum: float
    maximum: float


@dataclass(frozen=True)
class TeState:
    """Quasi-static transmission at one position: te (m) of an engagement by the bores of the ports; phi (rad): angle of
    the first port's bore; output_te (m): as the output M.te in motion, by the carrier's own angle, so without the twist
    between its bolts and its bore; forces (N) of the engagement's slices, keyed (flank 0 drive 1 coast, tooth
    number of gear A)."""

    te: float
    phi: float
    output_te: float
    forces: dict[tuple[int, int], tuple[float, ...]]


@lru_cache(maxsize=2)
def _opened(blob: bytes, library: Path | None) -> tuple[int, ctypes.Array, ctypes.Array]:
    """Address of a model that was checked and opened, and the memory behind it; kernels of the same blob share it, for
    nothing writes to it. ModelError: the blob is refused, with the kernel's message."""
    kernel = load(library)
    blob_keep, address = aligned(len(blob))
    ctypes.memmove(address, blob, len(blob))
    model_keep, model = aligned(kernel.gk_model_size())
    message = ctypes.create_string_buffer(MESSAGE)
    if kernel.gk_model_open(model, address, len(blob), message):
        raise ModelError(message.value.decode(errors="replace"))
    return model, blob_keep, model_keep


class Kernel:
    """A stage model with its own parameters, state and time.

    blob: bytes of a StageModel. parameters: values of causality "parameter" by name. library: another build of the
    kernel. ModelError: the blob or a parameter is refused, with the kernel's message.
    """

    def __init__(self, blob: bytes, parameters: Mapping[str, float] | None = None, library: Path | None = None):
        self._lib = load(library)
        self._opened = _opened(bytes(blob), library)
        self._model = self._opened[0]
        self._setup_keep, self._setup = aligned(self._lib.gk_setup_size(self._model))
        self._work_keep, self._work = aligned(self._lib.gk_work_size(self._model))
        self._data_keep, self._data = aligned(self._lib.gk_data_size(self._model))
        self._set_many, self._get_many = self._lib.gk_set_many, self._lib.gk_get_many
        self._lib.gk_defaults(self._model, self._data)
        self.variables = {v.name: v for v in self._read_variables()}
        self.warning = ""
        for name, value in (parameters or {}).items():
            self.set(name, value)

    @property
    def name(self) -> str:
        return self._lib.gk_model_name(self._model).decode()

    @property
    def hash(self) -> str:
        """SHA-256 of the blob, 64 hex digits."""
        return self._lib.gk_model_hash(self._model).decode()

    @property
    def guid(self) -> str:
        """GUID of an FMU with this model, 64 hex digits."""
        return self._lib.gk_model_guid(self._model).decode()

    @property
    def time(self) -> float:
        """The last time (s) the state is good at."""
        return self._lib.gk_time(self._data)

    def _read_variables(self) -> list[Variable]:
        found = []
        for i in range(self._lib.gk_variable_count(self._model)):
            info = VariableInfo()
            self._lib.gk_variable(self._model, i, ctypes.byref(info))
            name, unit, description = (text.decode() for text in (info.name, info.unit, info.description))
            items = tuple(info.items.decode().split("|")) if info.items else ()
            kind, limits = (TYPES[info.type], CAUSALITIES[info.causality]), (info.start, info.minimum, info.maximum)
            found.append(Variable(info.reference, name, *kind, unit, items, description, *limits))
        return found

    def _reference(self, name: str) -> int:
        variable = self.variables.get(name)
        if variable is None:
            raise ModelError(f"{self.name} has no variable {name!r}; it has {', '.join(self.variables)}")
        return variable.reference

    def set(self, name: str, value: float) -> None:
        """Set an input or, before `initialize`, a parameter. ModelError when name or value is refused."""
        outcome = self._lib.gk_set(self._model, self._data, self._reference(name), value)
        if outcome:
            variable = self.variables[name]
            raise ModelError(
                f"{name} = {value!r}: {self._text(outcome)} (between {variable.minimum:g} and {variable.maximum:g} "
                f"{variable.unit})"
            )

    def get(self, name: str) -> float:
        """Value of any variable, SI."""
        value = ctypes.c_double()
        self._lib.gk_get(self._model, self._data, self._reference(name), ctypes.byref(value))
        return value.value

    def references(self, names: Iterable[str]) -> ctypes.Array:
        """Value references (c_uint32) of variables; ModelError for one that there is not."""
        known = list(map(self._reference, names))
        return (ctypes.c_uint32 * len(known))(*known)

    def set_many(self, references: ctypes.Array, values: ctypes.Array | int) -> int:
        """Inputs by value reference (c_uint32) and number (c_double; an array or its address), all or none: outcome
        number."""
        return self._set_many(self._model, self._data, references, len(references), values)

    def get_many(self, references: ctypes.Array, values: ctypes.Array | int) -> int:
        """Values by reference into an array of doubles or to an address: outcome number."""
        return self._get_many(self._model, self._data, references, len(references), values)

    def prepare(self) -> None:
        """Fix level, effects and step. ModelError when the wished h is too large; `warning` holds what the kernel
        wants said."""
        message = ctypes.create_string_buffer(MESSAGE)
        outcome = self._lib.gk_prepare(self._model, self._data, self._setup, self._work, message)
        self.warning = message.value.decode(errors="replace")
        if outcome:
            raise ModelError(self.warning or self._text(outcome))

    def initialize(self, time: float = 0.0) -> None:
        """Prepare and start from static equilibrium. SimulationError(no_equilibrium) when there is none."""
        self.prepare()
        self.check(self._lib.gk_initialize(self._model, self._setup, self._work, self._data, time))

    def step(self, time: float, h: float) -> None:
        """One communication step from `time` over `h` (s). SimulationError with the named outcome; the state then
        stands at `self.time`."""
        self.check(self.try_step(time, h))

    def try_step(self, time: float, h: float) -> int:
        """Fast path: outcome number of gk_step. With h = NaN it is refused before anything is done: what the call
        alone costs."""
        return self._lib.gk_step(self._model, self._setup, self._work, self._data, time, h)

    def record(self, info: RecordingInfo) -> int:
        """Outcome number of gk_record."""
        return self._lib.gk_record(self._model, self._setup, self._work, self._data, ctypes.byref(info))

    def save(self) -> bytes:
        """The state: a copy of its bytes."""
        return ctypes.string_at(self._data, self._lib.gk_state_size(self._setup))

    def restore(self, state: bytes) -> None:
        """Take a state of this model and setup back. ModelError when the bytes cannot be one."""
        if self._lib.gk_state_check(self._model, self._setup, state, len(state)):
            raise ModelError(
                "these bytes are not a state of this model at this level: save and restore with the same model and "
                "parameters"
            )
        ctypes.memmove(self._data, state, len(state))

    def adopt(self, other: Kernel) -> None:
        """Prepare and go on from where `other` stands, a kernel of the same model that has just made a step: its motion
        at this level, with these effects, slices and step. What was compliance and is dynamic here begins at rest in
        its static place, contacts begin anew. Inputs are taken too. ModelError where that cannot be: another model,
        an explicit integrator, bearings on in one of them only."""
        if self.hash != other.hash:
            raise ModelError(f"{self.name} cannot continue from a state of {other.name}: another model")
        self.prepare()
        states = (other._setup, other._work, other._data, self._setup, self._data)
        if self._lib.gk_adopt(self._model, *states):
            raise ModelError(
                f"{self.name} cannot continue from this state: both need an implicit integrator and the same "
                "effect.bearings, and the other must have made a step"
            )

    def transmission(self, phi_out: float, torque: float, mesh: int = 0, keep: bool = False) -> TeState:
        """Quasi-static equilibrium with the second port's bore held at phi_out (rad) and `torque` (N·m) on the first
        port's bore, seen at engagement number `mesh`; after `prepare`."""
        self.check(self._lib.gk_te(self._model, self._setup, self._work, self._data, phi_out, torque, int(keep)))
        return self.transmission_at(mesh)

    def transmission_at(self, mesh: int) -> TeState:
        """The equilibrium that `transmission` has just found, seen at engagement number `mesh`.
        SimulationError(bad_call) once a step has been made."""
        out = (ctypes.c_double * (3 + PLACES * (2 + SLICES)))()
        count = ctypes.c_int()
        known = (self._model, self._setup, self._work, self._data, mesh)
        self.check(self._lib.gk_te_at(*known, out, ctypes.byref(count)))
        width = 2 + int(self.get("slices"))
        rows = [out[3 + i * width : 3 + (i + 1) * width] for i in range(count.value)]
        return TeState(out[0], out[1], out[2], {(int(r[0]), int(r[1])): tuple(r[2:]) for r in rows})

    @property
    def ports(self) -> list[str]:
        """Names of the ports, in the model's order."""
        torques = (v for v in self.variables.values() if v.name.endswith(".tau") and v.name.count(".") == 1)
        return [v.name.removesuffix(".tau") for v in sorted(torques, key=lambda v: v.reference % INSTANCES)]

    def rest(self, torques: Mapping[str, float]) -> dict[str, float]:
        """Angles (rad) of the bores of all ports in static equilibrium under `torques` (N·m) on them, which balance in
        every motion that the meshes allow; a port that is not named has none, chains are left out. After
        `prepare`."""
        names = self.ports
        phi, given = (ctypes.c_double * len(names))(), [torques.get(name, 0.0) for name in names]
        torque = (ctypes.c_double * len(names))(*given)
        self.check(self._lib.gk_rest(self._model, self._setup, self._work, self._data, torque, phi))
        return dict(zip(names, phi, strict=True))

    def linearise(self) -> LinearModel:
        """The stage linearised at the equilibrium that `transmission` or `initialize` found last, with the ports as the
        model has them and clutches closed. SimulationError(bad_call) once a step has been made."""
        info = LinearInfo()
        self.check(self._lib.gk_linearise_room(self._model, self._setup, ctypes.byref(info)))
        arrays = room_for(info)
        self.check(self._lib.gk_linearise(self._model, self._setup, self._work, self._data, ctypes.byref(info)))
        return linear_model(info, arrays)

    def profile(self) -> dict[str, int]:
        """Processor cycles by phase of the step since `prepare`; zeros unless the library was built with
        -DGK_PROFILE."""
        found: dict[str, int] = {}
        name, cycles = ctypes.c_char_p(), ctypes.c_uint64()
        while self._lib.gk_profile(self._work, len(found), ctypes.byref(name), ctypes.byref(cycles)):
            found[(name.value or b"").decode()] = cycles.value
        return found

    def _text(self, outcome: int) -> str:
        return self._lib.gk_outcome_text(outcome).decode()

    def check(self, outcome: int) -> None:
        """SimulationError with the words of an outcome number that is not 0."""
        if outcome:
            raise SimulationError(
                f"{self.name}: {self._text(outcome)} (last good time {self.time:.9g} s)", OUTCOMES[outcome], self.time
            )


class Recording:
    """Outputs `names` of a started kernel over at most `steps` communication steps of `h` (s), of which step n begins
    at n·h. rows (steps + 1, k): at the start and after every step. done: steps that were made."""

    def __init__(self, kernel: Kernel, names: Sequence[str], steps: int, h: float) -> None:
        self.kernel, self.h, self.done = kernel, h, 0
        self._wanted = kernel.references(names)
        self.rows = np.empty((steps + 1, len(names)))
        kernel.get_many(self._wanted, self.rows.ctypes.data)

    def advance(self, steps: int, given: Mapping[str, np.ndarray] | None = None) -> None:
        """Make `steps` more. given: inputs by name, each (steps,), set before every step. ModelError where one is
        refused; SimulationError where a step fails: steps made until then are kept."""
        given = given or {}
        assert self.done + steps < len(self.rows) and all(values.shape == (steps,) for values in given.values())
        inputs, references = np.empty((steps, len(given))), self.kernel.references(given)
        for column, values in zip(inputs.T, given.values(), strict=True):
            column[:] = values
        address = self.rows.ctypes.data + (self.done + 1) * self.rows.strides[0]
        info = RecordingInfo(self.h, self.done, steps, len(given), self.rows.shape[1])
        info.inputs, info.outputs = ctypes.addressof(references), ctypes.addressof(self._wanted)
        info.input, info.output = inputs.ctypes.data, address
        outcome = self.kernel.record(info)
        self.done += info.done
        if OUTCOMES[outcome] in REFUSALS:  # one by one, which raises with the reason
            for name, value in zip(given, inputs[info.done].tolist(), strict=True):
                self.kernel.set(name, value)
        self.kernel.check(outcome)
