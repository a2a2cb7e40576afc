"""Helical gears against CalculiX: loaded transmission error, load over the width, one pair with a tilted axis.

    python benchmarks/calculix/helical.py [POSITION …] [--torque T …] [--tilted] [--fine] [--work DIR] [--compare]

The pair is `helical_demo` with 12 mm of width (overlap ratio 0.58) and without modifications. Both gears are whole and
twisted, with quadratic elements and five layers across the width; fine zones follow the slanting lines of contact. Both
codes have rigid bores that are held. --tilted: the wheel's axis turned by 1 µm over 1 mm across the
line of centres. The way to the torque asked is that of positions.py. Table: helical.csv beside this file, one row a
solution with the load share of every layer in both codes; what it has is not run again unless its position is named.
--fine: layers have elements of 0.6 mm where a line of contact ends at a tip edge inside the width (table:
helical_fine.csv). The bodies are reduced into the work folder first (some minutes). `--compare` runs nothing. Needs
CalculiX's ccx; a minute or two a run, fine ones up to five.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ccx import first_solved, require_ccx, run_deck
from deck import Problem
from helical_section import Zone, twisted
from positions import NUDGES, PENALTY, read, write
from section import Fineness
from spatial_deck import Tilted, bore_loads, layer_forces, write_spatial_deck

sys.path.insert(0, str(Path(__file__).parents[1]))

from helical_overlap import bodies_of  # noqa: E402  (found through the line above)

from gearfmu.body import ReducedBody, load_body  # noqa: E402
from gearfmu.body.store import save_body  # noqa: E402
from gearfmu.geometry import PairGeometry, hertz  # noqa: E402
from gearfmu.spec.stage import StageSpec, load_stage  # noqa: E402
from gearfmu.spec.tables.gear import MeshSpec  # noqa: E402
from gearfmu.spec.tables.lead import Misalignment  # noqa: E402
from gearfmu.stage import assemble  # noqa: E402
from gearfmu.stage.run.te import TANGENT, place_of, statics_of  # noqa: E402

WIDTH, LAYERS, SLICES = 12e-3, 5, 10
POSITIONS = 4
TORQUES = (40.0, 110.0)  # N·m on the pinion
TILT = 1e-3  # rad, of the wheel's axis across the line of centres
MARGIN = 0.4e-3  # m beyond the ends of the path where tooth pairs are still in the deck
PATCH, ZONE = 1.5, Zone()  # half length of the fine zones in Hertz half-widths, elements
MESH = MeshSpec(flank=14, thickness=4, root=5, rim=3, width=6)
ROLLS, FUNCTIONS = 20, 6
FINE = {0: (1, 2, 4, 4, 1), 1: (1,) * 5, 2: (1, 2, 4, 4, 1), 3: (4, 3, 1, 2, 4)}  # elements of each layer, by position
TABLE = Path(__file__).with_suffix(".csv")


@dataclass(frozen=True)
class Ours:
    """What the kernel says: te (m), tangent dF/dte (N/m) with F in the transverse line of action, share (LAYERS,)."""

    te: float
    stiffness: float
    share: np.ndarray


def stage(tilted: bool) -> StageSpec:
    """The pair of this comparison."""
    demo = load_stage("helical_demo")
    error = Misalignment(in_plane=0.0, out_of_plane=TILT * WIDTH, span=WIDTH) if tilted else None
    gears = []
    for gear in demo.gears:
        body = gear.body.model_copy(update={"mesh": MESH, "roll_points": ROLLS, "width_functions": FUNCTIONS})
        changes = {"face_width": WIDTH, "tip_relief": None, "lead": None, "body": body, "bore_coupling": "rigid"}
        gears.append(gear.model_copy(update=changes))
    pair = demo.pair.model_copy(update={"misalignment": error})
    return demo.model_copy(update={"gears": tuple(gears), "pair": pair})


def bodies(work: Path) -> list[ReducedBody]:
    """The reduced gears with rigid bores, kept in the work folder."""
    files, spec = [work / f"helical_{name}.h5" for name in ("pinion", "wheel")], stage(False)
    if not all(file.exists() for file in files):
        work.mkdir(parents=True, exist_ok=True)
        for body, file in zip(bodies_of(spec), files, strict=True):
            save_body(body, file)
    return [load_body(file) for file in files]


def ours(spec: StageSpec, gears: list[ReducedBody], torque: float, position: int) -> Ours:
    """The kernel's answer at a position (of POSITIONS) with bores held."""
    model = assemble(spec, gears)
    kernel = statics_of(model, **{"effect.bearings": 0.0, "slices": float(SLICES)})
    at = -position / POSITIONS * place_of(model, None).pitch
    state = kernel.transmission(at, torque)
    ends = [kernel.transmission(at, torque * (1 + sign * TANGENT)).te for sign in (-1, 1)]
    slices = np.sum(list(state.forces.values()), axis=0).reshape(LAYERS, -1).sum(axis=1)
    lever = PairGeometry.of(spec).gears[0].r_b
    return Ours(state.te, 2 * TANGENT * torque / lever / (ends[1] - ends[0]), slices / slices.sum())


