"""Deformation of gears at chosen times of a run: rigid motion and modal amplitudes, and their HDF5 file."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.errors import GearfmuError
from gearfmu.files import Format, reading, writing


class DeformationError(GearfmuError):
    """A file of deformations is not valid, or does not belong to the bodies at hand."""


FILE = Format(
    "gearfmu-deformation",
    1,
    "deformation",
    DeformationError,
    "make it again: 'gearfmu run', a scene with [deformation]",
)
FILE_NAME = "deformation.h5"


@dataclass(frozen=True)
class GearMotion:
    """Motion of one gear in its own axes over F frames. body_hash: of the reduced body whose modes are meant; modes
    (k,): their numbers there, from 1; amplitude (F, k), m: over the root of the body's mass; motion (F, 6), m and rad:
    rigid, x, y, z, rx, ry, rz."""

    body_hash: str
    modes: np.ndarray
    amplitude: np.ndarray
    motion: np.ndarray


@dataclass(frozen=True)
class Deformation:
    """Frames of a run. time (F,) s; pictures, film: numbers of the frames meant for either; gears: name → motion; meta:
    what the run was, any JSON value."""

    time: np.ndarray
    pictures: np.ndarray
    film: np.ndarray
    gears: Mapping[str, GearMotion]
    meta: Mapping[str, Any]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file (docs/file-formats.md), whole or not at all."""
        packed: Any = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
        with writing(path, FILE) as file:
            file.attrs["meta"] = json.dumps(dict(self.meta), sort_keys=True)
            file["time"], file["pictures"], file["film"] = self.time, self.pictures, self.film
            for name, gear in self.gears.items():
                group = file.create_group(f"gears/{name}")
                group.attrs["body"] = gear.body_hash
                group["modes"] = gear.modes
                group.create_dataset("amplitude", data=gear.amplitude, **packed)
                group.create_dataset("motion", data=gear.motion, **packed)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Deformation:
        """Read a file written by `save`. DeformationError when it is missing, damaged or of another kind."""
        with reading(path, FILE) as file:
            gears = {
                name: GearMotion(str(g.attrs["body"]), g["modes"][()], g["amplitude"][()], g["motion"][()])
                for name, g in file["gears"].items()
            }
            time, pictures, film = (file[name][()] for name in ("time", "pictures", "film"))
            return Deformation(time, pictures, film, gears, json.loads(file.attrs["meta"]))
