"""Loaded transmission error over one pitch by CalculiX: 12 positions, three torques, beside what `gearfmu te` says.

    python benchmarks/calculix/positions.py [POSITION …] [--work DIR] [--out positions.csv] [--compare]

The bores' mean displacement and rotation are prescribed (as `gearfmu te --rigid-bearings` does), the pinion turned to
three angles a position; te at the torques asked is read off the parabola through the three points. Positions that the
table has are not run again unless named. `--compare` runs nothing: it prints both codes side by side.
Needs CalculiX's ccx (Debian: calculix-ccx); some minutes a position.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from case import Case, Load, solve
from ccx import require_ccx
from gearfmu.body import load_stage_bodies
from gearfmu.files import written_whole
from gearfmu.geometry import PairGeometry
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.stage import assemble, loaded_te
from section import Fineness

POSITIONS = 12
TORQUES = (80.0, 302.0, 600.0)  # N·m on the pinion
MARGIN = 2.5e-3  # m: pairs as far beyond the ends of the path may touch with their tip edges
CASE = Case("positions", bores="averaged", fine=Fineness(patch=0.42e-3, size=0.05e-3))
HERE = Path(__file__).parent


def te_of_gearfmu(spec: StageSpec) -> np.ndarray:
    """(torques, positions) m."""
    model = assemble(spec, load_stage_bodies(spec))
    return loaded_te(model, TORQUES, POSITIONS, rigid_bearings=True).te


def solved(spec: StageSpec, position: int, guess: np.ndarray, work: Path) -> list[dict[str, Any]]:
    """Rows of one position; guess (torques,) m: the displacements at which CalculiX is asked for the torque."""
    pair = PairGeometry.of(spec)
    turn = 2 * math.pi / pair.gears[0].z * position / POSITIONS
    width = spec.gears[0].face_width
    loads = [Load(turn, te, MARGIN) for te in guess]
    solution = solve(CASE, pair, width, loads, work / f"position_{position:02d}")
    balance = (solution.line_load[:, 0] / solution.line_load[:, 1] - 1).tolist()
    return [
        {
            "torque_Nm": f"{torque:g}",
            "position": f"{position / POSITIONS:.6f}",
            "te_um": f"{1e6 * solution.te_at(torque / width / pair.gears[0].r_b):.4f}",
            "torque_imbalance": f"{imbalance:.1e}",
            "seconds": f"{solution.seconds:.0f}",
        }
        for torque, imbalance in zip(TORQUES, balance, strict=True)
    ]


def read(path: Path) -> list[dict[str, Any]]:
    """The table's rows, none where there is no table."""
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    """The table in the order of torque and position."""
    rows = sorted(rows, key=lambda row: (float(row["torque_Nm"]), float(row["position"])))
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def compare(spec: StageSpec, rows: list[dict[str, Any]]) -> None:
    """Print te of both codes, and mean and peak to peak over the positions that there are."""
    ours = 1e6 * te_of_gearfmu(spec)
    print("torque_Nm,position,calculix_um,gearfmu_um,difference_%")
    for torque, curve in zip(TORQUES, ours, strict=True):
        here = [row for row in rows if float(row["torque_Nm"]) == torque]
        index = [round(POSITIONS * float(row["position"])) for row in here]
        te = np.array([float(row["te_um"]) for row in here])
        for k, value in zip(index, te, strict=True):
            print(f"{torque:g},{k / POSITIONS:.4f},{value:.3f},{curve[k]:.3f},{100 * (curve[k] / value - 1):+.2f}")
        if here:
            mine = curve[index]
            print(
                f"# {torque:g} N·m, {len(here)} positions: mean {100 * (mine.mean() / te.mean() - 1):+.2f} %, "
                f"peak to peak {100 * (np.ptp(mine) / max(np.ptp(te), 1e-9) - 1):+.2f} %"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("positions", nargs="*", type=int, metavar="POSITION", help=f"0 … {POSITIONS - 1}")
    parser.add_argument("--stage", default="fzg_c")
    parser.add_argument("--work", type=Path, default=Path("out/calculix"), help="decks, logs and results of ccx")
    parser.add_argument("--out", type=Path, default=HERE / "positions.csv")
    parser.add_argument("--compare", action="store_true")
    chosen = parser.parse_args()
    spec, rows = load_stage(chosen.stage), read(chosen.out)
    if chosen.compare:
        return compare(spec, rows)
    require_ccx()
    guess = te_of_gearfmu(spec)
    done = {round(POSITIONS * float(row["position"])) for row in rows}
    for position in chosen.positions or [k for k in range(POSITIONS) if k not in done]:
        fresh = solved(spec, position, guess[:, position], chosen.work)
        rows = [row for row in rows if round(POSITIONS * float(row["position"])) != position] + fresh
        write(chosen.out, rows)
        print(f"position {position}: {[row['te_um'] for row in fresh]} µm", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
