"""What an internal step costs beside the kernel of an earlier commit: instructions, and processor time in turn.

    python -m evidence.price.step_cost [--commit 4e4da56] [--level fast] [--rounds 7]
    python -m evidence.price.step_cost --commit 3116c35f --stage helical_demo --torque 150 --slices 7   # fixed slices

Pair with relief, 302 N·m at 2000 rpm, all outputs on, or another. The earlier commit is unpacked and built beside this
one; both kernels run the same mesh periods in turn, so that their times share the machine's moods. Prints instructions
of a step by callgrind (where valgrind is there), the time of a step in the quickest mesh period of each run, which
other load on the machine disturbs least, and the median of the ratios round by round.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SPEED = 209.44  # rad/s
LEVELS = {"rigid": 0.0, "fast": 1.0, "standard": 2.0, "full": 3.0}
H, STEP, WARM, PERIOD, TIMED = 50e-6, 5e-6, 10, 38, 100  # communication steps, of one mesh period too; periods timed


@dataclass(frozen=True)
class Case:
    """A pair under a torque (N·m) at SPEED."""

    stage: str
    torque: float
    slices: int
    level: str

    @property
    def arguments(self) -> list[str]:
        """Of this program."""
        return [text for name, value in vars(self).items() for text in (f"--{name}", str(value))]

    @property
    def parameters(self) -> dict[str, float]:
        """Of the kernel."""
        return {"level": LEVELS[self.level], "h": STEP, "slices": float(self.slices)}


def assembled(name: str) -> Any:
    """The model of a stage, by the package that this process imports: earlier commits have other names."""
    import gearfmu
    from gearfmu import body
    from gearfmu.stage import assemble

    here = (Path(gearfmu.__file__).parent / "stagefile").is_dir()
    spec = import_module(f"gearfmu.{'stagefile' if here else 'spec'}.stage").load_stage(name)
    bodies = (body.load_stage_bodies if hasattr(body, "load_stage_bodies") else body.load_bodies)(spec)
    return assemble(spec, bodies)


def write(folder: Path, case: Case) -> None:
    """Blob, library and arguments of the host program, by the package that this process imports."""
    from gearfmu.kernel.build import build_library
    from gearfmu.stage import Steady

    build_library()  # where this package looks for it
    build_library(out=folder / "kernel.so")
    model = assembled(case.stage)
    (folder / "blob").write_bytes(model.blob)
    known, drive = model.kernel().variables, Steady(model, SPEED, case.torque)
    start, next_one = drive(0.0), drive(H)
    words = [f"p{known[n].reference}={v!r}+0" for n, v in case.parameters.items()]
    words += [f"i{known[n].reference}={float(v)!r}+{(next_one[n] - v) / H!r}" for n, v in start.items()]
    (folder / "words").write_text(" ".join([*words, f"w{known['energy.stored'].reference}"]), encoding="utf-8")


def least(folder: Path, case: Case) -> float:
    """Time (s) of an internal step in the quickest of `TIMED` mesh periods, by the package of this process."""
    from gearfmu.kernel import Kernel
    from gearfmu.stage import Steady

    model = assembled(case.stage)
    drive = Steady(model, SPEED, case.torque)
    kernel = Kernel(model.blob, case.parameters, folder / "kernel.so")
    best, inputs = float("inf"), [drive(k * H) for k in range(PERIOD * TIMED)]
    for k, values in enumerate(inputs):
        if k % PERIOD == 0:
            started, before = time.perf_counter(), kernel.get("solver.steps") if k else 0.0
        for name, value in values.items():
            kernel.set(name, value)
        if k == 0:
            kernel.initialize()
        kernel.step(k * H, H)
        if k % PERIOD == PERIOD - 1:
            best = min(best, (time.perf_counter() - started) / (kernel.get("solver.steps") - before))
    return best


class Side:
    """A tree of sources, its kernel and the host program that runs it."""

    def __init__(self, tree: Path, folder: Path, case: Case):
        self.tree, self.folder, self.case = tree, folder, case
        folder.mkdir()
        self._child("--write")
        source, include = ROOT / "evidence" / "price" / "effects_host.c", tree / "gearfmu" / "kernel" / "src"
        subprocess.run(["cc", "-std=gnu99", "-O2", f"-I{include}", "-o", folder / "host", source, "-ldl"], check=True)

    def _child(self, what: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(self.tree), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, __file__, what, str(self.folder), *self.case.arguments]
        return subprocess.run(
            command, check=True, env=environment, cwd=self.tree, stdout=subprocess.PIPE, text=True
        ).stdout

    def run(self, steps: int, *before: str) -> subprocess.CompletedProcess[str]:
        """The host over so many communication steps after the warm ones."""
        words = (self.folder / "words").read_text(encoding="utf-8").split()
        command = [
            *before,
            self.folder / "host",
            self.folder / "kernel.so",
            self.folder / "blob",
            WARM,
            steps,
            H,
            *words,
        ]
        return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)

    def seconds(self) -> float:
        """Time (s) of an internal step in the quickest mesh period of a run."""
        return float(self._child("--time"))

    def instructions(self) -> float:
        """Instructions of an internal step."""
        done = self.run(PERIOD, "valgrind", "--tool=callgrind", "--instr-atstart=no", "--toggle-collect=measured",
                        "--callgrind-out-file=/dev/null")  # fmt: skip
        collected = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
        assert collected is not None, "callgrind says what it collected"
        return int(collected[1]) / float(done.stdout.split()[0])


def unpacked(commit: str, folder: Path) -> Path:
    """The tree of a commit."""
    folder.mkdir()
    archive = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
    return folder


def main() -> None:
    """Build both, measure in turn, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commit", default="4e4da56")
    parser.add_argument("--stage", default="fzg_c/stage_relief")
    parser.add_argument("--torque", type=float, default=302.0)
    parser.add_argument("--slices", type=int, default=5)
    parser.add_argument("--level", choices=LEVELS, default="fast")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--time", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    case = Case(chosen.stage, chosen.torque, chosen.slices, chosen.level)
    if chosen.write:
        return write(chosen.write, case)
    if chosen.time:
        return print(least(chosen.time, case))
    with tempfile.TemporaryDirectory() as work:
        sides = {
            chosen.commit: Side(unpacked(chosen.commit, Path(work) / "tree"), Path(work) / "before", case),
            "this tree": Side(ROOT, Path(work) / "now", case),
        }
        times: dict[str, list[float]] = {name: [] for name in sides}
        for _ in range(chosen.rounds):
            for name, side in sides.items():
                times[name].append(side.seconds())
        counts = {name: side.instructions() for name, side in sides.items()} if shutil.which("valgrind") else {}
    print(f"{case.stage}, level {case.level}, h = {1e6 * STEP:g} µs      µs a step   instructions a step")
    for name in sides:
        counted = f"{counts[name]:12.0f}" if counts else "no valgrind "
        print(f"  {name:<40} {1e6 * min(times[name]):10.2f}   {counted}")
    before, now = (times[name] for name in sides)
    ratio = statistics.median(n / b for n, b in zip(now, before, strict=True))
    print(f"  now / before, median of {chosen.rounds} rounds in turn {ratio:8.3f}", end="")
    print(f"   {counts['this tree'] / counts[chosen.commit]:12.3f}" if counts else "")


if __name__ == "__main__":
    main()
