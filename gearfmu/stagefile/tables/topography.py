"""Topographies of flanks: CSV files of measured or designed deviations (format: docs/howto-flanks.md).

A row is one point of one flank. Columns, in any order: `roll` or `diameter`, `z` (place across the face width, from its
middle, towards +z), `deviation` (normal to the involute in the transverse section, positive: more material), each with
its unit after an underscore (roll_mm, z_mm, deviation_um); and, where flanks differ, `flank` (left, right) and `tooth`.
Seen from the +z end with the tooth upwards, the left flank is the one at its larger angle. How rows are written:
gearfmu.stagefile.tables.rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from gearfmu.errors import Problem, UnitError
from gearfmu.quantities import to_si
from gearfmu.stagefile.tables.rows import Row, RowReader, number, uneven

FLANKS = ("left", "right")  # index 0: sg = +1, index 1: sg = −1
_LARGEST = 1e-3  # m
_QUANTITIES = ("roll", "diameter", "z", "deviation")

Key = tuple[int | None, int]  # tooth (None: all), flank


@dataclass(frozen=True)
class Patch:
    """One flank: deviation (R, W) m, positive where there is material, at rolls (R,) m and places across the face width
    (W,) m, both ascending."""

    roll: np.ndarray
    z: np.ndarray
    deviation: np.ndarray

    def at(self, roll: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Deviation (len(roll), len(z)) m: cubic splines through the points, beyond them that of the edge."""
        along = _spline(self.roll, self.deviation, np.clip(roll, self.roll[0], self.roll[-1]))
        return _spline(self.z, along.T, np.clip(z, self.z[0], self.z[-1])).T