def touching(pair: PairGeometry, turn: float) -> dict[tuple[int, int], tuple[float, float]]:
    """Rolls (m) at mid-width on pinion and wheel by (pinion tooth, wheel tooth), of the pairs that are near the path of
    contact somewhere across the width."""
    first = pair.gears[0].r_b * (turn + pair.gears[0].psi_b + pair.alpha_wt)
    lean = WIDTH / 2 * abs(math.tan(pair.gears[0].beta_b)) + MARGIN
    low, high = pair.path["A"] - lean, pair.path["E"] + lean
    count = range(math.ceil((low - first) / pair.base_pitch), math.floor((high - first) / pair.base_pitch) + 1)
    rolls = {k: first + k * pair.base_pitch for k in count}
    return {(k, -k): (roll, pair.length - roll) for k, roll in rolls.items()}


def levels_of(divisions: tuple[int, ...]) -> np.ndarray:
    """Corner levels z (m) of the elements, each layer divided by its number."""
    ends = np.linspace(-WIDTH / 2, WIDTH / 2, LAYERS + 1)
    inner = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(ends, ends[1:], divisions, strict=False)]
    return np.concatenate([*inner, ends[-1:]])


def problem_at(spec: StageSpec, torque: float, position: int, te: float, divisions: tuple[int, ...]) -> Problem:
    """The contact problem of a place."""
    pair = PairGeometry.of(spec)
    turn = 2 * math.pi / pair.gears[0].z * position / POSITIONS
    contacts = touching(pair, turn)
    steel = spec.gears[0].material
    e_star = hertz.contact_modulus((steel.youngs_modulus,) * 2, (steel.poisson_ratio,) * 2)
    radius = hertz.largest_relative_radius(pair.length, pair.path["A"], pair.path["E"])
    wide = hertz.half_width(torque / pair.gears[0].r_b / WIDTH, radius, e_star)
    fine = Fineness(
        patch=PATCH * wide, growth=2.0, thickness=2, depth_growth=2.6, rim=2, root=2, far_root=1, far_flank=1
    )
    levels = levels_of(divisions)
    solids = [
        twisted(gear, {teeth[g]: rolls[g] for teeth, rolls in contacts.items()}, levels, fine, ZONE).solid
        for g, gear in enumerate(pair.gears)
    ]
    phase = pair.wheel_phase - turn * pair.gears[0].r_b / pair.gears[1].r_b
    error = spec.pair.misalignment
    tilt = (0.0, 0.0) if error is None else (-error.out_of_plane / error.span, error.in_plane / error.span)
    return Problem(
        gears=(
            Tilted("P", solids[0], np.zeros(2), turn, "clamped", te / pair.gears[0].r_b),
            Tilted("W", solids[1], np.array([pair.a, 0.0]), phase, "clamped", 0.0, tilt=tilt),
        ),
        pairs=list(contacts),
        penalty=PENALTY,
        element="C3D20R",
    )


