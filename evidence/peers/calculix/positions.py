"""Loaded transmission error over one pitch by CalculiX: 12 positions, some torques, beside what `gearfmu te` says.

    python -m evidence.peers.calculix.positions [POSITION …] [--torque T …] [--pair fzg_c|sun_planet] [--work DIR]
                                    [--bores averaged|clamped] [--increments N] [--out FILE] [--compare]

Bores averaged: their mean displacement and rotation are prescribed (as `gearfmu te --rigid-bearings` does), into
positions.csv. Clamped: all nodes of a bore move as one rigid body, in both codes (`rigid_bores.py`: minutes before the
first run), into positions_clamped.csv. `sun_planet` (sun_planet.py), bores averaged, goes into sun_planet.csv. The
pinion is turned to where gearfmu expects the torque; from the torque that comes out (within a few per cent) te is moved
to the one asked by gearfmu's tangent stiffness. Where ccx ends with teeth that stick, or goes round in circles, te is
moved by up to 2 % and solved again. A position whose deck is that of the table is not run again unless it is named; its
te is moved by the tangent stiffness of today. `--compare` runs nothing: it prints both codes side by side. Needs
CalculiX's ccx (Debian: calculix-ccx); half a minute to some minutes a run.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.peers.calculix.case import Case, Load, Solution, digest, prepared, solve
from evidence.peers.calculix.ccx import first_solved, require_ccx
from evidence.peers.calculix.rigid_bores import rigid_bore_bodies
from evidence.peers.calculix.section import Fineness
from evidence.peers.calculix.sun_planet import TORQUES as OF_SET
from evidence.peers.calculix.sun_planet import set_bodies, sun_planet
from gearfmu.body import load_bodies
from gearfmu.files import written_whole
from gearfmu.geometry import PairGeometry
from gearfmu.geometry.mesh import contact_modulus, half_width
from gearfmu.stage import TeResult, assemble, loaded_te
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage

POSITIONS = 12
TORQUES = {"fzg_c": (80.0, 302.0, 600.0), "sun_planet": OF_SET}  # N·m on the pinion
MARGIN = 2.5e-3  # m: pairs as far beyond the ends of the path may touch with their tip edges
PATCH, SIZE = 1.35, 0.3  # fine zone and its elements, in Hertz half-widths of one pair that carries everything
NUDGES = (1.0, 1.01, 0.99, 1.02, 0.98, 1.005, 0.995, 1.015, 0.985)  # of te, in turn, until no teeth stick
INCREMENTS = 3  # of the load, where it does not settle in one
PENALTY = 1e16  # Pa/m: two pairs do not converge at 3e16; costs 0.3 % of stiffness at the pitch point
HERE = Path(__file__).parent


@dataclass(frozen=True)
class Place:
    """A row to come: torque (N·m), number of the position, bores "averaged" or "clamped", increments of the load."""

    torque: float
    position: int
    bores: str
    increments: int = 1


def te_of_gearfmu(spec: Stage, bores: str) -> TeResult:
    """Transmission error and tangent stiffness at all torques and positions."""
    if spec.name == "sun_planet":
        bodies = set_bodies()
    else:
        bodies = load_bodies(spec) if bores == "averaged" else rigid_bore_bodies(spec)
    return loaded_te(assemble(spec, bodies), TORQUES[spec.name], POSITIONS, **{"effect.bearings": 0.0})


def case_at(spec: Stage, pair: PairGeometry, torque: float, bores: str) -> Case:
    """Fine zone as wide as contact at this torque (N·m) needs it."""
    materials = [gear.material for gear in spec.gears]
    e_star = contact_modulus(
        (materials[0].youngs_modulus, materials[1].youngs_modulus),
        (materials[0].poisson_ratio, materials[1].poisson_ratio),
    )
    radius = pair.largest_relative_radius()
    load = torque / pair.gears[0].r_b / spec.gears[0].face_width
    wide = half_width(load, radius, e_star)
    fine = Fineness(patch=PATCH * wide, size=SIZE * wide)
    return Case("positions", bores=bores, fine=fine, penalty=PENALTY)


def solved(spec: Stage, ours: TeResult, place: Place, work: Path, known: dict[str, Any] | None) -> dict[str, Any]:
    """The table's row of one torque and position, made by running it unless `known` comes from the same deck."""
    torque, position = place.torque, place.position
    pair, width, row = spec.written.geometry, spec.gears[0].face_width, TORQUES[spec.name].index(torque)
    prefix = "" if spec.name == "fzg_c" else f"{spec.name}_"
    folder = work / f"{prefix}position_{position:02d}_{torque:g}{'' if place.bores == 'averaged' else '_clamped'}"
    case = replace(case_at(spec, pair, torque, place.bores), increments=place.increments)

    def load_of(te_um: float) -> Load:
        return Load(2 * math.pi / pair.gears[0].z * position / POSITIONS, 1e-6 * te_um, MARGIN)

    def attempt(nudge: float, case: Case = case) -> tuple[float, Solution]:
        te_um = round(1e6 * nudge * ours.te[row, position], 4)
        return te_um, solve(case, pair, width, [load_of(te_um)], folder)

    def of_same_deck(row: dict[str, Any], case: Case) -> bool:
        deck, _ = prepared(case, pair, width, load_of(float(row["solved_te_um"])), folder)
        return digest(deck) == row["deck_sha256"]

    slower = replace(case, increments=INCREMENTS)
    if known and any(of_same_deck(known, way) for way in (case, slower)):
        found = known
    else:
        try:
            te_um, solution = first_solved(NUDGES, attempt)
        except RuntimeError:
            te_um, solution = first_solved(NUDGES, lambda nudge: attempt(nudge, slower))
        force, wheel = solution.line_load[0] * width
        found = {
            "torque_Nm": f"{torque:g}",
            "position": f"{position / POSITIONS:.6f}",
            "te_um": "",
            "solved_te_um": f"{te_um:.4f}",
            "solved_torque_Nm": f"{force * pair.gears[0].r_b:.3f}",
            "wheel_torque_over_ratio_Nm": f"{wheel * pair.gears[0].r_b:.3f}",
            "seconds": f"{solution.seconds:.0f}",
            "deck_sha256": digest(folder / "load_0.inp"),
        }
    missing = (torque - float(found["solved_torque_Nm"])) / pair.gears[0].r_b
    te = float(found["solved_te_um"]) + 1e6 * missing / ours.mesh_stiffness[row, position]
    return {**found, "te_um": f"{te:.4f}"}


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


