"""Helical gears against CalculiX: loaded transmission error, load over the width, one pair with a tilted axis.

    python -m evidence.peers.calculix.helical [--compare]

The pair is `helical_demo` with 12 mm of width, without modifications (overlap ratio 0.58), and the same teeth with a
helix angle of 30° (0.85). CASES are helix angle, axes (`tilted`: the wheel's axis turned by 1 µm over 1 mm across the
line of centres), torque on the pinion and positions. Both gears are whole and twisted, with quadratic elements in five
layers across the width; fine zones follow the slanting lines of contact, and layers where a line ends at a tip edge
have elements of 0.6 mm. Both codes have rigid bores that are held. The pinion is turned to where gearfmu expects the
torque; from the torque that comes out te is moved to the one asked by gearfmu's tangent stiffness. Table: helical.csv
beside this file, one row a solution with the load share of every layer in both codes. A row of the same mesh at nearly
its torque is not solved again: its error is computed anew. The bodies are reduced into out/calculix first (some
minutes). `--compare` runs nothing. Needs CalculiX's ccx; four to nine minutes a solution.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evidence.peers.calculix.ccx import WORK, deck_path, digest, require_ccx, run_deck
from evidence.peers.calculix.deck import Placed, Problem, layer_forces, pinion_load, write_deck
from evidence.peers.calculix.section import Fineness
from evidence.peers.calculix.solid import twisted
from evidence.tables import read_rows, write_rows
from gearfmu.body import Body, load_bodies, load_body
from gearfmu.body.store import save_body
from gearfmu.body.toothed import flank_of, symmetric_mass
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.geometry.mesh import contact_modulus, half_width
from gearfmu.reduction.cyclic.flank import tooth_flank
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.stage import assemble
from gearfmu.stage.run.te import TANGENT, place_of, statics_of
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import GearSpec, MeshSpec
from gearfmu.stagefile.tables.connections import Misalignment

WIDTH, LAYERS, SLICES = 12e-3, 5, 10
POSITIONS = 4
TILT = 1e-3  # rad, of the wheel's axis across the line of centres
MARGIN = 0.4e-3  # m beyond the ends of the path where tooth pairs are still in the deck
PATCH = 1.5  # half length of the fine zones in Hertz half-widths
MESH = MeshSpec(flank=14, thickness=4, root=5, rim=3, width=6)
ROLLS, FUNCTIONS, MODES = 20, 6, 12
NUDGES = (1.0, 1.01, 0.99, 1.02, 0.98, 1.005, 0.995, 1.015, 0.985)  # of te, in turn, until no teeth stick
NEAR = 0.05  # parts of the torque asked, up to which a solution's torque is carried to it
HERE = Path(__file__).parent
WHOLE = (1,) * LAYERS
FINE = {  # elements of each layer by helix angle (degrees) and position: fine where lines of contact end
    (20, 0): (1, 2, 4, 4, 1), (20, 1): WHOLE, (20, 2): (1, 2, 4, 4, 1), (20, 3): (4, 3, 1, 2, 4),
    (30, 0): (1, 2, 4, 4, 1), (30, 1): (2, 4, 2, 4, 2), (30, 2): (2, 4, 4, 2, 1), (30, 3): (4, 2, 1, 2, 4),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """helix: degrees. axes: "parallel" or "tilted". torque: N·m on the pinion. position: of POSITIONS in a pitch."""

    helix: int
    axes: str
    torque: float
    position: int

    @property
    def name(self) -> str:
        return f"{self.helix}_{self.axes}_{self.torque:g}_{self.position}"

    @property
    def divisions(self) -> tuple[int, ...]:
        """Elements of each layer."""
        return FINE[self.helix, self.position]


SOLVED = {
    (20, "parallel", 40.0): (0, 1, 2, 3),
    (20, "parallel", 110.0): (0, 1, 2, 3),
    (20, "tilted", 40.0): (1,),
    (20, "tilted", 110.0): (0, 1, 2, 3),
    (30, "parallel", 110.0): (0, 1, 2, 3),
    (30, "tilted", 110.0): (0, 1, 2, 3),
}
CASES = {case.name: case for load, places in SOLVED.items() for case in (Case(*load, place) for place in places)}


@dataclass(frozen=True)
class Ours:
    """What the kernel says: te (m), tangent dF/dte (N/m) with F in the transverse line of action, share (LAYERS,)."""

    te: float
    stiffness: float
    share: np.ndarray


def stage(helix: int = 20, axes: str = "parallel") -> Stage:
    """The pair of this comparison. Another helix angle keeps the normal section: teeth, depths and profile shifts."""
    demo = load_stage("helical_demo")
    error = Misalignment(in_plane=0.0, out_of_plane=TILT * WIDTH, span=WIDTH) if axes == "tilted" else None
    beta = math.radians(helix)
    wider = demo.written.pair.normal_module * (
        1 / math.cos(beta) - 1 / math.cos(demo.written.pair.helix_angle)
    )  # a tooth's diameter
    gears = []
    for gear in demo.written.gears:
        body = gear.body.model_copy(update={"mesh": MESH, "roll_points": ROLLS, "width_functions": FUNCTIONS})
        changes = {"face_width": WIDTH, "tip_relief": None, "lead": None, "body": body, "bore_coupling": "rigid"}
        gears.append(gear.model_copy(update=changes | {"tip_diameter": gear.tip_diameter + gear.teeth * wider}))
    distance = demo.written.pair.center_distance + sum(gear.teeth for gear in gears) * wider / 2
    pair = demo.written.pair.model_copy(
        update={"misalignment": error, "helix_angle": beta, "center_distance": distance}
    )
    return rewritten(demo, gears=tuple(gears), pair=pair)


def bodies(work: Path, helix: int = 20) -> list[Body]:
    """The reduced gears with rigid bores, kept in the work folder."""
    files = [work / f"helical_{helix}_{name}.h5" for name in ("pinion", "wheel")]
    if not all(file.exists() for file in files):
        work.mkdir(parents=True, exist_ok=True)
        spec, stored = stage(helix).written, load_bodies(load_stage("helical_demo"))
        for *entry, file in zip(stored, spec.gears, spec.geometry.gears, files, strict=True):
            save_body(_body(*entry), file)
    return [load_body(file) for file in files]


def _body(stored: Body, gear: GearSpec, shape: GearGeometry) -> Body:
    """The body of a gear with static tables and a dozen modes of its own, without picture and gyroscopic terms."""
    flank, points = tooth_flank(shape, gear)
    sector = gear_sector(shape, gear.face_width, gear.body.mesh)
    body = SectorBody(sector, gear.material, flank, points, gear.rigid_bore)
    statics, modes = static_tables(body, []), elastic_modes(body, MODES)
    return replace(
        stored,
        mass=symmetric_mass(body.inertia),
        frequency=modes.frequency,
        damping_ratio=np.full(len(modes.frequency), gear.modal_damping),
        rows=modes.bore_rows,
        static=statics.static_bb,
        flank=replace(flank_of(gear.teeth, (flank, points), modes, statics), tangent=None),
        picture=None,
        spin=None,
    )


def ours(case: Case, gears: list[Body]) -> Ours:
    """The kernel's answer with bores held."""
    spec, torque = stage(case.helix, case.axes), case.torque
    model = assemble(spec, gears)
    kernel = statics_of(model, **{"effect.bearings": 0.0, "slices": float(SLICES)})
    at = -case.position / POSITIONS * place_of(model, None).pitch
    state = kernel.transmission(at, torque)
    ends = [kernel.transmission(at, torque * (1 + sign * TANGENT)).te for sign in (-1, 1)]
    slices = np.sum(list(state.forces.values()), axis=0).reshape(LAYERS, -1).sum(axis=1)
    lever = spec.written.geometry.gears[0].r_b
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


