"""What a body knows of points that nothing loads: sensors, and the closed outer surface that radiates. Optional groups
of its file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TypedDict

import h5py
import numpy as np

from gearfmu.body.layout import PICTURE_BITS, Entry
from gearfmu.body.packing import read_entry, write_entry

NAMES = "names"  # attribute of the group "sensors"


@dataclass(frozen=True)
class Sensors:
    """S points with three directions each. names; points (S, 3) m; rigid_rows (3S, 6): rigid motion about the origin;
    rows (3S, n), kg^-½; static (3S, m), m/N and 1/N: per unit load on the interfaces."""

    names: tuple[str, ...]
    points: np.ndarray
    rigid_rows: np.ndarray
    rows: np.ndarray
    static: np.ndarray


@dataclass(frozen=True)
class Skin:
    """A closed surface: points (P, 3) m; faces (F, 4), normals outward, a triangle repeats its last point; modes
    (6 + n, P, 3): displacement in rigid motion about the origin (1 and m), then in the oscillators, kg^-½."""

    points: np.ndarray
    faces: np.ndarray
    modes: np.ndarray

    @property
    def skin_modes(self) -> np.ndarray:
        """(P, 3, 6 + n): `modes`, by points."""
        return self.modes.transpose(1, 2, 0)


SENSORS = (
    Entry("sensors/points", "points", ("S", 3), "m", "where each sensor lies"),
    Entry("sensors/rigid_rows", "rigid_rows", (3, 6), "1, m", "x, y, z of each by rigid motion about the origin"),
    Entry("sensors/rows", "rows", (3, "n"), "kg-1/2", "displacement x, y, z of each by the oscillators"),
    Entry("sensors/static", "static", (3, "m"), "m/N, 1/N", "the same per unit load on the interfaces"),
)
SKIN = (
    Entry("skin/points", "points", ("P", 3), "m", "points of the closed outer surface", "f4"),
    Entry("skin/faces", "faces", ("F", 4), "", "its faces, normals outward; a triangle repeats its last point", "i8"),
    Entry(
        "skin/modes",
        "modes",
        ("k", "P", 3),
        "1, m, kg-1/2",
        "displacement of the points: rigid motion x, y, z, rx, ry, rz about the origin, then the oscillators",
        "f4",
        bits=PICTURE_BITS,
        each=True,
    ),
)


def write_sensed(file: h5py.File, sensors: Sensors | None, skin: Skin | None) -> None:
    """Write the groups that a body has."""
    for part, entries in ((sensors, SENSORS), (skin, SKIN)):
        for entry in entries if part is not None else ():
            write_entry(file, entry, np.asarray(vars(part)[entry.field], dtype=entry.kind))
    if sensors is not None:
        file["sensors"].attrs[NAMES] = json.dumps(sensors.names)


class Sensed(TypedDict, total=False):
    """`sensors` and `skin` of a body, as far as its file has them."""

    sensors: Sensors
    skin: Skin


def read_sensed(file: h5py.File) -> Sensed:
    """What is there."""
    found: Sensed = {}
    if "sensors" in file:
        values = {entry.field: read_entry(file[entry.path], entry) for entry in SENSORS}
        found["sensors"] = Sensors(tuple(json.loads(file["sensors"].attrs[NAMES])), **values)
    if "skin" in file:
        found["skin"] = Skin(**{entry.field: read_entry(file[entry.path], entry) for entry in SKIN})
    return found


def sensed_problems(sensors: Sensors | None, skin: Skin | None, m: int, n: int) -> list[str]:
    """What is wrong with the parts of a body with m interface rows and n oscillators."""
    wanted: list[tuple[str, np.ndarray, tuple[int, ...]]] = []
    if sensors is not None:
        count = len(sensors.names)
        wanted += [
            ("sensors/points", sensors.points, (count, 3)),
            ("sensors/rigid_rows", sensors.rigid_rows, (3 * count, 6)),
            ("sensors/rows", sensors.rows, (3 * count, n)),
            ("sensors/static", sensors.static, (3 * count, m)),
        ]
    if skin is not None:
        points = len(skin.points)
        wanted += [("skin/points", skin.points, (points, 3)), ("skin/modes", skin.modes, (6 + n, points, 3))]
        wanted.append(("skin/faces", skin.faces, (len(skin.faces), 4)))
    problems = [f"{name} has shape {own.shape}, expected {shape}" for name, own, shape in wanted if own.shape != shape]
    if not problems:
        problems = [
            f"{name} holds a number that is not finite" for name, own, _ in wanted if not np.isfinite(own).all()
        ]
    if not problems and skin is not None and not 0 <= skin.faces.min() <= skin.faces.max() < len(skin.points):
        problems.append("skin/faces name points that there are not")
    return problems
