"""Instructions of an internal step: a C host program (effects_host.c) runs a kernel on a blob under callgrind, whose
counts repeat exactly. Needs valgrind and cc."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from gearfmu.stage import StageModel, Steady

ROOT = Path(__file__).resolve().parents[2]
SET = "planetary54"  # with constant torques
SET_START, SET_TORQUES = {"carrier.w_start": 85.0, "sun.w_start": 340.0}, {"carrier.tau": 600.0, "sun.tau": -150.0}


class Count(NamedTuple):
    """Instructions of an internal step, and the watched outputs at the end, bit for bit."""

    instructions: float
    outputs: tuple[str, ...]


class Period(NamedTuple):
    """Communication steps before and while it counts, and their length, s."""

    warm: int
    counted: int
    step: float


def make_host(folder: Path) -> Path:
    """The host program, compiled into a folder."""
    include, program = ROOT / "gearfmu" / "kernel" / "src", Path(__file__).with_name("effects_host.c")
    host = folder / "host"
    subprocess.run(["cc", "-std=gnu99", "-O2", f"-I{include}", "-o", host, program, "-ldl"], check=True)
    return host


def words(
    model: StageModel, parameters: Mapping[str, float], load: Steady | Mapping[str, float], watched: Sequence[str] = ()
) -> list[str]:
    """Parameters, inputs (constant speed and load, or constant torques) and watched outputs as the host takes them:
    reference = start + slope."""
    known = model.kernel().variables
    start, later = (load(0.0), load(1.0)) if isinstance(load, Steady) else (load, load)
    found = [f"p{known[name].reference}={value!r}+0" for name, value in parameters.items()]
    found += [f"i{known[n].reference}={float(v)!r}+{float(later[n] - v)!r}" for n, v in start.items()]
    return found + [f"w{known[name].reference}" for name in watched if name in known]


def count(host: Path, library: Path, blob: Path, period: Period, arguments: Sequence[str]) -> Count:
    """One run under callgrind. CalledProcessError when it fails."""
    command = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--toggle-collect=measured",
               "--callgrind-out-file=/dev/null", host, library, blob, *period, *arguments]  # fmt: skip
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    collected = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
    assert collected is not None, "callgrind says what it collected"
    internal, *outputs = done.stdout.split()
    return Count(int(collected[1]) / float(internal), tuple(outputs))
