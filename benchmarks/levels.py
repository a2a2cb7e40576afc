"""The price list of the fidelity levels: error and processor time of each, on the loaded and on the lightly loaded
pair.

    python benchmarks/levels.py [pair_loaded pair_light]

Every level runs with its default step. The reference is level `full` with a fifth of its own default step. Error:
rms of the difference over rms of the
alternating part, after settling, means compared apart. Time: processor seconds in the stage per simulated second, as
measured on this machine now.
Writes levels.csv beside the stage file, where the report looks for it.
"""

from __future__ import annotations

import sys

import numpy as np

from gearfmu.cosim import run
from gearfmu.report.levels import COLUMNS, fingerprint, levels_path, read_levels
from gearfmu.spec.scene import SceneSpec, load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.stage.trace import Trace, write_columns

LEVELS = ("rigid", "fast", "standard", "full")
SIGNALS = {"te": "mesh.te", "force": "mesh.force_mean", "bearing": "bearing.pinion.fy"}
REFINED = 5


def at(scene: SceneSpec, level: str, h: float = 0.0) -> Trace:
    """Settled part of the scene at this level and step (0: the default)."""
    stage = scene.stage.model_copy(update={"level": level, "h": h})
    return run(scene.model_copy(update={"stage": stage}), unit="kernel").window(scene.settle)


def row(scene: SceneSpec, trace: Trace, reference: Trace) -> dict[str, object]:
    """One line of the list."""
    meta = trace.meta
    found: dict[str, object] = {
        "scene": scene.name,
        "level": meta["level"],
        "n_dyn": meta["n_dyn"],
        "slices": meta["slices"],
        "h_us": 1e6 * meta["h"],
    }
    for name, channel in SIGNALS.items():
        wanted, got = reference[channel], trace[channel]
        found[f"{name}_error"] = float(np.std(got - wanted) / np.std(wanted))
    found["te_mean_error_um"] = 1e6 * float(np.mean(trace["mesh.te"]) - np.mean(reference["mesh.te"]))
    found["time_per_second"] = meta["stage_realtime_factor"]
    found["bodies"] = fingerprint(text for name, text in meta["hashes"].items() if name.startswith("body "))
    return found


def main(scenes: list[str]) -> None:
    """Measure the scenes and write one list a stage."""
    for name in scenes:
        scene = load_scene(name)
        full = at(scene, "full")
        reference = at(scene, "full", full.meta["h"] / REFINED)
        rows = [row(scene, full if level == "full" else at(scene, level), reference) for level in LEVELS]
        path = levels_path(load_stage(scene.stage.name))
        kept = [old for old in read_levels(path) if old["scene"] != name]
        table = kept + rows
        write_columns(path, {column: np.array([line[column] for line in table]) for column in COLUMNS})
        for line in rows:
            print(
                "  ".join(
                    f"{line[column]:.3g}" if isinstance(line[column], float) else str(line[column])
                    for column in COLUMNS
                ),
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:] or ["pair_loaded", "pair_light"])