def problem_at(case: Case, te: float) -> Problem:
    """The contact problem of a case at the transmission error te (m)."""
    spec = stage(case.helix, case.axes)
    pair = spec.written.geometry
    turn = 2 * math.pi / pair.gears[0].z * case.position / POSITIONS
    contacts = touching(pair, turn)
    steel = spec.written.gears[0].material
    e_star = contact_modulus((steel.youngs_modulus,) * 2, (steel.poisson_ratio,) * 2)
    radius = pair.largest_relative_radius()
    wide = half_width(case.torque / pair.gears[0].r_b / WIDTH, radius, e_star)
    fine, levels = Fineness(patch=PATCH * wide), levels_of(case.divisions)
    solids = [
        twisted(gear, {teeth[g]: rolls[g] for teeth, rolls in contacts.items()}, levels, fine)
        for g, gear in enumerate(pair.gears)
    ]
    phase = pair.wheel_phase - turn * pair.gears[0].r_b / pair.gears[1].r_b
    error = spec.written.pair.misalignment
    tilt = (0.0, 0.0) if error is None else (-error.out_of_plane / error.span, error.in_plane / error.span)
    pinion = Placed("P", solids[0], np.zeros(2), turn, te / pair.gears[0].r_b)
    wheel = Placed("W", solids[1], np.array([pair.a, 0.0]), phase, tilt=tilt)
    return Problem((pinion, wheel), list(contacts))