def solved(chosen: Any, gears: list[ReducedBody], torque: float, position: int) -> dict[str, Any]:
    """The table's row of one place; te is moved by up to 2 % where ccx does not settle. chosen: tilted, fine, work."""
    spec, tilted, work = stage(chosen.tilted), chosen.tilted, chosen.work
    divisions = FINE[position] if chosen.fine else (1,) * LAYERS
    mine, r_b = ours(spec, gears, torque, position), PairGeometry.of(spec).gears[0].r_b
    folder = work / f"helical_{position}_{torque:g}{'_tilted' if tilted else ''}"
    folder.mkdir(parents=True, exist_ok=True)
    deck = folder / "load_0.inp"

    def attempt(nudge: float) -> tuple[float, Problem, float]:
        te = nudge * mine.te
        problem = problem_at(spec, torque, position, te, divisions)
        write_spatial_deck(problem, deck)
        return te, problem, run_deck(deck)

    te, problem, seconds = first_solved(NUDGES, attempt)
    loads, layers = bore_loads(problem, deck.with_suffix(".dat")), layer_forces(problem, deck.with_suffix(".dat"))
    moment = abs(loads[0, 5])
    share = np.add.reduceat(layers.sum(axis=0), np.cumsum((0, *divisions[:-1]))) / layers.sum()
    row = {
        "case": "tilted" if tilted else "parallel",
        "torque_Nm": f"{torque:g}",
        "position": f"{position / POSITIONS:.6f}",
        "te_um": f"{1e6 * (te + (torque - moment) / r_b / mine.stiffness):.4f}",
        "solved_te_um": f"{1e6 * te:.4f}",
        "solved_torque_Nm": f"{moment:.3f}",
        "gearfmu_te_um": f"{1e6 * mine.te:.4f}",
        "axial_N": f"{loads[0, 2]:.2f}",
        "pairs": len(problem.pairs),
        "nodes": sum(len(gear.solid.nodes) for gear in problem.gears),
        "seconds": f"{seconds:.0f}",
    }
    row |= {f"share_{k + 1}": f"{value:.5f}" for k, value in enumerate(share)}
    return row | {f"gearfmu_share_{k + 1}": f"{value:.5f}" for k, value in enumerate(mine.share)}


def compare(rows: list[dict[str, Any]]) -> None:
    """Print te (µm) of both codes and the largest difference of a layer's share, of the largest share."""
    print("case,torque_Nm,position,calculix_um,gearfmu_um,difference_%,largest difference of a share_%")
    for row in rows:
        shares = np.array([[float(row[f"{who}share_{k + 1}"]) for k in range(LAYERS)] for who in ("", "gearfmu_")])
        off = np.abs(shares[1] - shares[0]).max() / shares[0].max()
        a, b = float(row["te_um"]), float(row["gearfmu_te_um"])
        print(
            f"{row['case']},{row['torque_Nm']},{row['position']},{a:.3f},{b:.3f},{100 * (b / a - 1):+.2f},"
            f"{100 * off:.1f}"
        )
    for case, torque in sorted({(row["case"], row["torque_Nm"]) for row in rows}):
        here = [row for row in rows if (row["case"], row["torque_Nm"]) == (case, torque)]
        a, b = (np.mean([float(row[name]) for row in here]) for name in ("te_um", "gearfmu_te_um"))
        print(f"# {case}, {torque} N·m, {len(here)} positions: mean {a:.3f} and {b:.3f} µm, {100 * (b / a - 1):+.2f} %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("positions", nargs="*", type=int, metavar="POSITION", help=f"0 … {POSITIONS - 1}")
    parser.add_argument("--torque", type=float, action="append", choices=TORQUES, help="N·m on the pinion; may repeat")
    parser.add_argument("--tilted", action="store_true")
    parser.add_argument("--fine", action="store_true")
    parser.add_argument("--work", type=Path, default=Path("out/calculix"), help="bodies, decks, logs and results")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--compare", action="store_true")
    chosen = parser.parse_args()
    chosen.out = chosen.out or (TABLE.with_stem("helical_fine") if chosen.fine else TABLE)
    rows = read(chosen.out)
    if chosen.compare:
        return compare(rows)
    require_ccx()
    gears, failed, case = bodies(chosen.work), [], "tilted" if chosen.tilted else "parallel"
    done = {_place(row) for row in rows}
    for torque in chosen.torque or TORQUES:
        for position in chosen.positions or [k for k in range(POSITIONS) if (case, torque, k) not in done]:
            try:
                fresh = solved(chosen, gears, torque, position)
            except RuntimeError as failure:
                failed.append(f"{torque:g} N·m, position {position}: {failure}")
                continue
            rows = [row for row in rows if _place(row) != (case, torque, position)] + [fresh]
            write(chosen.out, sorted(rows, key=_place))
            print(", ".join(f"{name} {value}" for name, value in fresh.items()), file=sys.stderr, flush=True)
    if failed:
        raise SystemExit("\n".join(failed))


def _place(row: dict[str, Any]) -> tuple[str, float, int]:
    """Case, torque (N·m) and number of the position of a row."""
    return row["case"], float(row["torque_Nm"]), round(POSITIONS * float(row["position"]))


if __name__ == "__main__":
    main()
