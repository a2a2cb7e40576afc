"""Convergence of the loaded transmission error in the finite-element mesh and in the slices: table on the terminal
and CSV.

    python evidence/body_convergence.py [STAGE] [--torque 302] [--out body_convergence.csv]

Meshes: the stage's own, half and three quarters of its counts, one direction refined at a time, all refined. Bodies
carry a few modes only: the quasi-static transmission error sees all flexibility as static. Wheel held, axes rigid,
mean over one pitch.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.body import ReducedBody, reduce_body
from gearfmu.files import written_whole
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.spec.tables.gear import MeshSpec
from gearfmu.stage import assemble, loaded_te

COUNTS = ("flank", "thickness", "root", "rim", "width")
SLICES = (1, 2, 3, 5, 7, 10)
MODES = 8


def meshes(own: MeshSpec) -> Iterator[tuple[str, MeshSpec]]:
    """The meshes to compare, the finest last."""
    for share in (0.5, 0.75, 1.0):
        yield f"all × {share:g}", own.model_copy(update={"scale": own.scale * share})
    for name in COUNTS:
        yield f"{name} × 1.5", own.model_copy(update={name: round(1.5 * getattr(own, name))})
    yield "all × 1.3", own.model_copy(update={"scale": 1.3 * own.scale})


def with_mesh(spec: StageSpec, mesh: MeshSpec) -> StageSpec:
    """The stage with this mesh for both gears and a few modes."""
    gears = [
        g.model_copy(update={"body": g.body.model_copy(update={"mesh": mesh, "modes": MODES})}) for g in spec.gears
    ]
    return spec.model_copy(update={"gears": tuple(gears)})


def row(spec: StageSpec, bodies: list[ReducedBody], torque: float, slices: int) -> dict[str, Any]:
    """Transmission error over a pitch and what the bodies cost."""
    te = 1e6 * loaded_te(assemble(spec, bodies), [torque], 41, rigid_bearings=True, slices=slices).te[0]
    middle = len(bodies[0].roll) // 2
    return {
        "slices": slices,
        "dof_sector": "/".join(str(b.mesh["dof_sector"]) for b in bodies),
        "dof_body": "/".join(str(b.mesh["dof_body"]) for b in bodies),
        "elements_per_strip": "/".join(f"{b.mesh['elements_per_strip']:.2f}" for b in bodies),
        "tooth_compliance_nm_per_N": "/".join(
            f"{1e9 * b.static_ff[0, 0, 0, middle, middle, 0, 0]:.4f}" for b in bodies
        ),
        "te_mean_um": float(te.mean()),
        "te_pp_um": float(np.ptp(te)),
    }


def study(spec: StageSpec, torque: float) -> list[dict[str, Any]]:
    """Rows for all meshes with five slices, then for all slices on the stage's own mesh."""
    rows, own = [], None
    for name, mesh in meshes(spec.gears[0].body.mesh):
        changed, start = with_mesh(spec, mesh), time.process_time()
        bodies = [reduce_body(changed, gear.name) for gear in changed.gears]
        cost = {
            "cpu_s": round(time.process_time() - start, 1),
            "peak_memory_so_far_GB": bodies[-1].provenance["peak_memory_GB"],
        }
        rows.append({"mesh": name, **row(changed, bodies, torque, 5), **cost})
        own = (changed, bodies) if name == "all × 1" else own
        print(rows[-1], file=sys.stderr, flush=True)
    rows += [
        {"mesh": "all × 1", **row(*own, torque, slices), "cpu_s": "", "peak_memory_so_far_GB": ""} for slices in SLICES
    ]
    finest = next(r for r in rows if r["mesh"] == "all × 1.3")
    for r in rows:
        for name in ("te_mean_um", "te_pp_um"):
            r[f"{name}_change_%"] = round(100 * (r[name] / finest[name] - 1), 3)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", nargs="?", default="fzg_c")
    parser.add_argument("--torque", type=float, default=302.0, help="N·m on the pinion")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".csv"))
    chosen = parser.parse_args()
    rows = study(load_stage(chosen.stage), chosen.torque)
    with written_whole(chosen.out) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    for r in rows:
        print(
            "  ".join(
                f"{key} {value:.4f}" if isinstance(value, float) else f"{key} {value}" for key, value in r.items()
            )
        )


if __name__ == "__main__":
    main()