def compare(ours: TeResult, rows: list[dict[str, Any]]) -> None:
    """Print te (µm) of both codes, and mean and peak to peak over the positions that there are."""
    print("torque_Nm,position,calculix_um,gearfmu_um,difference_%")
    for torque, curve in zip(ours.torque, 1e6 * ours.te, strict=True):
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
    parser.add_argument("--torque", type=float, action="append", help="N·m on the pinion; may repeat")
    parser.add_argument("--pair", choices=TORQUES, default="fzg_c")
    parser.add_argument("--work", type=Path, default=Path("out/calculix"), help="decks, logs and results of ccx")
    parser.add_argument("--bores", choices=("averaged", "clamped"), default="averaged")
    parser.add_argument("--increments", type=int, default=1, help="in which the load is brought up; give --out as well")
    parser.add_argument("--out", type=Path, help="table; the one said above, beside this file")
    parser.add_argument("--compare", action="store_true")
    chosen = parser.parse_args()
    if chosen.pair == "sun_planet" and chosen.bores == "clamped":
        parser.error("sun_planet has averaged bores alone")
    table = "positions" if chosen.pair == "fzg_c" else chosen.pair
    out = chosen.out or HERE / f"{table}{'' if chosen.bores == 'averaged' else '_clamped'}.csv"
    spec, rows = load_stage("fzg_c") if chosen.pair == "fzg_c" else sun_planet(), read(out)
    ours = te_of_gearfmu(spec, chosen.bores)
    if chosen.compare:
        return compare(ours, rows)
    require_ccx()
    failed = []
    for torque in chosen.torque or TORQUES[spec.name]:
        for position in chosen.positions or range(POSITIONS):
            place = Place(torque, position, chosen.bores, chosen.increments)
            known = next((row for row in rows if _place(row) == (torque, position)), None)
            try:
                fresh = solved(spec, ours, place, chosen.work, None if chosen.positions else known)
            except RuntimeError as failure:
                failed.append(f"{torque:g} N·m, position {position}: {failure}")
                continue
            rows = [row for row in rows if row is not known] + [fresh]
            write(out, rows)
            print(f"{torque:g} N·m, position {position}: {fresh['te_um']} µm", file=sys.stderr, flush=True)
    if failed:
        raise SystemExit("\n".join(failed))


def _place(row: dict[str, Any]) -> tuple[float, int]:
    """Torque (N·m) and number of the position of a row."""
    return float(row["torque_Nm"]), round(POSITIONS * float(row["position"]))


if __name__ == "__main__":
    main()
