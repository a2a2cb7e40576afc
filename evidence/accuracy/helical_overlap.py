"""Peak-to-peak transmission error of a helical pair over the overlap ratio: a chart of docs/validation.md.

    python -m evidence.accuracy.helical_overlap [--draw] [--out evidence/accuracy/helical_overlap.csv]

The transverse section is that of `helical_demo` for every helix angle (z 23/37, m_t 2.394 mm, same centre distance, tip
circles and roots): with the transverse module, x m_n, depths and fillets kept, only the overlap changes. 28 mm of
width, no profile or lead modification, bores held. Reduced statics alone, on meshes of half the shipped counts; two
minutes a value. Prints the mean mesh stiffness beside c_gamma_alpha of ISO 6336-1 (a fact, no test: its formulas are
fits for standard racks and solid discs).
--draw: only the chart, from the table.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context

from gearfmu.body import Body, load_bodies
from gearfmu.body.toothed import flank_of, symmetric_mass
from gearfmu.femesh.sector import gear_sector
from gearfmu.files import written_whole
from gearfmu.geometry import GearGeometry
from gearfmu.reduction.cyclic.flank import tooth_flank
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.report.style import panels, styled
from gearfmu.stage import assemble, loaded_te
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import GearSpec, MeshSpec

OVERLAPS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
WIDTH = 28e-3  # m
LINE_LOADS = (50e3, 200e3)  # N/m of width in the transverse section, torque over base radius
POSITIONS, SLICES = 32, 10
MODES, ROLLS, FUNCTIONS = 12, 14, 6
MESH = MeshSpec(flank=8, thickness=3, root=3, rim=3, width=8)
HERE = Path(__file__).parent
TABLE, CHART = HERE / "helical_overlap.csv", HERE.parents[1] / "docs" / "pictures" / "helical_overlap.png"


def stage_at(overlap: float) -> Stage:
    """`helical_demo` with another helix angle and the same transverse section."""
    demo = load_stage("helical_demo")
    m_t = demo.written.pair.normal_module / math.cos(demo.written.pair.helix_angle)
    alpha_t = math.atan(math.tan(demo.written.pair.pressure_angle) / math.cos(demo.written.pair.helix_angle))
    beta = math.atan(overlap * math.pi * m_t / WIDTH)
    pair = demo.written.pair.model_copy(
        update={
            "helix_angle": beta,
            "normal_module": m_t * math.cos(beta),
            "pressure_angle": math.atan(math.tan(alpha_t) * math.cos(beta)),
        }
    )
    scale = demo.written.pair.normal_module / pair.normal_module
    return rewritten(demo, pair=pair, gears=tuple(_gear(gear, scale) for gear in demo.written.gears))


def _gear(gear: GearSpec, scale: float) -> GearSpec:
    """A gear whose factors of the module grow by `scale`, without modifications, with the coarse mesh."""
    rack = gear.rack.model_copy(update={name: scale * value for name, value in gear.rack.model_dump().items()})
    body = gear.body.model_copy(update={"mesh": MESH, "roll_points": ROLLS, "width_functions": FUNCTIONS})
    return gear.model_copy(
        update={
            "profile_shift": scale * gear.profile_shift,
            "rack": rack,
            "body": body,
            "face_width": WIDTH,
            "tip_relief": None,
            "lead": None,
        }
    )


def bodies_of(spec: Stage) -> list[Body]:
    """Bodies of both gears with static tables and a dozen modes of their own, without pictures and gyroscopic terms."""
    stored = load_bodies(load_stage("helical_demo"))
    return [_body(*entry) for entry in zip(stored, spec.written.gears, spec.written.geometry.gears, strict=True)]


def _body(stored: Body, gear: GearSpec, shape: GearGeometry) -> Body:
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


def iso_stiffness(spec: Stage) -> float:
    """c_gamma_alpha (N/m²) of ISO 6336-1 method B for steel discs: c' = c'_th C_M C_R C_B cos β with C_M = 0.8 and
    C_R = 1, c_gamma_alpha = c' (0.75 ε_α + 0.25)."""
    pair, beta = spec.written.geometry, spec.written.pair.helix_angle
    z = [gear.teeth / math.cos(beta) ** 3 for gear in spec.written.gears]
    x = [gear.profile_shift for gear in spec.written.gears]
    q = 0.04723 + 0.15551 / z[0] + 0.25791 / z[1] - 0.00635 * x[0] - 0.11654 * x[0] / z[0]
    q += -0.00193 * x[1] - 0.24188 * x[1] / z[1] + 0.00529 * x[0] ** 2 + 0.00182 * x[1] ** 2
    dedendum = sum(gear.rack.dedendum for gear in spec.written.gears) / 2
    rack = (1 + 0.5 * (1.2 - dedendum)) * (1 - 0.02 * math.degrees(math.radians(20) - spec.written.pair.pressure_angle))
    single = 1e9 / q * 0.8 * rack * math.cos(beta)
    return single * (0.75 * pair.contact_ratio + 0.25)


