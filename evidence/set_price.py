"""Instructions of an internal step of the planetary set planetary54, by callgrind, into evidence/set_price.csv.

    python evidence/set_price.py

600 N·m on the carrier at 85 rad/s, five slices, constant torques, one mesh period after 2 ms. A row a level: step, s,
instructions a step. Needs valgrind and cc; a minute and a half, most of it the model's preparation under valgrind.
"""

from __future__ import annotations

import csv
import re
import subprocess
import tempfile
from pathlib import Path

from gearfmu.body import load_bodies
from gearfmu.kernel.build import library_path
from gearfmu.spec.stage import load_stage
from gearfmu.stage import assemble
from gearfmu.stage.build.model import StageModel

ROOT = Path(__file__).resolve().parents[1]
CASES = {"fast": (1.0, 1e-5), "standard": (2.0, 5e-6)}  # level, step s
START = {"carrier.w_start": 85.0, "sun.w_start": 340.0, "slices": 5.0}
TORQUES = {"carrier.tau": 600.0, "sun.tau": -150.0}  # N·m
WARM, STEPS, H = 20, 14, 1e-4  # communication steps; s


def instructions(model: StageModel, level: float, h: float, folder: Path) -> float:
    """Instructions of an internal step."""
    host, blob, known = folder / "host", folder / "blob", model.kernel().variables
    program, include = ROOT / "evidence" / "effects_host.c", ROOT / "gearfmu" / "kernel" / "src"
    subprocess.run(["cc", "-std=gnu99", "-O2", f"-I{include}", "-o", host, program, "-ldl"], check=True)
    blob.write_bytes(model.blob)
    given = START | {"level": level, "h": h}
    words = [f"p{known[name].reference}={value!r}+0" for name, value in given.items()]
    words += [f"i{known[name].reference}={value!r}+0" for name, value in TORQUES.items()]
    command = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--toggle-collect=measured",
               "--callgrind-out-file=/dev/null", host, library_path(), blob, WARM, STEPS, H, *words]  # fmt: skip
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    collected = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
    assert collected is not None, "callgrind says what it collected"
    return int(collected[1]) / float(done.stdout.split()[0])


def main() -> None:
    """Measure, print, write the table."""
    spec = load_stage("planetary54")
    model = assemble(spec, load_bodies(spec))
    rows = [["level", "h_s", "instructions_per_step"]]
    with tempfile.TemporaryDirectory() as folder:
        for name, (level, h) in CASES.items():
            rows.append([name, f"{h:g}", f"{instructions(model, level, h, Path(folder)):.0f}"])
            print(",".join(rows[-1]), flush=True)
    with (ROOT / "evidence" / "set_price.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    main()