def row(case: Case, gears: list[Body], known: dict[str, Any] | None) -> dict[str, Any]:
    """The table's row of a case, solved unless `known` is of the same mesh and near the torque; te is moved by up to
    2 % where ccx does not settle. RuntimeError when ccx gives up."""
    mine, r_b = ours(case, gears), stage(case.helix, case.axes).written.geometry.gears[0].r_b
    deck = deck_path(f"helical_{case.name}")
    write_deck(problem_at(case, 0.0), deck)
    mesh = digest(deck)
    theirs = known if known and known["mesh_sha256"] == mesh and _near(known) else solution(case, mine.te, deck)
    te, torque = 1e-6 * float(theirs["solved_te_um"]), float(theirs["solved_torque_Nm"])
    found = {
        "helix_deg": case.helix,
        "axes": case.axes,
        "torque_Nm": f"{case.torque:g}",
        "position": f"{case.position / POSITIONS:.6f}",
        "te_um": f"{1e6 * (te + (case.torque - torque) / r_b / mine.stiffness):.4f}",
        "gearfmu_te_um": f"{1e6 * mine.te:.4f}",
    }
    found |= {f"gearfmu_share_{k + 1}": f"{value:.5f}" for k, value in enumerate(mine.share)}
    return found | {name: value for name, value in theirs.items() if name not in found} | {"mesh_sha256": mesh}


def _near(row: dict[str, Any]) -> bool:
    return abs(float(row["solved_torque_Nm"]) / float(row["torque_Nm"]) - 1) < NEAR


def solution(case: Case, te: float, deck: Path) -> dict[str, Any]:
    """What ccx says at te (m) or, where it does not settle, near it."""

    for nudge in NUDGES:
        problem = problem_at(case, nudge * te)
        write_deck(problem, deck)
        try:
            seconds = run_deck(deck)
            break
        except RuntimeError:
            if nudge == NUDGES[-1]:
                raise
    load, layers = pinion_load(problem, deck.with_suffix(".dat")), layer_forces(problem, deck.with_suffix(".dat"))
    share = np.add.reduceat(layers.sum(axis=0), np.cumsum((0, *case.divisions[:-1]))) / layers.sum()
    return {f"share_{k + 1}": f"{value:.5f}" for k, value in enumerate(share)} | {
        "solved_te_um": f"{1e6 * nudge * te:.4f}",
        "solved_torque_Nm": f"{abs(load[5]):.3f}",
        "axial_N": f"{load[2]:.2f}",
        "pairs": len(problem.pairs),
        "nodes": sum(len(gear.solid.nodes) for gear in problem.gears),
        "seconds": f"{seconds:.0f}",
    }


def case_of(row: dict[str, Any]) -> Case:
    """The case of a row."""
    place = round(POSITIONS * float(row["position"]))
    return Case(int(row["helix_deg"]), row["axes"], float(row["torque_Nm"]), place)


def shares(row: dict[str, Any], who: str = "") -> np.ndarray:
    """Load of each layer (LAYERS,), parts of the whole. who: "" CalculiX, "gearfmu_" ours."""
    return np.array([float(row[f"{who}share_{k + 1}"]) for k in range(LAYERS)])


def compare(rows: list[dict[str, Any]]) -> None:
    """Print te (µm) of both codes, the largest difference of a layer's share, of the largest share; means and peak to
    peak where all positions are there."""
    print("helix_deg,axes,torque_Nm,position,calculix_um,gearfmu_um,difference_%,largest difference of a share_%")
    loads: dict[tuple[int, str, float], list[tuple[float, float]]] = {}
    for line in rows:
        case, theirs = case_of(line), shares(line)
        off = np.abs(shares(line, "gearfmu_") - theirs).max() / theirs.max()
        a, b = float(line["te_um"]), float(line["gearfmu_te_um"])
        loads.setdefault((case.helix, case.axes, case.torque), []).append((a, b))
        print(f"{case.name.replace('_', ',')},{a:.3f},{b:.3f},{100 * (b / a - 1):+.2f},{100 * off:.1f}")
    for (helix, axes, torque), pairs in loads.items():
        if len(pairs) == POSITIONS:
            (a, b), (p, q) = np.mean(pairs, axis=0), np.ptp(pairs, axis=0)
            print(f"# {helix}°, {axes}, {torque:g} N·m: mean {a:.3f} and {b:.3f} µm, {100 * (b / a - 1):+.2f} %;"
                  f" peak to peak {p:.3f} and {q:.3f} µm, {100 * (q / p - 1):+.1f} %")  # fmt: skip


def main() -> None:
    table = HERE / "helical.csv"
    rows, failed = {case_of(row).name: row for row in read_rows(table)}, []
    if sys.argv[1:] == ["--compare"]:
        return compare(list(rows.values()))
    require_ccx()
    for name, case in CASES.items():
        try:
            rows[name] = row(case, bodies(WORK, case.helix), rows.get(name))
        except RuntimeError as failure:
            failed.append(f"{name}: {failure}")
            continue
        done = [name for name in CASES if name in rows]
        write_rows(table, [rows[k] for k in sorted(done, key=lambda k: (CASES[k].torque, CASES[k].position))])
        print(", ".join(f"{key} {value}" for key, value in rows[name].items()), file=sys.stderr, flush=True)
    if failed:
        raise SystemExit("\n".join(failed))


if __name__ == "__main__":
    main()
