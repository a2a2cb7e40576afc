"""Golden hashes of runs: a refactoring of the kernel must not change one bit of them.

Six scenes on the small pair, at every level and with every integrator, and all other kinds of stage and calculation
(golden_stages.py), in single and double build. A change of the kernel that is meant to change numbers writes them anew,
in a commit that says why:

    python tests/kernel/golden.py --write

The stored models of golden_stages.py are written by --write-models (golden_models.py), which changes their hashes too.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from golden_models import write_models
from golden_stages import stage_digests
from probes import build
from small_model import pair_blob

from gearfmu.kernel import Kernel

FILE = Path(__file__).parents[1] / "reference" / "golden_runs.json"
REALS = ("float", "double")
STEP = 2e-5  # s, communication step
LEVELS = ("rigid", "fast", "standard", "full", "paper", "explicit")
INTEGRATORS = ("dg4", "mix4", "em", "rk45", "central")
EXPLICIT = ("rk45", "central")

Drive = Callable[[Kernel, int], None]


@dataclass(frozen=True)
class Scene:
    """ports of pinion and wheel; drive sets the inputs of communication step i; steps; parameters beside the run's."""

    ports: tuple[str, str]
    drive: Drive
    steps: int = 150
    parameters: dict[str, float] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)


def _loaded(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.phi", 6e-3 + 200.0 * i * STEP)
    kernel.set("wheel.phi", 4e-3 - 200.0 * 16 / 24 * i * STEP)


def _reversing(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.tau", 200.0 if i // 40 % 2 else -150.0)


def _both_free(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.tau", 40.0 if i // 25 % 2 else -20.0)
    kernel.set("wheel.tau", 30.0 if i // 25 % 2 else -55.0)


def _closing(kernel: Kernel, i: int) -> None:
    kernel.set("pinion.phi", 30.0 * i * STEP)
    kernel.set("pinion.clutch.capacity", min(1.0 * i, 120.0))


SCENES: dict[str, Scene] = {
    "loaded": Scene(("spring", "spring"), _loaded, start={"pinion.w": 200.0, "wheel.w": -200.0 * 16 / 24}),
    "reversing": Scene(("torque", "spring"), _reversing),
    "jammed": Scene(("torque", "fixed"), _reversing, parameters={"backlash": -4e-6, "slices": 5}),
    "rattle": Scene(("torque", "torque"), _both_free, parameters={"contact_damping": 0.0, "slices": 10}),
    "clutch": Scene(("chain", "spring"), _closing, start={"pinion.w": 30.0, "pinion.clutch.capacity": 20.0}),
    "plain": Scene(
        ("torque", "spring"),
        _reversing,
        parameters={
            f"effect.{name}": 0.0 for name in ("hertz", "tip_relief", "bearings", "modal_damping", "roll_motion")
        },
    ),
}


def runs() -> Iterator[tuple[str, Scene, dict[str, float]]]:
    """Name, scene and parameters of every run."""
    for name, scene in SCENES.items():
        for i, level in enumerate(LEVELS):
            if not (level in ("paper", "explicit") and name == "clutch"):
                yield f"{name}/{level}", scene, {"level": i}
        for i, integrator in enumerate(INTEGRATORS[1:], 1):
            if not (integrator in EXPLICIT and name == "clutch"):
                yield f"{name}/{integrator}", scene, {"level": LEVELS.index("fast"), "integrator": i}


def digest(scene: Scene, parameters: dict[str, float], library: Path | None = None) -> str:
    """16 hex digits over all outputs at every communication step, and over how the run ends if it ends early."""
    kernel = Kernel(pair_blob(scene.ports), {**scene.parameters, **parameters}, library)
    for name, value in scene.start.items():
        kernel.set(name, value)
    scene.drive(kernel, 0)
    kernel.initialize()
    outputs = [v.name for v in kernel.variables.values() if v.causality == "output"]
    hashed = hashlib.sha256()
    for i in range(scene.steps):
        scene.drive(kernel, i)
        outcome = kernel.try_step(i * STEP, STEP)
        values = [kernel.get(name) for name in outputs]
        hashed.update(struct.pack(f"<i{len(values)}d", outcome, *values))
        if outcome:
            break
    return hashed.hexdigest()[:16]


def all_digests(library: Path | None = None, part: str = "") -> dict[str, str]:
    """Run → digest, with this build of the kernel; part: of the names of those that are made."""
    pairs = {name: digest(scene, parameters, library) for name, scene, parameters in runs() if part in name}
    return pairs | stage_digests(library, part)


def stored() -> dict[str, dict[str, str]]:
    """Build ("float", "double") → run → digest."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def main() -> None:
    parser = argparse.ArgumentParser(description="Golden hashes of the kernel's runs.")
    parser.add_argument("--write", action="store_true", help="store what this kernel gives")
    parser.add_argument("--library", type=Path, help="compare this build of the kernel")
    parser.add_argument("--only", default="", help="a part of the names of runs to compare")
    parser.add_argument("--real", choices=REALS, default="float", help="its type of modal rows and states")
    parser.add_argument("--write-models", action="store_true", help="make and store the small models, nothing else")
    chosen = parser.parse_args()
    if chosen.write_models:
        return write_models()
    found = {}
    for real in [chosen.real] if chosen.library else REALS:
        with tempfile.TemporaryDirectory() as folder:
            found[real] = all_digests(chosen.library or build(Path(folder), real=real), chosen.only)
    if chosen.write and not chosen.library and not chosen.only:
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        return
    known = {real: {name: d for name, d in stored()[real].items() if chosen.only in name} for real in found}
    other = [f"{real} {name}" for real in found for name, d in known[real].items() if found[real].get(name) != d]
    print(f"{sum(map(len, found.values()))} runs, {len(other)} moved", *other, sep="\n  ")
    sys.exit(min(len(other), 99))


if __name__ == "__main__":
    main()
