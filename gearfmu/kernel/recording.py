"""Rows of outputs that the kernel writes itself, many communication steps by one call."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence

import numpy as np

from gearfmu.kernel.binding import REFUSALS, RecordingInfo
from gearfmu.kernel.instance import Kernel


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
        refused; SimulationError where a step fails: what was made until then is kept."""
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
        if outcome in REFUSALS:  # one by one, which raises with the reason
            for name, value in zip(given, inputs[info.done].tolist(), strict=True):
                self.kernel.set(name, value)
        self.kernel.check(outcome)
