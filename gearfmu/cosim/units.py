"""What a master knows of a unit: names resolved once, then set / step / get / save / restore."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from gearfmu.errors import CouplingError


class Variable(NamedTuple):
    """What a recorded variable is: unit as in the FMU ("N.m"), description, and whether it counts (integers and
    booleans)."""

    unit: str
    description: str
    whole: bool = False


class Log(Protocol):
    """Chosen outputs of a unit at many times."""

    def take(self) -> None:
        """Keep the present outputs."""

    def rows(self) -> np.ndarray:
        """(times, names) kept so far."""


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


class Recorded(Protocol):
    """What a recorder asks of either side of a coupling."""

    def outputs(self) -> Mapping[str, Variable]: ...
    def log(self, names: Sequence[str], points: int) -> Log: ...


class Unit(Recorded, Protocol):
    """One side of a coupling.

    `resolve` is called once for each set of names and returns a handle with its own buffers; `get` fills and returns
    the handle's buffer (k,), which the next `get` with that handle overwrites. `log` keeps outputs at up to `points`
    times. `save` returns a state that `restore` takes back any number of times, bit for bit. `step` raises
    SimulationError when the unit cannot go on.
    """

    def initialize(self, time: float) -> None: ...
    def resolve(self, names: Sequence[str]) -> Any: ...
    def set(self, handle: Any, values: Sequence[float] | np.ndarray) -> None: ...
    def get(self, handle: Any) -> np.ndarray: ...
    def step(self, time: float, h: float) -> None: ...
    def save(self) -> Any: ...
    def restore(self, state: Any) -> None: ...
