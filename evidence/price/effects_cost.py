"""What every effect costs: instructions of an internal step with the effect, without it (off), and in a kernel that was
compiled without its code. Callgrind counts, which repeat exactly.

    python -m evidence.price.effects_cost [EFFECT …]

Pair with relief, 302 N·m (tip corners 80 N·m), 2000 rpm, one mesh period, h = 5 µs; what only sets have on planetary54
under 600 N·m at 85 rad/s of the carrier; friction on helical_demo, a housing on two_stage;
settings of each effect in gearfmu/stage/effects.py. Needs valgrind and cc.
Prints a table and writes gearfmu/stage/effects_cost.csv, where
docs/effects.md takes it from; with EFFECT only those rows are measured again. What is off costs nothing: exit code is
the number of effects that cost more than 5 % while they are off, or whose run then has other bits than without them.
"""

from __future__ import annotations

import math
import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import gearfmu
from evidence.price.counted import ROOT, SET, SET_START, SET_TORQUES, Count, Period, count, make_host, words
from gearfmu.body import load_bodies
from gearfmu.files import write_text
from gearfmu.kernel import build
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stage.effects import COSTS, EFFECTS, Cost, Effect, costs
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import Eccentricity, ProfileSpec

TABLE = ROOT / "gearfmu" / "stage" / COSTS
STAGE, SPEED = "fzg_c/stage_relief", 2000 * math.pi / 30
TORQUE, LIGHT = 302.0, {"tip_contact": 80.0}  # light: flanks carry alone, else off is another motion
PERIOD, PERIOD_OF_SET = Period(10, 38, 50e-6), Period(4, 10, 50e-6)  # 38 steps are one mesh period
BASE = {"level": 1.0, "h": 5e-6, "slices": 5.0}
ON = {  # settings beside `Effect.off_setting`, where they are not true
    "modes": {"level": 1.0},
    "residual": {"level": 3.0, "integrator": 1.0},
    "slices": {"slices": 5.0},
}
OWN_DATA: dict[str, dict[str, Any]] = {  # of the pinion, where the stage does not have them
    "pitch_errors": {"index_deviation": {0: 5e-6}},
    "flank_deviations": {"profile": ProfileSpec(slope=2e-6, crowning=2e-6)},
    "runout": {"eccentricity": Eccentricity(amount=5e-6)},
}
OTHERS = {"friction": "helical_demo", "housing": "two_stage/stage_housed"}  # stages that have what it needs
Compiled = Callable[[Sequence[str], Sequence[str], Sequence[Path], Path], list[Path]]
MOST = 0.05  # that an effect may cost while it is off
WATCHED = [f"{mesh}.{what}" for mesh in ("mesh", "stage2", "sun_planet1") for what in ("te", "force")]
WATCHED += ["energy.stored", "energy.dissipated"]  # as there are


shipped = lru_cache(gearfmu.assemble)  # a planetary set takes some seconds


class Bench:
    """Models, the host program and kernels in one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.host, self.whole = make_host(folder), folder / "whole"
        self.counts: dict[tuple[Any, ...], Count] = {}
        spec = load_stage(STAGE)
        bodies = load_bodies(spec)
        self.own = {
            name: assemble(
                rewritten(spec, gears=(spec.written.gears[0].model_copy(update=data), spec.written.gears[1])), bodies
            )
            for name, data in OWN_DATA.items()
        }

    def library(self, without: str) -> Path:
        """A kernel of the sources of the moment, compiled without the code of one effect."""
        path = self.folder / f"without_{without}_{build.source_hash(build.sources())[:8]}.so"
        if not path.exists():
            with patch.object(build, "_objects", partial(self._objects, without, build._objects)):
                build.build_library(out=path, compiler=("cc",))
        return path

    def _objects(
        self, without: str, compiled: Compiled, line: Sequence[str], own: Sequence[str], files: Sequence[Path], at: Path
    ) -> list[Path]:
        """Objects of all sources: those that ask for the effect are compiled, others are those of the whole kernel."""
        if without == "nothing":
            self.whole.mkdir()
            return compiled(line, own, files, self.whole)
        asks = re.compile(rf"GK_(ON|HAS)\(.*\b{without}\)")
        asking = {path for path in files if asks.search(path.read_text(encoding="utf-8"))}
        names = {f'"{path.parent.name}/{path.name}"' for path in asking}
        asking |= {path for path in files if any(name in path.read_text(encoding="utf-8") for name in names)}
        others = [self.whole / f"{path.stem}.o" for path in files if path not in asking]
        return others + compiled(line, [*own, f"-DGK_WITHOUT={without}"], list(asking), at)

    def count(self, library: Path, model: StageModel, settings: Mapping[str, float], torque: float) -> Count:
        """One run under callgrind, or the count of an equal one. CalledProcessError when it fails."""
        key = (library, model.hash, tuple(sorted(settings.items())), torque)
        if key not in self.counts:
            self.counts[key] = self._counted(library, model, settings, torque)
        return self.counts[key]

    def _counted(self, library: Path, model: StageModel, settings: Mapping[str, float], torque: float) -> Count:
        blob = self.folder / f"{model.hash[:12]}.blob"
        blob.write_bytes(model.blob)
        if model is shipped(SET):
            arguments = words(model, {**settings, **SET_START}, SET_TORQUES, WATCHED)
            return count(self.host, library, blob, PERIOD_OF_SET, arguments)
        arguments = words(model, settings, Steady(model, SPEED, torque), WATCHED)
        return count(self.host, library, blob, PERIOD, arguments)

    def measure(self, effect: Effect) -> tuple[Cost, bool]:
        """The three counts; and whether the kernel without the code computes the same bits as the effect off."""
        plain = shipped(SET if effect.carried else OTHERS.get(effect.name, STAGE))
        with_it = self.own.get(effect.name, plain)
        plain = with_it if effect.off_setting else plain  # the switch is there where the data are
        whole, lacking, torque = self.library("nothing"), self.library(effect.name), LIGHT.get(effect.name, TORQUE)
        on = self.count(whole, with_it, {**BASE, **ON.get(effect.name, dict.fromkeys(effect.off_setting, 1.0))}, torque)
        off = self.count(whole, plain, {**BASE, **effect.off_setting}, torque)
        without = self.count(lacking, plain, {**BASE, **effect.off_setting}, torque)
        cost = Cost(effect.name, on.instructions, off.instructions, without.instructions)
        return cost, off.outputs == without.outputs


def table(rows: Mapping[str, Cost]) -> str:
    """The CSV, in the order of the effects."""
    ordered = [rows[effect.name] for effect in EFFECTS if effect.name in rows]
    lines = [f"{row.effect},{row.on:.1f},{row.off:.1f},{row.without:.1f}" for row in ordered]
    return "\n".join(["effect,on,off,without", *lines, ""])


def main(names: list[str]) -> int:
    """Measure the named effects, or all, and write the table; the number of those that are not nothing while off."""
    rows, wrong = costs(), 0
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        for effect in EFFECTS:
            if names and effect.name not in names:
                continue
            row, same = bench.measure(effect)
            rows[effect.name] = row
            wrong += not same or abs(row.price_of_off) > MOST
            counts = f"on {row.on:9.0f}  off {row.off:9.0f}  without {row.without:9.0f} instructions a step"
            shares = f"costs {row.share:6.1%}, off costs {row.price_of_off:+6.1%}"
            print(f"{effect.name:16s} {counts}: {shares}, same bits: {same}", flush=True)
    write_text(TABLE, table(rows))
    return wrong


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
