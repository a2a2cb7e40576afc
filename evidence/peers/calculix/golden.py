"""Collect the tables of this folder into tests/reference/calculix_fzg_c.json, which the tests read.

python -m evidence.peers.calculix.golden
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

from evidence.peers.calculix.ccx import require_ccx
from evidence.peers.calculix.positions import POSITIONS, read
from gearfmu.files import written_whole

HERE = Path(__file__).parent
GOLDEN = HERE.parents[2] / "tests" / "reference" / "calculix_fzg_c.json"


def collected(version: str) -> dict[str, Any]:
    """The goldens: secants at the pitch point, te by torque over the positions (µm), frequencies of free bodies."""
    stiffness = {row["case"]: float(row["secant_N_per_mm_um"]) for row in read(HERE / "pitch_point.csv")}
    frequencies: dict[str, list[float]] = {}
    for row in read(HERE / "frequencies.csv"):
        frequencies.setdefault(row["case"], []).append(float(row["frequency_Hz"]))
    return {
        "made_by": "python -m evidence.peers.calculix.pitch_point; python -m evidence.peers.calculix.positions; "
        "python -m evidence.peers.calculix.positions --bores clamped; python -m evidence.peers.calculix.frequencies; "
        "python -m evidence.peers.calculix.golden",
        "solver": version,
        "stage": "fzg_c",
        "pitch_point_secant_N_per_mm_um": stiffness,
        "line_load_N_per_mm": 300,
        "positions_per_pitch": POSITIONS,
        "te_um_by_torque_Nm_and_position": transmission_errors("positions.csv"),
        "te_um_with_clamped_bores": transmission_errors("positions_clamped.csv"),
        "frequencies_Hz": frequencies,
    }


def transmission_errors(table: str) -> dict[str, dict[int, float]]:
    """te (µm) by torque and number of the position."""
    te: dict[str, dict[int, float]] = {}
    for row in read(HERE / table):
        te.setdefault(row["torque_Nm"], {})[round(POSITIONS * float(row["position"]))] = float(row["te_um"])
    return te


def main() -> None:
    require_ccx()
    words = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
    version = re.search(r"Version\s+(\S+)", words)
    with written_whole(GOLDEN) as temporary:
        text = json.dumps(collected(f"CalculiX {version[1] if version else '?'}"), indent=1)
        Path(temporary).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
