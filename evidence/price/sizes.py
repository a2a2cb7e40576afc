"""Sizes of models and FMUs, and what export and the start of an FMU cost, of shipped stages.

    python -m evidence.price.sizes

Every measurement runs in a process of its own. Times are processor time, s, memory is MB: the peak of the exporting
process; what instance, initialisation and first step add to the importer (FMPy). Level: that of the FMU's start.
Prints a table and writes evidence/price/sizes.csv; tests/fmu/test_fmu_sizes.py fails where an FMU outgrows its row.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

import gearfmu
from evidence.tables import told, write_rows
from gearfmu.fmu import export

STAGES = ("fzg_c", "helical_demo", "two_stage", "planetary54", "helical_set")
STEP = 1e-4  # s


def resident_mb() -> float:
    """Resident memory of this process now, MB."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize() / 1e6


def exported(stage: str, path: str) -> dict[str, float]:
    """Export of a shipped stage, assembly included; imports are not counted."""
    start = time.process_time()
    model = gearfmu.assemble(stage)
    export(model, Path(path))
    return {
        "blob_mb": len(model.blob) / 1e6,
        "fmu_mb": Path(path).stat().st_size / 1e6,
        "export_s": time.process_time() - start,
        "export_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


def started(path: str, folder: str) -> dict[str, float]:
    """Instance, initialisation and first step in FMPy, each with what it adds."""
    unpacked = extract(path, folder)
    description = read_model_description(unpacked)
    identifier = description.coSimulation.modelIdentifier
    slave = FMU2Slave(guid=description.guid, unzipDirectory=unpacked, modelIdentifier=identifier, instanceName="a")
    before, marks = resident_mb(), [time.process_time()]
    slave.instantiate()
    marks.append(time.process_time())
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    marks.append(time.process_time())
    at_rest = resident_mb() - before
    slave.doStep(0.0, STEP)
    marks.append(time.process_time())
    times = [b - a for a, b in zip(marks, marks[1:], strict=False)]
    return dict(zip(("instantiate_s", "initialise_s", "first_step_s"), times, strict=True)) | {
        "initialised_mb": at_rest,
        "stepped_mb": resident_mb() - before,
    }


def apart(work: Callable[..., dict[str, float]], *arguments: str) -> dict[str, float]:
    """The result of `work` in a fresh process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(work, arguments)


def measure(stage: str, work: Path) -> dict[str, object]:
    """One row of the table."""
    fmu = str(work / f"{stage}.fmu")
    row = apart(exported, stage, fmu) | apart(started, fmu, str(work / stage))
    return {"stage": stage} | {name: round(value, 3) for name, value in row.items()}


def main() -> None:
    """Measure, print, write the table."""
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # waiting threads are no work
    with tempfile.TemporaryDirectory() as work:
        rows = told(measure(stage, Path(work)) for stage in STAGES)
    write_rows(Path(__file__).with_suffix(".csv"), rows, digits=6)


if __name__ == "__main__":
    main()
