"""Overhead of the FMI 2 face in a C host: set one input, make one step, get one output, against the same through gk_.

    python -m evidence.price.fmu_overhead

The two methods take turns step by step in one process (tests/fmu/host.c) and give the same bits; overhead: the median
of the paired differences. Prints a table and writes evidence/price/fmu_overhead.csv.
Aim (issue 2 and the design): at most 0.2 µs a step.
"""

from __future__ import annotations

import csv
import platform
import subprocess
import tempfile
import zipfile
from pathlib import Path

from fmpy import read_model_description

from gearfmu.body import load_body
from gearfmu.fmu import export
from gearfmu.kernel.build import compile_program
from gearfmu.stage import assemble
from gearfmu.stagefile.reading.files import model_folder
from gearfmu.stagefile.stage import load_stage

ROOT = Path(__file__).resolve().parents[2]
STAGE, STEPS, REPEATS = "fzg_c/stage_relief", 20000, 3


def measure(work: Path) -> list[dict[str, object]]:
    """One row per repetition: nanoseconds a step through the FMU and through the kernel's own functions."""
    spec = load_stage(STAGE)
    model = assemble(spec, [load_body(model_folder(spec) / f"{gear.name}.h5") for gear in spec.gears])
    with zipfile.ZipFile(export(model, work / "stage.fmu")) as archive:
        archive.extractall(work)
    description = read_model_description(str(work))
    names = {v.name: str(v.valueReference) for v in description.modelVariables}
    host = compile_program(ROOT / "tests" / "fmu" / "host.c", work / "host")
    library = next((work / "binaries").rglob("*.so"))
    command = [
        host,
        library,
        (work / "resources").as_uri(),
        description.guid,
        "bench",
        str(STEPS),
        names["pinion.phi"],
        names["mesh.force"],
    ]
    rows = []
    for _ in range(REPEATS):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        fmi, direct, overhead = map(float, done.stdout.split())
        rows.append(
            {
                "stage": STAGE,
                "machine": platform.processor() or platform.machine(),
                "fmi_ns": fmi,
                "gk_ns": direct,
                "overhead_ns": overhead,
            }
        )
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        measured = measure(Path(folder))
    for row in measured:
        print("{stage}: {fmi_ns} ns through FMI, {gk_ns} ns through gk_, overhead {overhead_ns} ns".format(**row))
    with open(Path(__file__).with_suffix(".csv"), "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, measured[0].keys())
        writer.writeheader()
        writer.writerows(measured)
