"""Files that vary another one: `base = "stage.toml"` takes from there what this file does not say itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.spec.reading.base import read_toml

_DEPTH = 8


@dataclass(frozen=True)
class Layers:
    """A file and its bases, nearest first; `tables` is what they say together."""

    files: tuple[tuple[Path, dict[str, Any]], ...]

    @property
    def path(self) -> Path:
        return self.files[0][0]

    @property
    def tables(self) -> dict[str, Any]:
        merged: dict[str, Any] = {}
        for _, raw in reversed(self.files):
            merged = merged_tables(merged, raw)
        return merged

    def changed(self, tables: dict[str, Any]) -> Layers:
        """The same file with what `tables` say instead, as if it stood there."""
        return Layers(((self.path, tables), *self.files)) if tables else self

    def attributed(self, problem: Problem) -> Problem:
        """The problem with the name of the file that holds the field, or of the nearest file when none does."""
        return replace(problem, file=str(self.holder(problem.field)))

    def holder(self, field: str) -> Path:
        """The nearest file that says something about a field ("gears.pinion.import.file"); `path` when none does."""
        keys = field.split(".")
        return next((path for path, raw in self.files if _holds(raw, keys)), self.path)


def read_layers(path: Path) -> Layers:
    """The file at `path` and its bases, paths relative to the naming file; SpecError: one is missing, or a ring."""
    files: list[tuple[Path, dict[str, Any]]] = []
    current = path
    while True:
        raw = read_toml(current)
        base = raw.pop("base", None)
        files.append((current, raw))
        if base is None:
            return Layers(tuple(files))
        if not isinstance(base, str) or not base:
            raise SpecError(
                [Problem(str(current), "base", str(base), 'expected the path of a file, e.g. base = "stage.toml"')]
            )
        following = current.parent / base
        if len(files) >= _DEPTH or any(following.resolve() == seen.resolve() for seen, _ in files):
            raise SpecError(
                [
                    Problem(
                        str(current),
                        "base",
                        base,
                        f"the bases form a ring or are more than {_DEPTH}: name the file that says it all",
                    )
                ]
            )
        if not following.is_file():
            raise SpecError(
                [
                    Problem(
                        str(current),
                        "base",
                        base,
                        f"there is no file {following}: write the path relative to this file",
                    )
                ]
            )
        current = following


def merged_tables(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """The tables `below`, but for what `above` says itself; None, which no file can say, takes a field away."""
    result = dict(below)
    for key, value in above.items():
        if value is None:
            result.pop(key, None)
            continue
        both = isinstance(value, dict) and isinstance(below.get(key), dict)
        result[key] = merged_tables(below[key], value) if both else value
    return result


def _holds(raw: Any, keys: list[str]) -> bool:
    for key in keys:
        if not isinstance(raw, dict) or key not in raw:
            return False
        raw = raw[key]
    return True
