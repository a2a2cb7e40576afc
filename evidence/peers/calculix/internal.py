"""Loaded transmission error of a pinion in a ring over one pitch by CalculiX, beside what `gearfmu te` says.

    python -m evidence.peers.calculix.internal [POSITION …] [--torque T …] [--work DIR] [--compare]

The stage is internal/stage.toml beside this file; its bodies are reduced into the work folder first (minutes). Both
codes hold the means of bore and rim; half the width, one layer of quadratic elements, whole pinion and whole ring. The
way to the torque asked is that of `positions.py`. Table: internal.csv beside this file; what it has is not run again
unless its position is named. `--compare` runs nothing. Needs CalculiX's ccx; about a minute a run.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.peers.calculix.case import Case, Load
from evidence.peers.calculix.ccx import first_solved, require_ccx, run_deck, torques
from evidence.peers.calculix.deck import Placed, Problem, write_deck
from evidence.peers.calculix.positions import NUDGES, PATCH, PENALTY, SIZE, read, write
from evidence.peers.calculix.ring_section import ring_plane
from evidence.peers.calculix.section import Fineness, gear_plane
from evidence.peers.calculix.solid import extruded
from gearfmu.body import reduce_bodies
from gearfmu.geometry.mesh import RingMesh, contact_modulus, half_width
from gearfmu.stage import TeResult, assemble, loaded_te
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage

POSITIONS = 8
TORQUES = (40.0, 120.0)  # N·m on the pinion
MARGIN = 0.0  # m beyond the ends of the path of contact: the kernel has no tip edges in contact in a ring yet
FLANKS = {"effect.tip_contact": 0.0}  # as in the other program, which has no tip edges in contact either
HERE = Path(__file__).parent
STAGE, TABLE = HERE / "internal" / "stage.toml", HERE / "internal.csv"


@dataclass(frozen=True)
class Pair:
    """The stage, its engagement by itself and what the kernel says at TORQUES and POSITIONS."""

    spec: Stage
    mesh: RingMesh
    ours: TeResult

    @property
    def width(self) -> float:
        """Face width, m."""
        return min(gear.face_width for gear in self.spec.gears)


def pair_of(work: Path) -> Pair:
    """Stage, geometry and the kernel's transmission error; reduces the bodies where the work folder has none."""
    spec = load_stage(STAGE)
    bodies, mesh = reduce_bodies(spec, work / "internal"), mesh_shape(spec, spec.engagements[0])
    assert isinstance(mesh, RingMesh)
    return Pair(spec, mesh, loaded_te(assemble(spec, bodies), TORQUES, POSITIONS, **{"effect.bearings": 0.0}, **FLANKS))


def touching(mesh: RingMesh, turn: float) -> dict[int, tuple[float, float]]:
    """Rolls (m) on pinion and ring where tooth k of the pinion at the angle `turn` (rad) touches space k, of those on
    the path of contact; the pinion stands on +x of the ring."""
    first = mesh.planet.r_b * (turn + mesh.planet.psi_b + mesh.alpha_wt)
    low, high = mesh.path["A"] - MARGIN, mesh.path["E"] + MARGIN
    count = range(math.ceil((low - first) / mesh.base_pitch), math.floor((high - first) / mesh.base_pitch) + 1)
    return {k: (first + k * mesh.base_pitch, first + k * mesh.base_pitch + mesh.length) for k in count}


def case_at(pair: Pair, torque: float) -> Case:
    """Fine zone as wide as contact at this torque (N·m) needs it."""
    materials = [gear.material for gear in pair.spec.gears]
    e_star = contact_modulus(
        (materials[0].youngs_modulus, materials[1].youngs_modulus),
        (materials[0].poisson_ratio, materials[1].poisson_ratio),
    )
    load = torque / pair.mesh.planet.r_b / pair.width
    wide = half_width(load, pair.mesh.largest_relative_radius(), e_star)
    fine = Fineness(patch=PATCH * wide, size=SIZE * wide, coarse=1.0e-3, thickness=5)
    return Case("internal", bores="averaged", fine=fine, penalty=PENALTY)


