"""Stiffness of one tooth pair at the pitch point by CalculiX: the independent answer to "how far from ISO 6336's c'th?"

    python -m evidence.peers.calculix.pitch_point [CASE …] [--work DIR] [--out pitch_point.csv]

One row a case: secant and tangent at 300 N/mm from two turns of the pinion (te 3 % apart), bores rigid. A case whose
deck is that of the table is not run again unless it is named; all of them take an hour on one core. Needs CalculiX's
ccx (Debian: calculix-ccx).
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from evidence.peers.calculix.case import Case, Load, Solution, digest, pitch_point_turn, prepared, solve
from evidence.peers.calculix.ccx import require_ccx
from evidence.peers.calculix.section import Fineness
from gearfmu.files import written_whole
from gearfmu.geometry import PairGeometry
from gearfmu.spec.stage import StageSpec, load_stage

LINE_LOAD = 300e3  # N/m
HERE = Path(__file__).parent
FINE = Fineness(patch=0.3e-3, size=0.021e-3, coarse=0.75e-3, growth=1.3, thickness=9, depth_growth=1.6, rim=5, root=10,
                far_root=4, far_flank=4)  # fmt: skip

STRAIN = Case("plane_strain", condition="plane_strain")
ANSWER = Case("half_width", layers=1)
CASES = {
    case.name: case
    for case in (
        STRAIN,
        replace(STRAIN, name="plane_strain_fine", fine=FINE),
        replace(STRAIN, name="plane_strain_all_teeth", fine=Fineness(toothed=100)),
        replace(STRAIN, name="plane_strain_penalty_x10", penalty=10 * STRAIN.penalty),
        replace(STRAIN, name="plane_strain_C3D20", element="C3D20"),
        replace(STRAIN, name="plane_strain_averaged", bores="averaged"),
        replace(STRAIN, name="plane_strain_shaft", bore_radius=5e-3, fine=Fineness(rim=6)),
        Case("plane_stress", condition="plane_stress"),
        ANSWER,
        replace(ANSWER, name="half_width_2_layers", layers=2, layer_growth=0.5),
        replace(ANSWER, name="half_width_4_layers", layers=4, layer_growth=0.65),
        replace(ANSWER, name="half_width_averaged", bores="averaged"),
    )
}
GUESS = {"plane_stress": 12.5, "plane_strain": 13.5, "half_width": 13.0}  # N/(mm µm): where the two turns lie
SHAFT, AVERAGED = 0.34, 0.965  # … and by how much other bores change it


def row(case: Case, spec: StageSpec, work: Path, known: dict[str, Any] | None) -> dict[str, Any]:
    """The table's row of a case, made by running it unless `known` comes from the same deck."""
    pair = PairGeometry.of(spec)
    guess = 1e9 * GUESS[case.condition]
    guess *= SHAFT if case.bore_radius else AVERAGED if case.bores == "averaged" else 1.0
    te = LINE_LOAD / guess
    loads = [Load(pitch_point_turn(pair), part * te) for part in (0.985, 1.015)]
    width, folder = spec.gears[0].face_width, work / case.name
    deck, _ = prepared(case, pair, width, loads[0], folder)
    name = digest(deck)
    if known and known["deck_sha256"] == name:
        return known
    return entry(case, solve(case, pair, width, loads, folder)) | {"deck_sha256": name}


def entry(case: Case, solution: Solution) -> dict[str, Any]:
    """Numbers of a solved case."""
    load = solution.line_load[:, 0]
    balance = (solution.line_load[:, 0] / solution.line_load[:, 1] - 1)[-1]
    return {
        "case": case.name,
        "condition": case.condition,
        "bores": case.bores,
        "bore_radius_mm": "own" if case.bore_radius is None else f"{1e3 * case.bore_radius:g}",
        "element": case.element,
        "elements": solution.elements,
        "nodes": solution.nodes,
        "surface_element_um": f"{1e6 * case.fine.size:.0f}",
        "secant_N_per_mm_um": f"{1e-9 * LINE_LOAD / solution.te_at(LINE_LOAD):.4f}",
        "tangent_N_per_mm_um": f"{1e-9 * (load[1] - load[0]) / (solution.te[1] - solution.te[0]):.3f}",
        "line_load_N_per_mm": f"{1e-3 * load[0]:.1f}–{1e-3 * load[1]:.1f}",
        "torque_imbalance": f"{balance:.1e}",
        "seconds": f"{solution.seconds:.0f}",
    }


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Case → row of the table at `path`, nothing where there is none."""
    if not path.exists():
        return {}
    with open(path, newline="", encoding="utf-8") as file:
        return {line["case"]: line for line in csv.DictReader(file)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--stage", default="fzg_c")
    parser.add_argument("--work", type=Path, default=Path("out/calculix"), help="decks, logs and results of ccx")
    parser.add_argument("--out", type=Path, default=HERE / "pitch_point.csv")
    chosen = parser.parse_args()
    if unknown := [name for name in chosen.cases if name not in CASES]:
        parser.error(f"no case {', '.join(unknown)}; there are {', '.join(CASES)}")
    require_ccx()
    spec = load_stage(chosen.stage)
    for name in chosen.cases or CASES:
        table = read(chosen.out)
        known = None if chosen.cases else table.get(name)
        fresh = row(CASES[name], spec, chosen.work, known)
        kept = "of the same deck" if fresh is known else f"{fresh['seconds']} s"
        print(f"{name}: {fresh['secant_N_per_mm_um']} N/(mm µm), {kept}", file=sys.stderr, flush=True)
        table[name] = fresh
        with written_whole(chosen.out) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(fresh), lineterminator="\n")
            writer.writeheader()
            writer.writerows(table[name] for name in CASES if name in table)


if __name__ == "__main__":
    main()
