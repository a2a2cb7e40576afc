"""Reduction methods on the carrier and the ring of planetary54: the paper's Figs. 2 and 5 and what it does not show.

    python -m evidence.reduction.frf_charts [carrier] [carrier_free] [ring] [growth] [cost] [thickness]
                                    (all when none is named)

carrier : n = 120, bore held, 24 inputs (Fig. 2). carrier_free : reduced free, as the kernel takes it.
ring    : n = 400 on six mounts, 54 · 3 inputs (Fig. 5), and Krylov with 1782 vectors for comparison.
growth  : largest error against n and against processor time, carrier on a coarser mesh.
cost    : time and memory against the number of unknowns and of inputs.
thickness : carriers interpolated between plates of 9.6 to 14.4 mm.
Each writes frf_<name>.csv beside this file (ring and carrier also the curves) and charts in docs/pictures, and prints
its table. References are verified by direct complex solutions of the full model at three lines.
"""

from __future__ import annotations

import argparse
import csv
import io
import os
import time
import tracemalloc
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import numpy as np

from evidence.reduction.methods import METHODS
from evidence.reduction.methods.charts import write_cost_chart, write_growth_chart
from evidence.reduction.methods.comparison import Comparison, Contest, Trial, compare, rows_named
from evidence.reduction.methods.interpolation import Sample, interpolate
from gearfmu.errors import BodyError
from gearfmu.files import write_text
from gearfmu.reduction.basis import Size
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.toothed import ring_full_order
from gearfmu.reduction.transfer import Judging, direct, relative_error, transfer
from gearfmu.report.frf import error_curves, write_error_chart
from gearfmu.spec.stage import load_stage

HERE = Path(__file__).parent
PICTURES = HERE.parents[1] / "docs" / "pictures"
FOUR = ("modal", "craig_bampton", "rubin", "krylov")
SIZES = (24, 48, 72, 120, 168)
GROWTH_SCALE = 0.5
MESH_SCALES = (0.35, 0.5, 0.7)  # of the counts of the stage file's mesh
RING_SCALE = 0.2
IN_PLANE = "bolt*.ux,bolt*.uy"
MESHING = "tooth0.ux,tooth0.uy,tooth13.ux,tooth13.uy,tooth27.ux,tooth27.uy,tooth40.ux,tooth40.uy"


def carrier() -> None:
    """Fig. 2."""
    _carrier("carrier", 1.0, "Carrier, n = 120, bore held")


def carrier_free() -> None:
    """The body of Fig. 2 as the kernel takes it, on a coarser mesh."""
    _carrier("carrier_free", GROWTH_SCALE, "Carrier reduced free, n = 120, judged with the bore held")


def _carrier(name: str, scale: float, title: str) -> None:
    started, wall = time.process_time(), time.perf_counter()
    body = carrier_full_order(load_stage("planetary54"), scale)
    body = body if name == "carrier_free" else body.grounded()
    before, load = time.process_time() - started, os.getloadavg()[0]
    found = judged(body, [(method, 120) for method in FOUR], IN_PLANE)
    cost = {"all_cpu_s": before + found.seconds, "all_wall_s": time.perf_counter() - wall, "load_before": load}
    curves(found, f"frf_{name}", title)
    write(HERE / f"frf_{name}.csv", [{**row, **cost} for row in summary(body, with_memory(body, found))])


def ring() -> None:
    """Fig. 5."""
    body = ring_full_order(load_stage("planetary54"), RING_SCALE)
    found = judged(body, [("modal", 400), ("craig_bampton", 400), ("rubin", 400), ("krylov", 1782)], MESHING)
    curves(found, "frf_ring", "Ring on six mounts, 54 · 3 inputs")
    write(HERE / "frf_ring.csv", summary(body, with_memory(body, found)))


def growth() -> None:
    """Error against n and time, without and with the static residual."""
    body = carrier_full_order(load_stage("planetary54"), GROWTH_SCALE).grounded()
    entries = [(method, n) for n in SIZES for method in (*FOUR, "snapshots")]
    found = judged(body, entries, IN_PLANE)
    rows = summary(body, found, verify=False)
    for row in rows:
        del row["memory_MB"]  # not traced
    mended = [{**r, "method": "modal + static residual", "max_error": r["max_with_residual"]} for r in rows]
    shown = rows + [r for r, own in zip(mended, rows, strict=True) if own["method"] == "modal"]
    write_growth_chart(shown, PICTURES / "frf_growth", f"Carrier, {body.size} unknowns, bore held, 24 inputs")
    write(HERE / "frf_growth.csv", rows)


def cost() -> None:
    """Time and memory against unknowns (carriers of finer and finer mesh, n = 120) and against inputs (one to four
    bolts, n = 30 each)."""
    stage = load_stage("planetary54")
    meshes = [carrier_full_order(stage, scale).grounded() for scale in MESH_SCALES]
    by_mesh = [row for body in meshes for row in priced(body, 120)]
    coarse, by_inputs = carrier_full_order(stage, GROWTH_SCALE), []
    for bolts in (1, 2, 3, 4):
        names = {"bore", *(f"bolt{k}" for k in range(bolts))}
        part = replace(coarse, interfaces=tuple(i for i in coarse.interfaces if i.name in names)).grounded()
        by_inputs += priced(part, 30 * bolts)
    write(HERE / "frf_dof.csv", by_mesh)
    write(HERE / "frf_inputs.csv", by_inputs)
    write_cost_chart(by_mesh, by_inputs, PICTURES / "frf_cost", f"Carrier, n = 120; inputs: {coarse.size} unknowns")


