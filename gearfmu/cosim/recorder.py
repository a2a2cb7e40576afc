"""Recorder: chosen outputs of stage and drivetrain at every communication point, in arrays taken once."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from gearfmu.cosim.units import Unit, Variable
from gearfmu.errors import CouplingError
from gearfmu.stage.trace import Channel, Trace

DRIVE = "drive."  # drivetrain variables are recorded under this prefix


class Recorder:
    """Rows of one run: `take` at every communication point, `trace` at the end.

    patterns : names of stage outputs, and of drivetrain outputs with the prefix "drive."; "*" and "?" as in file names.
    Raises CouplingError for a pattern that fits nothing.
    """

    def __init__(self, stage: Unit, drive: Unit, patterns: Sequence[str], points: int) -> None:
        self._names = {"": _chosen("", stage, patterns), DRIVE: _chosen(DRIVE, drive, patterns)}
        everything = [prefix + name for prefix, unit in (("", stage), (DRIVE, drive)) for name in unit.outputs()]
        unfit = [pattern for pattern in patterns if not any(fnmatchcase(name, pattern) for name in everything)]
        if unfit:
            raise CouplingError(f"nothing to record for {', '.join(unfit)}; there are {', '.join(everything)}")
        self._units = {"": stage, DRIVE: drive}
        self._handles: dict[str, Any] = {
            prefix: unit.resolve(list(self._names[prefix])) for prefix, unit in self._units.items()
        }
        self._rows = {prefix: np.zeros((points, len(names))) for prefix, names in self._names.items()}
        self._time = np.zeros(points)
        self.count = 0

    def take(self, time: float) -> None:
        """Record the present outputs as those of `time`, s."""
        self._time[self.count] = time
        for prefix, unit in self._units.items():
            if self._names[prefix]:
                self._rows[prefix][self.count] = unit.get(self._handles[prefix])
        self.count += 1

    def trace(self, meta: dict[str, Any]) -> Trace:
        """Everything recorded so far."""
        channels = {}
        for prefix, names in self._names.items():
            for column, (name, about) in zip(self._rows[prefix][: self.count].T, names.items(), strict=True):
                values = np.round(column).astype(np.int64) if about.whole else column
                channels[prefix + name] = Channel(values, about.unit, about.description)
        return Trace(self._time[: self.count], channels, meta)


def _chosen(prefix: str, unit: Unit, patterns: Sequence[str]) -> dict[str, Variable]:
    return {
        name: about
        for name, about in unit.outputs().items()
        if any(fnmatchcase(prefix + name, pattern) for pattern in patterns)
    }