def problem_of(case: Case, pair: Pair, load: Load) -> Problem:
    """The contact problem of a case. All teeth of the ring are there: they stiffen its rim by a tenth."""
    mesh, contacts = pair.mesh, touching(pair.mesh, load.turn)
    teeth = range(-(mesh.planet.z // 2), mesh.planet.z - mesh.planet.z // 2)
    sections = (
        gear_plane(mesh.planet, {k: rolls[0] for k, rolls in contacts.items()}, teeth, case.fine),
        ring_plane(
            mesh.ring,
            {k: rolls[1] for k, rolls in contacts.items()},
            replace(case.fine, far_root=1, toothed=mesh.ring.z),
        ),
    )
    solids = [extruded(section, np.array([0.0, 0.5 * pair.width])) for section in sections]
    phase = mesh.ring_phase(load.turn, 0.0)
    return Problem(
        gears=(
            Placed("P", solids[0], np.array([mesh.a, 0.0]), load.turn, case.bores, load.te / mesh.planet.r_b),
            Placed("R", solids[1], np.zeros(2), phase, case.bores, 0.0),
        ),
        pairs=[(k, k) for k in contacts],
        penalty=case.penalty,
        element=case.element,
        increments=case.increments,
    )


def solved(pair: Pair, torque: float, position: int, work: Path) -> dict[str, Any]:
    """The table's row of one torque and position; te is moved by up to 2 % where ccx does not settle."""
    number, case = TORQUES.index(torque), case_at(pair, torque)
    turn = 2 * math.pi / pair.mesh.planet.z * position / POSITIONS
    folder, expected = work / f"internal_{position:02d}_{torque:g}", pair.ours.te[number, position]
    folder.mkdir(parents=True, exist_ok=True)

    def attempt(nudge: float) -> tuple[Load, Problem, Path, float]:
        load = Load(turn, nudge * expected)
        problem, deck = problem_of(case, pair, load), folder / "load_0.inp"
        write_deck(problem, deck)
        return load, problem, deck, run_deck(deck)

    load, problem, deck, seconds = first_solved(NUDGES, attempt)
    base = np.array([gear.r_b for gear in pair.mesh.gears])
    force, ring = 2 * np.abs(torques(problem, deck.with_suffix(".dat"))) / base  # both halves of the width
    te = load.te + (torque / base[0] - force) / pair.ours.mesh_stiffness[number, position]
    return {
        "torque_Nm": f"{torque:g}",
        "position": f"{position / POSITIONS:.6f}",
        "te_um": f"{1e6 * te:.4f}",
        "solved_te_um": f"{1e6 * load.te:.4f}",
        "solved_torque_Nm": f"{force * base[0]:.3f}",
        "ring_torque_over_ratio_Nm": f"{ring * base[0]:.3f}",
        "gearfmu_te_um": f"{1e6 * expected:.4f}",
        "pairs": len(problem.pairs),
        "nodes": sum(len(gear.solid.nodes) for gear in problem.gears),
        "seconds": f"{seconds:.0f}",
    }


def compare(rows: list[dict[str, Any]]) -> None:
    """Print te (µm) of both codes from the table, and mean and peak to peak over the positions that there are."""
    print("torque_Nm,position,calculix_um,gearfmu_um,difference_%")
    for torque in TORQUES:
        here = [row for row in rows if float(row["torque_Nm"]) == torque]
        theirs, mine = (np.array([float(row[name]) for row in here]) for name in ("te_um", "gearfmu_te_um"))
        for row, a, b in zip(here, theirs, mine, strict=True):
            print(f"{torque:g},{row['position']},{a:.3f},{b:.3f},{100 * (b / a - 1):+.2f}")
        if here:
            print(
                f"# {torque:g} N·m, {len(here)} positions: mean {theirs.mean():.3f} and {mine.mean():.3f} µm, "
                f"{100 * (mine.mean() / theirs.mean() - 1):+.2f} %; peak to peak {np.ptp(theirs):.3f} and "
                f"{np.ptp(mine):.3f} µm; largest difference {100 * np.abs(mine / theirs - 1).max():.2f} %"
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("positions", nargs="*", type=int, metavar="POSITION", help=f"0 … {POSITIONS - 1}")
    parser.add_argument("--torque", type=float, action="append", choices=TORQUES, help="N·m on the pinion; may repeat")
    parser.add_argument("--work", type=Path, default=Path("out/calculix"), help="bodies, decks, logs and results")
    parser.add_argument("--out", type=Path, default=TABLE)
    parser.add_argument("--compare", action="store_true")
    chosen = parser.parse_args()
    rows = read(chosen.out)
    if chosen.compare:
        return compare(rows)
    require_ccx()
    pair, failed = pair_of(chosen.work), []
    done = {_place(row) for row in rows}
    for torque in chosen.torque or TORQUES:
        for position in chosen.positions or [k for k in range(POSITIONS) if (torque, k) not in done]:
            try:
                fresh = solved(pair, torque, position, chosen.work)
            except RuntimeError as failure:
                failed.append(f"{torque:g} N·m, position {position}: {failure}")
                continue
            rows = [row for row in rows if _place(row) != (torque, position)] + [fresh]
            write(chosen.out, rows)
            ours = fresh["gearfmu_te_um"]
            print(f"{torque:g} N·m, {position}: {fresh['te_um']} µm, ours {ours}", file=sys.stderr, flush=True)
    if failed:
        raise SystemExit("\n".join(failed))


def _place(row: dict[str, Any]) -> tuple[float, int]:
    """Torque (N·m) and number of the position of a row."""
    return float(row["torque_Nm"]), round(POSITIONS * float(row["position"]))


if __name__ == "__main__":
    main()
