"""Torque and speed over time: CSV files with a head like `time_[s],torque_[N*m],speed_[rpm]`, as traces are exported.

A row is a point; between points the values follow straight lines, outside they stay. Columns in any order, each with
its unit; `torque` or `speed` may be missing. Tables are read as measuring programs write them: names in capitals too,
units in brackets, parentheses or a row of their own, other columns beside these, and a clock that began before the
table, whose first point is time 0. Separators and decimal signs: gearfmu.stagefile.tables.rows.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gearfmu.errors import SpecError, UnitError
from gearfmu.quantities import range_of, to_si
from gearfmu.stagefile.tables.rows import Row, RowReader, number, uneven

UNITS = {"time": "s", "torque": "N*m", "speed": "rad/s"}
EXAMPLE = "time_[s],torque_[N*m],speed_[rpm]"
_HEADING = re.compile(r"(\w+?)[_ ]*[\[(](.+)[\])]")


@dataclass(frozen=True)
class Profile:
    """Straight lines through points. time: (n,) s, ascending from 0 on; torque: (n,) N·m, speed: (n,) rad/s, both of
    the input, None where the file does not say."""

    time: np.ndarray
    torque: np.ndarray | None = None
    speed: np.ndarray | None = None

    @property
    def duration(self) -> float:
        """Time of the last point, s."""
        return float(self.time[-1])


def read_profile(path: Path) -> Profile:
    """The profile in a CSV file. SpecError with everything that is wrong with it."""
    reader = _Reader(str(path))
    rows = reader.rows(path, "the profile cannot be read ({why}): name a CSV file")
    found = None if rows is None else reader.read(rows)
    if reader.problems:
        raise SpecError(reader.shown)
    assert found is not None, "no profile and no problem"
    return found


class _Reader(RowReader):
    def read(self, rows: list[Row]) -> Profile | None:
        if not rows:
            self.refuse("", "", f"the file holds no rows: give a head {EXAMPLE} and points")
            return None
        rows = with_units(rows)
        scales = self.head(*rows[0])
        points = [self.row(where, cells, scales) for where, cells in rows[1:]]
        if len(points) < 2:
            self.refuse("", "", "a profile needs at least two points")
        if self.problems:
            return None
        columns = {name: np.array([point[name] for point in points]) for name in UNITS if name in points[0]}
        self.times(columns["time"], [where for where, _ in rows[1:]])
        columns["time"] = columns["time"] - columns["time"][0]
        return Profile(**columns)

    def head(self, where: str, cells: list[str]) -> list[tuple[str, float]]:
        """Of every column its name ("" where it is none of ours) and the SI size of its unit."""
        found = [self.column(where, cell) for cell in cells]
        names = [name for name, _ in found if name]
        known = [name for name in UNITS if any(cell.lower().startswith(name) for cell in cells)]
        if "time" not in known:
            self.refuse(where, ",".join(cells), f"there is no time: write a head like {EXAMPLE}")
        elif len(known) == 1:
            self.refuse(where, ",".join(cells), f"there is neither torque nor speed: write a head like {EXAMPLE}")
        for name in UNITS:
            if names.count(name) > 1:
                self.refuse(where, ",".join(cells), f"{name} is there twice: remove one")
        return found

    def column(self, where: str, text: str) -> tuple[str, float]:
        match = _HEADING.fullmatch(text)
        name = (match[1] if match else text).lower()
        if name not in UNITS:
            if near := difflib.get_close_matches(name, UNITS, 1):
                self.refuse(where, text, f"did you mean {near[0]}? A profile has {', '.join(UNITS)}, as in {EXAMPLE}")
        elif match is None:
            self.refuse(where, text, f"the unit is missing: write {name}_[{UNITS[name]}] or another unit of its kind")
        else:
            try:
                return name, to_si(f"1 {match[2]}", UNITS[name])
            except UnitError as error:
                self.refuse(where, text, str(error))
        return "", 1.0

    def row(self, where: str, cells: list[str], scales: list[tuple[str, float]]) -> dict[str, float]:
        if len(cells) != len(scales):
            self.refuse(where, ",".join(cells), uneven(len(cells), len(scales)))
            return {}
        found = {}
        for (name, scale), cell in zip(scales, cells, strict=True):
            value = number(cell) if _is_number(cell) else np.nan
            if name and not np.isfinite(value):
                self.refuse(f"{where}, {name}", cell, "expected a finite number")
            elif name and (refusal := range_of(name).refusal(scale * value)):
                self.refuse(f"{where}, {name}", range_of(name).shown(scale * value), refusal)
            found[name] = scale * value
        return found

    def times(self, time: np.ndarray, places: list[str]) -> None:
        for k in np.flatnonzero(np.diff(time) <= 0) + 1:
            if time[k] == time[k - 1]:
                why = "two points at one time: for a step, let the second one follow a little later, such as 1 us"
            else:
                why = f"before the point above it, {time[k - 1]:g} s: sort the points, times must grow"
            self.refuse(places[k], f"{time[k]:g} s", why)


def with_units(rows: list[Row]) -> list[Row]:
    """The rows with the units of a second row, which has no number, in the head."""
    if len(rows) < 2 or not rows[1][1] or any(_is_number(cell) for cell in rows[1][1]):
        return rows
    units = [cell.strip("[]()") for cell in rows[1][1]] + [""] * len(rows[0][1])
    head = [f"{name}_[{unit}]" if unit else name for name, unit in zip(rows[0][1], units, strict=False)]
    return [(rows[0][0], head), *rows[2:]]


def _is_number(cell: str) -> bool:
    try:
        number(cell)
    except ValueError:
        return False
    return True
