"""Mode shapes as .vtu for ParaView and other tools."""

from __future__ import annotations

import os

import meshio
import numpy as np

from gearfmu.files import written_whole
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
    with written_whole(path) as temporary:
        meshio.Mesh(body.points.astype(np.float32), [("quad8", body.faces)], data).write(temporary, file_format="vtu")
