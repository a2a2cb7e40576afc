"""The errors a user may meet. Each is one clear message: what, where, and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with an input: where, what stands there, why that cannot be and what to write."""

    file: str
    field: str
    value: str
    remedy: str

    def __str__(self) -> str:
        place = ": ".join(part for part in (self.file, self.field) if part)
        shown = f" = {self.value}" if self.value else ""
        return f"{place}{shown}: {self.remedy}"


class GearfmuError(Exception):
    """Base of all errors that are the input's or the surroundings' fault, not ours."""


class OutputError(GearfmuError, OSError):
    """A file that cannot be written where it was asked for."""


class UnitError(GearfmuError):
    """A quantity that cannot be read: no number, no unit, an unknown unit or one of another dimension."""


class SpecError(GearfmuError):
    """A stage or scene file that cannot be used; `problems` lists everything that is wrong with it."""

    def __init__(self, problems: Iterable[Problem]):
        self.problems: tuple[Problem, ...] = tuple(problems)
        assert self.problems, "a SpecError without a problem"
        super().__init__("\n".join(str(problem) for problem in self.problems))

    @classmethod
    def of(cls, file: object, field: str, value: object, remedy: str) -> SpecError:
        """The error with one problem."""
        return cls([Problem(str(file), field, str(value), remedy)])


class MeshError(GearfmuError):
    """A geometry that the mesher cannot fill with valid elements at the chosen counts."""


class BodyError(GearfmuError):
    """A reduced body that is missing, damaged, stale or of another version."""


class ModelError(GearfmuError):
    """A stage model that cannot be assembled or opened."""


class FmuError(GearfmuError):
    """An FMU that cannot be exported, loaded or driven."""


class CouplingError(GearfmuError):
    """Units that cannot be coupled as asked: missing or doubly driven signals, unequal steps, an unstable cut."""


class SimulationError(GearfmuError):
    """A run that stopped early: `outcome` is the kernel's named outcome, `time` the last good time in seconds."""

    def __init__(self, message: str, outcome: str, time: float):
        super().__init__(message)
        self.outcome = outcome
        self.time = time


def near_or_all(word: str, known: Iterable[str], all_of_them: str, mark: str = '"', cutoff: float = 0.5) -> str:
    """'did you mean "force"?' for a word that is not known, where one is near; else `all_of_them` and the list."""
    names = list(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=cutoff)
    return f"did you mean {mark}{near[0]}{mark}?" if near else f"{all_of_them} {', '.join(names)}"
