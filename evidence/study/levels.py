"""The price list of the fidelity levels, which every report shows: error and processor time of each at its default
step, from a study (gearfmu/study) of the loaded and the lightly loaded pair.

    python -m evidence.study.levels

Rows that are not in evidence/study yet, or not of this kernel and these bodies, are measured and added. Writes
levels_<stage>.csv beside the stage file, where the report looks for it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evidence.tables import told
from gearfmu.cosim.accuracy import alternating, rms
from gearfmu.report.levels import COLUMNS, fingerprint, levels_path, read_levels
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stage.run.trace import write_columns
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.norm import Signals
from gearfmu.study.run import Job, study
from gearfmu.study.table import Row


def price(row: Row, reference: Signals, bodies: str) -> dict[str, object]:
    """One line of the list from a row of the study."""
    size = rms(alternating(reference.te, reference.interval, reference.steady))
    return {
        "scene": row.scene,
        "level": row.level,
        "n_dyn": row.n_dyn,
        "slices": row.slices,
        "h_us": 1e6 * row.h_s,
        "te_error": row.te_error,
        "force_error": row.force_error,
        "bearing_error": row.bearing_error,
        "te_mean_error_um": 1e6 * row.te_mean_error * size,
        "time_per_second": row.realtime_factor,
        "bodies": bodies,
    }


def main() -> None:
    """Measure what is missing and write one list a stage."""
    for name in ("pair_loaded", "pair_light"):
        found = study(Job(load_scene(name), Path(__file__).parent, defaults=True))
        bodies, reference = fingerprint(found.model.body_hashes), found.references[found.scene.stage.slices]
        levels = sorted(found.rows, key=lambda row: LEVELS.index(row.level))
        rows = [price(row, reference.signals, bodies) for row in levels]
        path = levels_path(load_stage(found.scene.stage.name))
        table = [old for old in read_levels(path) if old["scene"] != name] + rows
        write_columns(path, {column: np.array([line[column] for line in table]) for column in COLUMNS})
        told(rows)


if __name__ == "__main__":
    main()
