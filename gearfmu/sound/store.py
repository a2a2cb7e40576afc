"""File of a radiation matrix."""

from __future__ import annotations

import os

import numpy as np

from gearfmu.hdf5 import Format, reading, writing
from gearfmu.sound.radiation import Radiation
from gearfmu.sound.skin import SoundError

FILE = Format("gearfmu-radiation", 1, "radiation matrix", SoundError, "delete it: 'gearfmu sound' makes it again")
ARRAYS = ("frequency", "resistance", "gram", "balance")


def save_radiation(sound: Radiation, path: str | os.PathLike[str], made_of: str) -> None:
    """Write a matrix under a temporary name, then rename it to `path`; made_of says which body's it is."""
    with writing(path, FILE) as file:
        file.attrs["made_of"] = made_of
        file.attrs["impedance"], file.attrs["reach"] = sound.impedance, sound.reach
        arrays = (sound.frequency, sound.resistance, sound.gram, sound.balance)
        for name, values in zip(ARRAYS, arrays, strict=True):
            file.create_dataset(f"sound/{name}", data=values, compression="gzip", shuffle=True)


def load_radiation(path: str | os.PathLike[str]) -> tuple[Radiation, str]:
    """Matrix and what it was made of. SoundError for a file that is missing, damaged or of another kind."""
    with reading(path, FILE) as file:
        frequency, resistance, gram, balance = (np.asarray(file[f"sound/{name}"][()]) for name in ARRAYS)
        impedance, reach = float(file.attrs["impedance"]), float(file.attrs["reach"])
        return Radiation(frequency, resistance, gram, impedance, reach, balance), str(file.attrs["made_of"])
