"""KernelUnit: the kernel without an FMU around it as a unit, same library, same numbers as the FMU; `Source`, which
makes the unit of a run."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gearfmu.cosim.units import Variable
from gearfmu.errors import CouplingError, ModelError
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel

if TYPE_CHECKING:
    from gearfmu.cosim.fmu_unit import FmuUnit


class KernelHandle(NamedTuple):
    """Value references of resolved names, and the buffer of their values."""

    names: tuple[str, ...]
    references: Any  # ctypes array of unsigned 32-bit integers
    values: Any  # ctypes array that the kernel reads and fills
    buffer: np.ndarray  # the same memory


class RowLog:
    """Rows of what `read` gives, (names,), at up to `points` times."""

    def __init__(self, read: Callable[[], np.ndarray], names: int, points: int) -> None:
        self._read, self._table, self._count = read, np.zeros((points, names)), 0

    def take(self) -> None:
        """Keep the present outputs."""
        if self._count == len(self._table):
            raise CouplingError(f"the log holds {self._count} times and no more")
        self._table[self._count] = self._read()
        self._count += 1

    def rows(self) -> np.ndarray:
        """(times, names) kept so far."""
        return self._table[: self._count]


class KernelUnit:
    """Unit of a stage model's blob.

    parameters : start values by name; an enumeration also by its item, e.g. "standard".
    Raises ModelError when the kernel refuses a value, SimulationError when it gives a step up.
    """

    def __init__(self, blob: bytes, parameters: Mapping[str, float | bool | str] | None = None) -> None:
        self.kernel = Kernel(blob)
        for name, value in (parameters or {}).items():
            self.kernel.set(name, self._number(name, value))

    def _number(self, name: str, value: float | bool | str) -> float:
        if not isinstance(value, str):
            return float(value)
        items = self.kernel.variables[name].items if name in self.kernel.variables else ()
        if value not in items:
            raise ModelError(f"{name} = {value!r}: use one of {', '.join(items) or 'the numbers of its range'}")
        return float(items.index(value))

    def outputs(self) -> dict[str, Variable]:
        """All outputs of the kernel's table."""
        found = (v for v in self.kernel.variables.values() if v.causality == "output")
        return {v.name: Variable(v.unit, v.description, v.type != "Real") for v in found}

    def initialize(self, time: float) -> None:
        """Start from static equilibrium at the inputs set so far."""
        self.kernel.initialize(time)

    def resolve(self, names: Sequence[str]) -> KernelHandle:
        """Handle of variables; raises CouplingError naming those that the model does not have."""
        known = self.kernel.variables
        unknown = [name for name in names if name not in known]
        if unknown:
            raise CouplingError(f"{self.kernel.name}: no variable {', '.join(unknown)}; it has {', '.join(known)}")
        values = (ctypes.c_double * max(len(names), 1))()
        references = (ctypes.c_uint32 * len(names))(*[known[name].reference for name in names])
        return KernelHandle(tuple(names), references, values, np.ctypeslib.as_array(values)[: len(names)])

    def set(self, handle: KernelHandle, values: Sequence[float] | np.ndarray) -> None:
        """Inputs for the next step."""
        handle.buffer[:] = values
        if self.kernel.set_many(handle.references, handle.values):
            self._refused(handle)

    def _refused(self, handle: KernelHandle) -> None:
        """Set one by one, which raises with the kernel's reason, and leave all as they were."""
        before = [self.kernel.get(name) for name in handle.names]
        try:
            for name, value in zip(handle.names, handle.buffer.tolist(), strict=True):
                self.kernel.set(name, value)
        finally:
            for name, value in zip(handle.names, before, strict=True):
                self.kernel.set(name, value)

    def get(self, handle: KernelHandle) -> np.ndarray:
        """Values (k,) in the handle's buffer."""
        self.kernel.get_many(handle.references, handle.values)
        return handle.buffer

    def log(self, names: Sequence[str], points: int) -> RowLog:
        """Keeps these outputs at up to `points` times."""
        return RowLog(partial(self.get, self.resolve(names)), len(names), points)

    def step(self, time: float, h: float) -> None:
        """One communication step."""
        self.kernel.step(time, h)

    def save(self) -> bytes:
        """The state's bytes."""
        return self.kernel.save()

    def restore(self, state: bytes) -> None:
        """Back to a saved state."""
        self.kernel.restore(state)

    def adopt(self, other: KernelUnit) -> None:
        """Instead of `initialize`: continue from the state of `other` (`Kernel.adopt`)."""
        self.kernel.adopt(other.kernel)

    def close(self) -> None:
        """Nothing to free: Python owns the memory."""


@dataclass(frozen=True)
class Source:
    """A source of the stage of a run: the kernel itself (fmu_path None) or an FMU; the model it was made from."""

    model: StageModel
    fmu_path: Path | None = None

    def unit(self, parameters: Mapping[str, float | bool | str]) -> FmuUnit | KernelUnit:
        """A fresh instance with these start values."""
        if self.fmu_path is None:
            return KernelUnit(self.model.blob, parameters)
        from gearfmu.cosim.fmu_unit import FmuUnit

        return FmuUnit(self.fmu_path, parameters)
