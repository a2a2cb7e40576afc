"""KernelUnit: the kernel without an FMU around it, as a unit. Same library, same numbers as the FMU."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gearfmu.cosim.units import Variable
from gearfmu.errors import CouplingError, ModelError
from gearfmu.kernel import Kernel


class KernelHandle(NamedTuple):
    """Value references of resolved names, the buffer of their values and its single numbers for the kernel to fill."""

    names: tuple[str, ...]
    references: tuple[int, ...]
    buffer: np.ndarray
    cells: tuple[ctypes.c_double, ...]


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
        memory = (ctypes.c_double * max(len(names), 1))()
        cells = tuple(ctypes.c_double.from_buffer(memory, 8 * k) for k in range(len(names)))
        buffer = np.frombuffer(memory, count=len(names))
        return KernelHandle(tuple(names), tuple(known[name].reference for name in names), buffer, cells)

    def set(self, handle: KernelHandle, values: Sequence[float]) -> None:
        """Inputs for the next step."""
        set_one = self.kernel.set_reference
        for name, reference, value in zip(handle.names, handle.references, values, strict=True):
            if set_one(reference, value):
                self.kernel.set(name, float(value))  # raises with the kernel's reason

    def get(self, handle: KernelHandle) -> np.ndarray:
        """Values (k,) in the handle's buffer."""
        get_one = self.kernel.get_reference
        for reference, cell in zip(handle.references, handle.cells, strict=True):
            get_one(reference, cell)
        return handle.buffer

    def step(self, time: float, h: float) -> None:
        """One communication step."""
        self.kernel.step(time, h)

    def save(self) -> bytes:
        """The state's bytes."""
        return self.kernel.save()

    def restore(self, state: bytes) -> None:
        """Back to a saved state."""
        self.kernel.restore(state)

    def close(self) -> None:
        """Nothing to free: Python owns the memory."""