def row(overlap: float) -> dict[str, Any]:
    """The table's row of an overlap ratio."""
    spec = stage_at(overlap)
    pair, model = spec.written.geometry, assemble(spec, bodies_of(spec))
    torques = [load * WIDTH * pair.gears[0].r_b for load in LINE_LOADS]
    result = loaded_te(model, torques, POSITIONS, slices=SLICES, **{"effect.bearings": 0.0})
    found: dict[str, Any] = {
        "overlap_ratio": f"{overlap:g}",
        "helix_angle_deg": f"{math.degrees(spec.written.pair.helix_angle):.3f}",
        "contact_ratio": f"{pair.contact_ratio:.4f}",
    }
    for load, te, stiffness in zip(LINE_LOADS, result.te, result.mesh_stiffness, strict=True):
        name = f"{1e-3 * load:g}_N_per_mm"
        found[f"te_mean_um_{name}"] = f"{1e6 * te.mean():.4f}"
        found[f"te_peak_to_peak_um_{name}"] = f"{1e6 * np.ptp(te):.4f}"
        found[f"stiffness_N_per_mm_um_{name}"] = f"{1e-9 * stiffness.mean() / WIDTH:.3f}"
    return found | {"iso_c_gamma_alpha_N_per_mm_um": f"{1e-9 * iso_stiffness(spec):.3f}"}


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Peak to peak over the overlap ratio, and the mean mesh stiffness beside ISO's."""
    x = [float(r["overlap_ratio"]) for r in rows]
    with styled(), rc_context({"svg.hashsalt": "helical_overlap"}):
        figure, axes = panels((2.6, 2.0))
        for load in LINE_LOADS:
            name = f"{1e-3 * load:g}_N_per_mm"
            label = f"{1e-3 * load:g} N/mm"
            axes[0].plot(x, [float(r[f"te_peak_to_peak_um_{name}"]) for r in rows], marker="o", ms=3, label=label)
            axes[1].plot(x, [float(r[f"stiffness_N_per_mm_um_{name}"]) for r in rows], marker="o", ms=3, label=label)
        iso = [float(r["iso_c_gamma_alpha_N_per_mm_um"]) for r in rows]
        axes[1].plot(x, iso, "--", label="ISO 6336-1 c_γα")
        axes[0].set_ylabel("transmission error,\npeak to peak, µm")
        axes[1].set_ylabel("mean mesh stiffness,\nN/(mm µm)")
        axes[0].set_ylim(bottom=0)
        axes[1].set_ylim(bottom=0)
        axes[1].set_xlabel("overlap ratio ε_β")
        axes[0].legend(loc="upper right")
        axes[1].legend(loc="lower left")
        with written_whole(path) as temporary:
            figure.savefig(temporary, format="png", dpi=120, metadata={"Software": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("overlaps", nargs="*", type=float, help="only these; rows of the others in the table stay")
    parser.add_argument("--draw", action="store_true")
    parser.add_argument("--out", type=Path, default=TABLE)
    chosen = parser.parse_args()
    rows: list[dict[str, Any]] = []
    if chosen.out.exists() and (chosen.draw or chosen.overlaps):
        with open(chosen.out, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    for overlap in () if chosen.draw else chosen.overlaps or OVERLAPS:
        fresh = row(overlap)
        rows = sorted([r for r in rows if r["overlap_ratio"] != fresh["overlap_ratio"]] + [fresh],
                      key=lambda r: float(r["overlap_ratio"]))  # fmt: skip
        write(chosen.out, rows)
        print(", ".join(f"{name} {value}" for name, value in fresh.items()), file=sys.stderr, flush=True)
    draw(rows, CHART if chosen.out == TABLE else chosen.out.with_suffix(".png"))


if __name__ == "__main__":
    main()
