"""What leaving out gyroscopic forces costs in accuracy: ripple of a turning stage with and without them.

    python -m evidence.accuracy.gyroscopic

For each stage and speed, at constant speed and torque, level fast: rms of the difference without its mean over the rms
of the alternating part, of transmission error, mesh force and the worst bearing force, in per cent. The bodies are
those on disk: a file without group `spin` knows rigid tilts and shafts alone. Written to
gyroscopic.csv beside this file.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

import gearfmu as gf

RUNS = (("helical_demo", 150.0, 104.7), ("helical_demo", 150.0, 418.9), ("two_stage", 150.0, 150.0))
DURATION, SAMPLE, SETTLE = 0.06, 20e-6, 0.02  # s
TABLE = Path(__file__).with_suffix(".csv")
COLUMNS = ("stage", "torque_Nm", "speed_rad_s", "te_percent", "mesh_force_percent", "bearing_force_percent")


def error(left_out: np.ndarray, whole: np.ndarray) -> float:
    """Per cent of the alternating part; 0 where nothing alternates."""
    ripple = whole.std()
    return 100 * float((left_out - whole).std() / ripple) if ripple > 0 else 0.0


def errors(stage: str, torque: float, speed: float) -> tuple[float, float, float]:
    """Worst transmission error, mesh force and bearing force of a stage."""
    model = gf.assemble(stage)
    whole, left_out = (
        gf.simulate(model, torque, speed, DURATION, SAMPLE, SETTLE, level="fast", **{"effect.gyroscopic": on})
        for on in (True, False)
    )
    settled = whole.time >= SETTLE
    endings = (".te",), (".force_mean",), (".fx_mean", ".fy_mean")
    of = {kind: [name for name in whole.channels if name.endswith(kind)] for kind in endings}
    found = (max(error(left_out[name][settled], whole[name][settled]) for name in of[kind]) for kind in endings)
    te, mesh, bearing = found
    return te, mesh, bearing


def main() -> None:
    rows = []
    for stage, torque, speed in RUNS:
        rows.append((stage, torque, speed, *(f"{value:.2g}" for value in errors(stage, torque, speed))))
        print(
            f"{stage:>14} {torque:5.0f} N·m {speed:6.1f} rad/s: "
            f"te, mesh force, bearing force {', '.join(rows[-1][3:])} %"
        )
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])


if __name__ == "__main__":
    main()