@dataclass(frozen=True)
class Topography:
    """Deviations of the flanks of a gear. patches: by tooth and flank (0: sg = +1); tooth None: every tooth that has
    none of its own. A flank without a patch is nominal; teeth that were not measured have the mean of those that
    were."""

    patches: Mapping[Key, Patch]

    @property
    def each(self) -> bool:
        """Whether teeth differ."""
        return any(tooth is not None for tooth, _ in self.patches)

    def grid(self, teeth: int, roll: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Deviation (teeth or 1, 2, len(z), len(roll)) m on a grid."""
        result = np.zeros((teeth if self.each else 1, 2, z.size, roll.size))
        for flank in (0, 1):
            known = {tooth: patch.at(roll, z).T for (tooth, side), patch in self.patches.items() if side == flank}
            if not known:
                continue
            result[:, flank] = known.get(None, np.mean(list(known.values()), axis=0))
            for tooth, values in known.items():
                if tooth is not None:
                    result[tooth, flank] = values
        return result


def _spline(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubic spline ("not-a-knot") through y (n, …) at x (n,); of few points the polynomial through them."""
    if x.size == 1:
        return np.repeat(y, at.size, axis=0)
    return np.asarray(make_interp_spline(x, y, k=min(3, x.size - 1) if x.size != 3 else 2)(at))


def read_topography(path: Path, teeth: int, shape: Any) -> tuple[Topography | None, list[Problem]]:
    """The topography of a gear of `teeth` teeth, or None and everything that is wrong with its file. shape : r_b,
    s_form and s_tip (m) of the gear; where the file gives diameters, rolls follow from r_b."""
    reader = _Reader(str(path), teeth, shape)
    rows = reader.rows(path, f"{path} cannot be read ({{why}}): write the path relative to the stage file")
    if rows is not None:
        reader.read(rows)
    found = {} if reader.problems else {key: reader.patch(key, points) for key, points in reader.points.items()}
    patches = {key: patch for key, patch in found.items() if patch is not None}
    return (None, reader.shown) if reader.problems else (Topography(patches), [])


class _Reader(RowReader):
    def __init__(self, file: str, teeth: int, shape: Any):
        super().__init__(file)
        self.teeth, self.shape = teeth, shape
        self.columns: dict[str, tuple[int, float]] = {}  # name: place, SI size of its unit
        self.points: dict[Key, dict[tuple[float, float], float]] = {}

    def read(self, rows: list[Row]) -> None:
        if not rows:
            return self.refuse("", "", "the file holds no rows: give a head roll_mm,z_mm,deviation_um and points")
        where, names = rows[0]
        self.read_head(where, names)
        if self.problems:
            return None
        if len(rows) == 1:
            return self.refuse("", "", "the file holds a head and no points: give at least one row")
        for where, cells in rows[1:]:
            self.read_row(where, cells, len(names))
        return None

    def read_head(self, where: str, names: list[str]) -> None:
        for i, name in enumerate(names):
            quantity, _, unit = name.partition("_")
            if name in ("tooth", "flank"):
                self.columns[name] = (i, 1.0)
            elif quantity not in _QUANTITIES:
                known = "roll_mm or diameter_mm, z_mm, deviation_um, flank, tooth"
                self.refuse(where, name, f"unknown column: known are {known}")
            else:
                try:
                    self.columns[quantity] = (i, to_si(f"1 {unit}", "m"))
                except UnitError:
                    remedy = f"a length needs its unit: write {quantity}_mm or {quantity}_um"
                    self.refuse(where, name, remedy)
        for wanted in ("z", "deviation"):
            if wanted not in self.columns and not self.problems:
                self.refuse(where, ",".join(names), f"the column {wanted}_… is missing: add it")
        if ("roll" in self.columns) == ("diameter" in self.columns) and not self.problems:
            self.refuse(where, ",".join(names), "give the places along the profile once, as roll_mm or as diameter_mm")

    def read_row(self, where: str, cells: list[str], width: int) -> None:
        if len(cells) != width:
            return self.refuse(where, ",".join(cells), uneven(len(cells), width))
        numbers = {}
        for name in (name for name in self.columns if name not in ("tooth", "flank")):
            i, size = self.columns[name]
            try:
                numbers[name] = size * number(cells[i])
            except ValueError:
                self.refuse(f"{where}, {name}", cells[i], "expected a number")
                return None
        keys = self._keys(where, cells)
        place = self._place(where, numbers)
        if keys is None or place is None:
            return None
        if not abs(numbers["deviation"]) <= _LARGEST:
            value = f"{1e6 * numbers['deviation']:g} um"
            return self.refuse(f"{where}, deviation", value, "more than 1 mm: check the unit in the head")
        for key in keys:
            if place in self.points.setdefault(key, {}):
                return self.refuse(where, ",".join(cells), "this point is there twice: remove one")
            self.points[key][place] = numbers["deviation"]
        return None

    def _keys(self, where: str, cells: list[str]) -> list[Key] | None:
        tooth: int | None = None
        if "tooth" in self.columns:
            text = cells[self.columns["tooth"][0]]
            if not text.isdigit() or int(text) >= self.teeth:
                remedy = f"there is no such tooth: they are numbered 0 to {self.teeth - 1}"
                self.refuse(f"{where}, tooth", text, remedy)
                return None
            tooth = int(text)
        if "flank" not in self.columns:
            return [(tooth, 0), (tooth, 1)]
        text = cells[self.columns["flank"][0]]
        if text not in FLANKS:
            self.refuse(f"{where}, flank", text, 'a flank is "left" or "right"')
            return None
        return [(tooth, FLANKS.index(text))]

    def _place(self, where: str, numbers: dict[str, float]) -> tuple[float, float] | None:
        """Roll and z (m), to a picometre, so that points of one row and column of the grid are found."""
        r_b = self.shape.r_b
        if "diameter" in numbers:
            square = numbers["diameter"] ** 2 / 4 - r_b**2
            if not square >= 0 or not numbers["diameter"] > 0:
                remedy = f"below the base circle, {2e3 * r_b:.6g} mm, there is no involute: leave the point away"
                self.refuse(f"{where}, diameter", f"{1e3 * numbers['diameter']:g} mm", remedy)
                return None
            roll = float(np.sqrt(square))
        else:
            roll = numbers["roll"]
        if not (np.isfinite(numbers["z"]) and abs(numbers["z"]) < 10 and 0 <= roll < 10):
            self.refuse(where, f"roll {roll:g} m, z {numbers['z']:g} m", "no place on a flank: check the units")
            return None
        return round(roll, 12), round(numbers["z"], 12)

    def patch(self, key: Key, points: dict[tuple[float, float], float]) -> Patch | None:
        """The grid of one flank's points; None where some are missing, or it lies beside the flank."""
        rolls, places = (np.array(sorted(set(axis))) for axis in zip(*points, strict=True))
        name = FLANKS[key[1]] + " flank" + ("" if key[0] is None else f" of tooth {key[0]}")
        if rolls.size * places.size != len(points):
            missing = next((r, z) for r in rolls for z in places if (r, z) not in points)
            remedy = "every roll needs a point at every z: measure on a grid, or interpolate to one"
            self.refuse(name, f"none at roll {1e3 * missing[0]:g} mm, z {1e3 * missing[1]:g} mm", remedy)
            return None
        low, high = sorted((self.shape.s_form, self.shape.s_tip))
        if rolls[-1] < low or rolls[0] > high:
            remedy = f"beside the flank, whose rolls are {1e3 * low:.6g} to {1e3 * high:.6g} mm: check unit and column"
            self.refuse(name, f"{1e3 * rolls[0]:g} to {1e3 * rolls[-1]:g} mm", remedy)
            return None
        return Patch(rolls, places, np.array([[points[r, z] for z in places] for r in rolls]))