def priced(body: FullOrder, size: int) -> list[dict[str, Any]]:
    """Rows of the four methods, alone in the process: what each costs."""
    found = judged(body, [(method, size) for method in FOUR])
    return summary(body, with_memory(body, found), verify=False)


def thickness() -> None:
    """Interpolation between reduced carriers over the thickness of the plate, judged between the samples against the
    carrier reduced at that very thickness."""
    spec, rows = load_stage("planetary54"), []
    nominal = spec.carrier.thickness

    def made(factor: float, method: str, size: int) -> Sample:
        plate = spec.carrier.model_copy(update={"thickness": factor * nominal})
        body = carrier_full_order(spec.model_copy(update={"carrier": plate}), GROWTH_SCALE).grounded()
        return Sample(factor * nominal, body, METHODS[method](body, Size(size)))

    judging = Judging.over(lines=120)
    for method, size in (("krylov", 72), ("modal", 60)):
        own = made(0.93, method, size)
        exact = transfer(oscillators(own.body, own.basis, judging.damping_ratio), judging)
        samples = {factor: made(factor, method, size) for factor in (0.8, 0.9, 1.0, 1.1, 1.2)}
        for factors in ((0.8, 1.2), (0.8, 1.0, 1.2), (0.8, 0.9, 1.0, 1.1, 1.2)):
            plates = " ".join(f"{1e3 * f * nominal:g}" for f in factors)
            case = {"method": method, "n": size, "samples_mm": plates, "at_mm": 1e3 * own.value}
            try:
                between = interpolate([samples[f] for f in factors], judging.damping_ratio)
                error = relative_error(exact, transfer(between.at(own.value), judging))
                rows.append({**case, "max_error": error.max(), "median_error": np.median(error)})
            except BodyError:
                rows.append({**case, "max_error": "refused", "median_error": "refused"})
    write(HERE / "frf_thickness.csv", rows)


def judged(body: FullOrder, entries: Iterable[tuple[str, int]], loaded: str | None = None) -> Comparison:
    """All entries (method, n) on `body`. Measured without tracing, which costs a quarter."""
    labels = [(i.name, c) for i in body.interfaces if i.name not in body.ground for c in i.components]
    chosen = rows_named(labels, loaded) if loaded else None
    contest = Contest(tuple((method, Size(n)) for method, n in entries), Judging.over(), chosen)
    return compare(body, contest)


def with_memory(body: FullOrder, found: Comparison) -> Comparison:
    """The same with the memory of each trial, from another run of them all."""
    entries = tuple((t.method, Size(t.model.size)) for t in found.trials)
    tracemalloc.start()
    traced = compare(body, Contest(entries, found.reference.judging))
    tracemalloc.stop()
    return replace(found, trials=tuple(map(_with_memory_of, found.trials, traced.trials)))


def _with_memory_of(trial: Trial, traced: Trial) -> Trial:
    return replace(trial, memory=traced.memory)


def summary(body: FullOrder, found: Comparison, verify: bool = True) -> list[dict[str, Any]]:
    """One row a trial."""
    full = found.reference
    lines = full.judging.frequency
    checked = np.nan
    if verify:
        at = (0, len(lines) // 2, len(lines) - 1)
        exact = {k: direct(body, lines[k], full.judging.damping_ratio) for k in at}
        checked = max(np.linalg.norm(full.matrix[k] - h) / np.linalg.norm(h) for k, h in exact.items())
    return [
        {
            "dof": body.size,
            "inputs": full.matrix.shape[1],
            "method": t.method,
            "n": t.model.size,
            "max_error": t.error.max(),
            "at_Hz": lines[t.error.argmax()],
            "median_error": np.median(t.error),
            "max_with_residual": t.mended.max(),
            "max_loaded_only": t.loaded.max(),
            "seconds": t.seconds,
            "memory_MB": 1e-6 * t.memory,
            "reference_vectors": full.size,
            "reference_change": full.change,
            "reference_verified": checked,
        }
        for t in found.trials
    ]


def curves(found: Comparison, name: str, title: str) -> None:
    """The curves as `method,n,frequency_Hz,error` and as a chart."""
    table, drawn = error_curves(found.reference, [(t.method, t.model.size, t.error) for t in found.trials])
    write_text(HERE / f"{name}_curves.csv", table)
    write_error_chart(drawn, PICTURES / name, title)


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    """Rows as CSV, and on the terminal."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    write_text(path, text.getvalue())
    print(text.getvalue(), flush=True)


def main() -> None:
    measured = (carrier, carrier_free, ring, growth, cost, thickness)
    parts = {part.__name__: part for part in measured}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*parts, []], help="what to measure")
    for name in parser.parse_args().parts or parts:
        parts[name]()


if __name__ == "__main__":
    main()
