"""What a master knows of a unit: names resolved once, then set / step / get / save / restore."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np


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


class Recorded(Protocol):
    """What a recorder asks of either side of a coupling."""

    def outputs(self) -> Mapping[str, Variable]: ...
    def log(self, names: Sequence[str], points: int) -> Log: ...


class Unit(Recorded, Protocol):
    """One side of a coupling.

    `resolve` is called once for each set of names and returns a handle with its own buffers; `get` fills and returns
    the handle's buffer (k,), which the next `get` with that handle overwrites. `log` keeps outputs at up to `points`
    times. `save` returns a state that `restore` takes back any number of times, bit for bit. `step` raises
    SimulationError when the unit cannot go on. `close` frees what it holds.
    """

    def initialize(self, time: float) -> None: ...
    def resolve(self, names: Sequence[str]) -> Any: ...
    def set(self, handle: Any, values: Sequence[float] | np.ndarray) -> None: ...
    def get(self, handle: Any) -> np.ndarray: ...
    def step(self, time: float, h: float) -> None: ...
    def save(self) -> Any: ...
    def restore(self, state: Any) -> None: ...
    def close(self) -> None: ...
