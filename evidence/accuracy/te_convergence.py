"""Convergence of the loaded transmission error of a stage's stored bodies in what the kernel makes of them: slices
across the face width and rolls of the grid along the flank. (Convergence in the finite-element mesh:
body_convergence.py, which makes the bodies anew.)

    python -m evidence.accuracy.te_convergence [STAGE] [--torque 302 --torque 80] [--out te_convergence.csv]

One row a setting: mean and peak to peak over one pitch, and the largest difference to the finest setting. Axes with
their bearings.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.body import ReducedBody, load_bodies
from gearfmu.files import written_whole
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.stage import assemble, loaded_te
from gearfmu.stage.build.tables import ROLLS

SLICES = (1, 2, 3, 5, 10)
GRIDS = (16, 24, ROLLS, 2 * ROLLS, 4 * ROLLS)
POSITIONS = 256


def settings() -> Iterator[tuple[str, int, int]]:
    """(what is refined, slices, rolls), the finest of each kind last."""
    yield from (("slices", slices, ROLLS) for slices in SLICES)
    yield from (("rolls", 5, rolls) for rolls in GRIDS)


def rows(spec: StageSpec, bodies: list[ReducedBody], torque: float) -> list[dict[str, Any]]:
    """The table for one torque, µm."""
    curves = {}
    for key in settings():
        _, slices, rolls = key
        curves[key] = 1e6 * loaded_te(assemble(spec, bodies, rolls), [torque], POSITIONS, slices=slices).te[0]
    finest = {key[0]: curve for key, curve in curves.items()}
    return [
        {
            "stage": spec.name,
            "torque_Nm": torque,
            "refined": kind,
            "slices": slices,
            "rolls": rolls,
            "te_mean_um": f"{curve.mean():.4f}",
            "te_peak_to_peak_um": f"{np.ptp(curve):.4f}",
            "largest_difference_um": f"{np.abs(curve - finest[kind]).max():.5f}",
        }
        for (kind, slices, rolls), curve in curves.items()
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", nargs="?", default="fzg_c")
    parser.add_argument("--torque", type=float, action="append", help="N·m on the pinion; may repeat")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".csv"))
    chosen = parser.parse_args()
    spec = load_stage(chosen.stage)
    bodies = load_bodies(spec)
    table = [row for torque in chosen.torque or (302.0, 80.0) for row in rows(spec, bodies, torque)]
    with written_whole(chosen.out) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    csv.DictWriter(sys.stdout, list(table[0]), lineterminator="\n").writerows(table)


if __name__ == "__main__":
    main()
