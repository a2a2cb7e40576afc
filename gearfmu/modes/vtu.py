"""Mode shapes, and gears deformed over time, as .vtu for ParaView and other tools."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np

from gearfmu.files import write_text, written_whole
from gearfmu.modes.deformed import DeformedGear
from gearfmu.modes.shapes import BodyModes, Mode

SUFFIXES = ("", "_2")


def write_mode(body: BodyModes, mode: Mode, path: str | os.PathLike[str]) -> None:
    """Write the body's surface (quadratic quadrilaterals) with a mode, whole or not at all.

    Point data, float32: `displacement` (m, as drawn in the pictures: "Warp By Vector" with factor 1) and
    `mass_normalised` (kg^-½); those of the second mode of a pair end in `_2`.
    """
    data = {}
    for suffix, drawn, shape in zip(SUFFIXES, body.drawn(mode), mode.shape, strict=False):
        data[f"displacement{suffix}"] = drawn.astype(np.float32)
        data[f"mass_normalised{suffix}"] = shape.astype(np.float32)
    _write(body.points, ("quad8", body.faces), data, Path(path))


def write_series(gear: DeformedGear, time: Sequence[float] | np.ndarray, folder: str | os.PathLike[str]) -> Path:
    """Write one <gear>_0000.vtu a frame and <gear>.pvd, which gives them their times (s); returns the path of the
    latter.

    Point data, float32, m, in axes fixed to the gear: `displacement`, and `elastic`, the same without rigid motion.
    """
    home, (points, quads) = Path(folder), gear.surface
    names = [f"{gear.name}_{frame:04d}.vtu" for frame in range(len(gear.motion.amplitude))]
    for frame, name in enumerate(names):
        elastic = gear.elastic(frame)
        fields = {"displacement": elastic + gear.rigid(frame), "elastic": elastic}
        data = {field: values.astype(np.float32) for field, values in fields.items()}
        _write(points, ("quad", quads), data, home / name)
    sets = [
        f'  <DataSet timestep="{float(t):.9g}" part="0" file="{name}"/>\n' for t, name in zip(time, names, strict=True)
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n <Collection>\n'
    write_text(home / f"{gear.name}.pvd", f"{head}{''.join(sets)} </Collection>\n</VTKFile>\n")
    return home / f"{gear.name}.pvd"


def _write(points: np.ndarray, cells: tuple[str, np.ndarray], data: dict[str, np.ndarray], path: Path) -> None:
    with written_whole(path) as temporary:
        meshio.Mesh(points.astype(np.float32), [cells], data).write(temporary, file_format="vtu")
