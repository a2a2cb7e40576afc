"""Recorder: chosen outputs of stage and drivetrain at every communication point, kept by the units' own logs."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from gearfmu.cosim.units import Recorded, Variable
from gearfmu.errors import CouplingError
from gearfmu.stage.run.trace import Channel, Trace

DRIVE = "drive."  # drivetrain variables are recorded under this prefix


class Recorder:
    """Rows of one run: `take` at every communication point, `trace` at the end.

    patterns : names of stage outputs, and of drivetrain outputs with the prefix "drive."; "*" and "?" as in file names.
    omit : patterns of names that are left out nevertheless. Raises CouplingError for a pattern that fits nothing.
    """

    def __init__(
        self, stage: Recorded, drive: Recorded, patterns: Sequence[str], points: int, omit: Sequence[str] = ()
    ) -> None:
        self._names = {prefix: _chosen(prefix, unit, patterns, omit) for prefix, unit in (("", stage), (DRIVE, drive))}
        everything = [prefix + name for prefix, unit in (("", stage), (DRIVE, drive)) for name in unit.outputs()]
        unfit = [pattern for pattern in patterns if not any(fnmatchcase(name, pattern) for name in everything)]
        if unfit:
            raise CouplingError(f"nothing to record for {', '.join(unfit)}; there are {', '.join(everything)}")
        units = {"": stage, DRIVE: drive}
        self._logs = {prefix: units[prefix].log(list(names), points) for prefix, names in self._names.items() if names}
        self._take = [log.take for log in self._logs.values()]
        self._time: list[float] = []

    @property
    def count(self) -> int:
        """Number of recorded times."""
        return len(self._time)

    def take(self, time: float) -> None:
        """Record the present outputs as those of `time`, s."""
        for take in self._take:
            take()
        self._time.append(time)

    def trace(self, meta: dict[str, Any]) -> Trace:
        """Everything recorded so far."""
        channels = {}
        for prefix, log in self._logs.items():
            for column, (name, about) in zip(log.rows()[: self.count].T, self._names[prefix].items(), strict=True):
                values = np.round(column).astype(np.int64) if about.whole else np.ascontiguousarray(column)
                channels[prefix + name] = Channel(values, about.unit, about.description)
        return Trace(np.array(self._time), channels, meta)


def _chosen(prefix: str, unit: Recorded, patterns: Sequence[str], omit: Sequence[str]) -> dict[str, Variable]:
    return {
        name: about
        for name, about in unit.outputs().items()
        if _fits(prefix + name, patterns) and not _fits(prefix + name, omit)
    }


def _fits(name: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)
