"""Where the levels of planetary54 should be cut: errors and price over the cut frequency, into evidence/set_cuts.csv.

    python evidence/set_cuts.py

Scene planetary_paper, 3 to 10 ms, five slices, against level full at 0.4 µs: a row a cut and step with the number of
dynamic oscillators, errors of transmission error and mesh force (share of the ripple), and instructions of a step by
callgrind. Needs valgrind and cc; ten minutes.
"""

from __future__ import annotations

import csv
import tempfile
from pathlib import Path

from set_price import instructions

from gearfmu.body import load_bodies
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.spec.tables.ports import LevelSpec
from gearfmu.stage import assemble
from gearfmu.study.bench import Point, measure
from gearfmu.study.norm import errors

ROOT = Path(__file__).resolve().parents[1]
CUTS, STEPS = (40e3, 60e3, 80e3, 100e3, 120e3, 150e3), (10e-6, 5e-6)  # Hz, s
REFERENCE = Point("full", "dg4", 0.4e-6, 5)


def main() -> None:
    """Measure, print, write the table."""
    scene = load_scene("planetary_paper").model_copy(update={"settle": 3e-3, "duration": 10e-3})
    spec = load_stage("planetary54")
    bodies, wanted = load_bodies(spec), None
    rows = [["cut_kHz", "h_s", "n_dyn", "te_error", "force_error", "instructions_per_step"]]
    with tempfile.TemporaryDirectory() as folder:
        for cut in CUTS:
            model = assemble(spec.model_copy(update={"levels": LevelSpec(fast_cut=cut, standard_cut=cut)}), bodies)
            wanted = wanted or measure(scene, model, REFERENCE).signals
            for h in STEPS:
                run = measure(scene, model, Point("fast", "dg4", h, 5))
                found, count = errors(run.signals, wanted), instructions(model, 1.0, h, Path(folder))
                row = [cut / 1e3, h, run.n_dyn, found.te, found.force, round(count)]
                rows.append([f"{value:.4g}" if isinstance(value, float) else str(value) for value in row])
                print(",".join(rows[-1]), flush=True)
    with (ROOT / "evidence" / "set_cuts.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
