"""File of a radiation matrix: lines up to the reach of its mesh, as whole numbers; those above are ERP."""

from __future__ import annotations

import os

import numpy as np

from gearfmu.files import Format, reading, writing
from gearfmu.sound.radiation import Radiation
from gearfmu.sound.skin import SoundError

FILE = Format("gearfmu-radiation", 1, "radiation matrix", SoundError, "delete it: 'gearfmu reduce' makes it again")
STEPS = 2**15 - 1  # of √(Rᵢᵢ Rⱼⱼ), which no entry exceeds
NUMBERS = ("impedance", "reach", "patches")


def save_radiation(sound: Radiation, path: str | os.PathLike[str], made_of: str) -> None:
    """Write a matrix under a temporary name, then rename it to `path`; made_of: hash of the body whose it is."""
    solved = int((sound.frequency <= sound.reach).sum())
    own = sound.resistance[:solved].astype(float)
    scale = np.sqrt(np.maximum(np.diagonal(own, axis1=1, axis2=2), 1e-300))
    upper = np.triu_indices(own.shape[1])
    steps = np.rint(STEPS * (own / (scale[:, :, None] * scale[:, None, :]))[:, upper[0], upper[1]])
    with writing(path, FILE) as file:
        file.attrs["made_of"] = made_of
        for name in NUMBERS:
            file.attrs[name] = getattr(sound, name)
        values = {"frequency": sound.frequency, "balance": sound.balance, "scale": scale.astype("f4")}
        values |= {"steps": np.clip(steps, -STEPS, STEPS).astype("i2"), "gram": sound.gram[upper].astype("f4")}
        for name, own in values.items():
            file.create_dataset(f"sound/{name}", data=own, compression="gzip", shuffle=True)


def load_radiation(path: str | os.PathLike[str]) -> tuple[Radiation, str]:
    """Matrix and hash of its body. SoundError for a file that is missing, damaged or of another kind."""
    with reading(path, FILE) as file:
        frequency, balance, scale, steps, packed = (
            np.asarray(file[f"sound/{name}"][()]) for name in ("frequency", "balance", "scale", "steps", "gram")
        )
        impedance, reach, patches = (float(file.attrs[name]) for name in NUMBERS)
        made_of = str(file.attrs["made_of"])
    gram = _square(packed.astype(float), scale.shape[1])
    solved = _square(steps / STEPS, scale.shape[1]) * scale[:, :, None] * scale[:, None, :]
    high = np.broadcast_to(impedance * gram, (len(frequency) - len(scale), *gram.shape))
    resistance = np.concatenate([solved, high]).astype("f4")
    return Radiation(frequency, resistance, gram, impedance, reach, balance, int(patches)), made_of


def _square(upper: np.ndarray, size: int) -> np.ndarray:
    """(…, N, N), symmetric, of upper triangles by rows (…, N(N+1)/2)."""
    found = np.zeros((*upper.shape[:-1], size, size))
    rows, columns = np.triu_indices(size)
    found[..., rows, columns] = found[..., columns, rows] = upper
    return found
