"""Picture of what the flanks of a stage are beside nominal ones: along profile and face width, tooth by tooth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gearfmu.report.style import COLOURS, WIDTH, styled, written
from gearfmu.spec.forms.general import Stage
from gearfmu.spec.forms.shapes import gear_shape
from gearfmu.stage.build.flanks import FlankField

ROW = 2.2  # inches of a gear


def write_flanks(stage: Stage, path: Path) -> bool:
    """Write a picture with one row for every gear whose flanks are not nominal: material over the length of roll at
    mid-width and over the face width at the middle roll, all teeth, and index deviations by tooth; left flanks in
    full lines, right ones in broken ones. False, and no file, where all are nominal."""
    fields = [field for gear in stage.gears if (field := FlankField(gear, gear_shape(gear))).any]
    if not fields:
        return False
    with styled():
        figure = Figure(figsize=(WIDTH, ROW * len(fields) + 0.3), layout="constrained")
        rows = figure.subplots(len(fields), 3, squeeze=False)
        for axes, field in zip(rows, fields, strict=True):
            _draw(axes, field)
        written(figure, path)
    return True


def _draw(axes: Sequence[Axes], field: FlankField) -> None:
    """One gear."""
    along, across, by_tooth = axes
    z = np.linspace(-0.5, 0.5, 33) * field.gear.face_width
    material, rolls = field.whole(z), field.rolls
    index = np.broadcast_to(field.index(), (2, field.gear.teeth))
    for flank, style in ((0, "-"), (1, "--")):
        along.plot(1e3 * rolls, 1e6 * material[:, flank, z.size // 2].T, style, color=COLOURS[flank], lw=0.7)
        across.plot(1e3 * z, 1e6 * material[:, flank, :, rolls.size // 2].T, style, color=COLOURS[flank], lw=0.7)
        by_tooth.plot(1e6 * index[flank], style, color=COLOURS[flank], marker=".", ms=3)
    along.set(xlabel="length of roll in mm", ylabel=f"{field.gear.name}: material in µm")
    across.set(xlabel="place across the face width in mm")
    by_tooth.set(xlabel="tooth", ylabel="index deviation in µm")
