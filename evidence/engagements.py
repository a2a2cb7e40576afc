"""What engagements cost: time and instructions of an internal step of 1, 2, 4 and 8 pairs in one model, that nothing
connects.

    python evidence/engagements.py

Pair with relief, 302 N·m at 2000 rpm, level fast. Prints a row for each number of pairs: best processor time of a step
of five runs, and instructions by callgrind where valgrind and cc are there. Aim: linear within 20 %, a pair of eight
costs at most 1.2 times a single one.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from gearfmu.body import load_bodies
from gearfmu.kernel.build import library_path
from gearfmu.spec.forms.expand import expand_pair
from gearfmu.spec.forms.general import RotorSpec, Stage
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel, Steady, assemble

ROOT = Path(__file__).resolve().parents[1]
STAGE, TORQUE, SPEED = "fzg_c/stage_relief", 302.0, 209.44
COUNTS = (1, 2, 4, 8)
H, WARM, STEPS, RUNS = 50e-6, 10, 38, 5  # communication steps; 38 are one mesh period
BASE = {"level": 1.0, "h": 5e-6, "slices": 5.0}


def copies(pair: Stage, count: int) -> Stage:
    """The pair `count` times in one stage, a metre apart; names of copy i end with i."""
    parts = [_copy(pair, i) for i in range(count)]
    merged = {
        field: {name: item for part in parts for name, item in getattr(part, field).items()}
        for field in ("bodies", "rotors", "ports")
    }
    lists = {field: tuple(x for part in parts for x in getattr(part, field)) for field in ("engagements", "supports")}
    return pair.model_copy(update={"name": f"pairs{count}", **merged, **lists})


def _copy(pair: Stage, i: int) -> Stage:
    mesh, rotors = pair.engagements[0], {}
    for name, rotor in pair.rotors.items():
        x, y = rotor.axis
        rotors[f"{name}{i}"] = RotorSpec(
            axis=(x, y + i), bodies={f"{body}{i}": at for body, at in rotor.bodies.items()}
        )
    gears = tuple(f"{gear}{i}" for gear in mesh.gears)
    return pair.model_copy(
        update={
            "bodies": {f"{n}{i}": body.model_copy(update={"name": f"{n}{i}"}) for n, body in pair.bodies.items()},
            "rotors": rotors,
            "engagements": (mesh.model_copy(update={"name": f"mesh{i}", "gears": gears}),),
            "supports": tuple(
                s.model_copy(update={"name": f"{s.name}{i}", "body": f"{s.body}{i}"}) for s in pair.supports
            ),
            "ports": {f"{n}{i}": p.model_copy(update={"body": f"{p.body}{i}"}) for n, p in pair.ports.items()},
        }
    )


def inputs(alone: StageModel, count: int, at: float) -> dict[str, float]:
    """Inputs of every copy at a time (s): those of the pair alone."""
    found = Steady(alone, SPEED, TORQUE)(at)
    return {name.replace(".", f"{i}."): value for i in range(count) for name, value in found.items()}


def seconds(model: StageModel, drive: Mapping[int, Mapping[str, float]]) -> float:
    """Least processor time of an internal step, s, over RUNS runs."""
    best = float("inf")
    for _ in range(RUNS):
        kernel = model.kernel(**BASE)
        for k in range(WARM + STEPS):
            for name, value in drive[k].items():
                kernel.set(name, value)
            if k == 0:
                kernel.initialize()
            if k == WARM:
                before, started = kernel.get("solver.steps"), time.process_time()
            kernel.step(k * H, H)
        best = min(best, (time.process_time() - started) / (kernel.get("solver.steps") - before))
    return best


def instructions(model: StageModel, drive: Mapping[int, Mapping[str, float]], folder: Path) -> float | None:
    """Instructions of an internal step; None without valgrind or cc."""
    if shutil.which("valgrind") is None or shutil.which("cc") is None:
        return None
    host, blob, known = folder / "host", folder / f"{model.name}.blob", model.kernel().variables
    program, include = ROOT / "evidence" / "effects_host.c", ROOT / "gearfmu" / "kernel" / "src"
    subprocess.run(["cc", "-std=gnu99", "-O2", f"-I{include}", "-o", host, program, "-ldl"], check=True)
    blob.write_bytes(model.blob)
    words = [f"p{known[name].reference}={value!r}+0" for name, value in BASE.items()]
    for name, value in drive[0].items():
        words.append(f"i{known[name].reference}={value!r}+{(drive[1][name] - value) / H!r}")
    command = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--toggle-collect=measured",
               "--callgrind-out-file=/dev/null", host, library_path(), blob, WARM, STEPS, H, *words,
               f"w{known['energy.stored'].reference}"]  # fmt: skip
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    collected = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
    assert collected is not None, "callgrind says what it collected"
    return int(collected[1]) / float(done.stdout.split()[0])


def main() -> None:
    """Measure and print."""
    spec = load_stage(STAGE)
    bodies, pair, first = load_bodies(spec), expand_pair(spec), None
    alone = assemble(spec, bodies)
    print("pairs   µs a step   instructions   of a pair alone: time, instructions, for each pair")
    with tempfile.TemporaryDirectory() as folder:
        for count in COUNTS:
            model = assemble(copies(pair, count), bodies * count)
            drive = {k: inputs(alone, count, k * H) for k in range(WARM + STEPS)}
            own, counted = seconds(model, drive), instructions(model, drive, Path(folder))
            first = first or (own, counted)
            shares = [f"{own / count / first[0]:.2f}"]
            if counted and first[1]:
                shares.append(f"{counted / count / first[1]:.2f}")
            shown = f"{counted:12.0f}" if counted else "no valgrind "
            print(f"{count:5d} {1e6 * own:11.1f}   {shown}   {', '.join(shares)}", flush=True)


if __name__ == "__main__":
    main()
