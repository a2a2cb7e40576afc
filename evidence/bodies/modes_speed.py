"""What 400 free modes of a gear and of a ring cost by cyclic symmetry: processor seconds and peak memory against size.

    python -m evidence.bodies.modes_speed            # table, modes_speed.csv, modes_speed.png
    python -m evidence.bodies.modes_speed draw       # the picture again, from the table

Every case runs in a process of its own (peak memory is that of the process: Python with its packages takes 0.09 GB of
it), BLAS on one thread. Time: mesh, matrices and factorisation of one sector ("set up"), then all modes with their rows
at flanks and bore or rim. What is promised: 100 000 degrees of freedom in at most 10 s and 1 GB, aim 2 s.
"""

from __future__ import annotations

import csv
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

HERE = Path(__file__).resolve().parent
MODES = 400
CASES = [("gear", s) for s in (0.34, 0.45, 0.6, 0.8, 1.0)] + [("ring", s) for s in (0.25, 0.4, 0.55, 0.75, 1.0)]
COLUMNS = ("body", "dof", "sectors", "dof_sector", "set_up_s", "modes_s", "total_s", "peak_memory_GB", "highest_kHz")


def main() -> None:
    """All cases, table, CSV and chart."""
    rows = []
    print(f"{MODES} free modes; {_machine()}; load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print("".join(f"{name:>16}" for name in COLUMNS))
    for body, scale in CASES:
        made = subprocess.run(
            [sys.executable, __file__, body, str(scale)], capture_output=True, text=True, check=True, env=os.environ
        )
        rows.append(json.loads(made.stdout))
        print("".join(f"{rows[-1][name]:>16}" for name in COLUMNS), flush=True)
    with open(HERE / "modes_speed.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, HERE / "modes_speed.png")


def measure(body: str, scale: float) -> dict[str, float | str | int]:
    """One case: the sun or the ring of planetary54 on a mesh with all counts multiplied by `scale`."""
    import resource

    from gearfmu.body.parts import tooth_flank
    from gearfmu.femesh import sector_mesh
    from gearfmu.geometry import GearGeometry
    from gearfmu.geometry.internal import InternalGearGeometry
    from gearfmu.reduction.cyclic.modal import elastic_modes
    from gearfmu.reduction.cyclic.sector import SectorBody
    from gearfmu.spec.stage import load_stage

    spec = load_stage("planetary54")
    gear, kind = (spec.ring, InternalGearGeometry) if body == "ring" else (spec.sun, GearGeometry)
    geometry, started = kind.of(gear, spec.set), time.process_time()
    mesh = sector_mesh(geometry, gear.face_width, gear.body.mesh.model_copy(update={"scale": scale}))
    full = SectorBody(mesh, gear.material, *tooth_flank(geometry, gear, body == "ring"))
    set_up = time.process_time() - started
    modes = elastic_modes(full, MODES)
    total = time.process_time() - started
    sector = 3 * (len(mesh.nodes) - len(mesh.cut_plus))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    highest = modes.frequency[-1] / 1e3
    figures = (body, sector * mesh.teeth, mesh.teeth, sector, set_up, total - set_up, total, peak, highest)
    return {n: round(v, 3) if isinstance(v, float) else v for n, v in zip(COLUMNS, figures, strict=True)}


def draw(rows: list[dict], path: Path) -> None:
    """Time and memory over the degrees of freedom."""
    from matplotlib.figure import Figure

    from gearfmu.report.style import styled

    panels = {
        "total_s": ("CPU time, s", (0.5, 1, 2, 5, 10, 20, 50), {10: "promised", 2: "aim"}),
        "peak_memory_GB": ("peak memory, GB", (0.1, 0.2, 0.5, 1), {1: "promised"}),
    }
    with styled():
        figure = Figure(figsize=(9, 3.8), layout="constrained")
        for axis, (column, (label, ticks, marks)) in zip(figure.subplots(1, 2), panels.items(), strict=True):
            for body in ("gear", "ring"):
                own = [row for row in rows if row["body"] == body]
                dof, values = [int(r["dof"]) for r in own], [float(r[column]) for r in own]
                axis.loglog(dof, values, "o-", label=f"{body}, {own[0]['sectors']} sectors")
            for value, text in marks.items():
                axis.plot([1e5], [value], marker="_", markersize=22, color="0.35")
                axis.annotate(text, (1e5, value), (-14, 3), textcoords="offset points", fontsize=8, ha="right")
            axis.set_xticks([2e4, 5e4, 1e5, 2e5, 5e5, 1e6], ["20k", "50k", "100k", "200k", "500k", "1M"])
            axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.minorticks_off()
            axis.set_xlabel("degrees of freedom of the whole body")
            axis.set_ylabel(label)
        axis.legend(loc="lower right")
        figure.suptitle(f"{MODES} free modes by cyclic symmetry, one core of a busy machine", x=0.01, ha="left")
        figure.savefig(path, dpi=150)


def _machine() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []:
        if line.startswith("model name"):
            return line.split(":")[1].strip()
    return platform.processor() or platform.machine()


if __name__ == "__main__":
    if sys.argv[1:] == ["draw"]:
        with open(HERE / "modes_speed.csv", newline="", encoding="utf-8") as table:
            draw(list(csv.DictReader(table)), HERE / "modes_speed.png")
    elif len(sys.argv) == 3:
        print(json.dumps(measure(sys.argv[1], float(sys.argv[2]))))
    else:
        main()
