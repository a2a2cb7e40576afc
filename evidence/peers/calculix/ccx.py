"""Running CalculiX's solver ccx, and the forces in what it prints."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

FORCES = re.compile(r" forces \(fx,fy,fz\) for set (\S+) and time")
PRESSURES = re.compile(r"pressure ratio \(smallest/largest pressure over all contact areas\) =\s*(\S+)")
TENSION = 1e-3  # largest tensile contact pressure, parts of the largest pressure
MOST_ITERATIONS = 40  # an increment; what converges took 7 to 26
END_OF_LOG = 1500  # characters shown of a failed run
WORK = Path("out/calculix")


def require_ccx() -> None:
    """SystemExit with the remedy where CalculiX is not installed."""
    if shutil.which("ccx") is None:
        raise SystemExit("needs CalculiX's solver ccx: apt-get install calculix-ccx")


def deck_path(name: str) -> Path:
    """Where the deck, log and results of a case lie, a folder below out/calculix."""
    folder = WORK / name
    folder.mkdir(parents=True, exist_ok=True)
    return folder / "deck.inp"


def run(path: Path) -> float:
    """Run ccx on a deck on one thread, its log beside it; wall time (s). RuntimeError with the end of the log when it
    fails, also when it is at the contact of an increment for more than MOST_ITERATIONS: it goes round in circles."""
    start = time.perf_counter()
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    log = path.with_suffix(".log")
    with open(log, "w", encoding="utf-8") as file:
        process = subprocess.Popen(["ccx", path.stem], cwd=path.parent, stdout=file, env=environment)
        while (code := _waited(process)) is None:
            increment = log.read_text(encoding="utf-8").rpartition("\n increment ")[2]
            if increment.count("\n iteration ") > MOST_ITERATIONS:
                process.kill()
    text = log.read_text(encoding="utf-8")
    if code != 0 or "Job finished" not in text:
        raise RuntimeError(f"ccx gave up on {path}:\n{text[-END_OF_LOG:]}")
    return time.perf_counter() - start


def _waited(process: subprocess.Popen) -> int | None:
    """Exit status of a process, None while it still runs after a second."""
    try:
        return process.wait(timeout=1.0)
    except subprocess.TimeoutExpired:
        return None


def run_deck(path: Path) -> float:
    """`run` of a contact problem. RuntimeError also when teeth stick to each other in what ccx calls converged."""
    seconds = run(path)
    text = path.with_suffix(".log").read_text(encoding="utf-8")
    ratios = [float(value) for value in PRESSURES.findall(text)]
    if not ratios or ratios[-1] < -TENSION:
        raise RuntimeError(f"{path}: teeth in tension, smallest over largest contact pressure {ratios}")
    return seconds


def reactions(path: Path) -> dict[str, dict[int, np.ndarray]]:
    """Of a .dat file that holds the forces of one step and nothing else: per printed set the force (3,) N on its
    nodes."""
    sets: dict[str, dict[int, np.ndarray]] = {}  # of several increments the last one's forces stay
    for line in path.read_text(encoding="ascii").splitlines():
        if head := FORCES.match(line):
            current = sets.setdefault(head[1], {})
        elif len(fields := line.split()) == 4:
            current[int(fields[0])] = np.array([float(number) for number in fields[1:]])
    return sets


def digest(deck: Path) -> str:
    """First half of the deck's SHA-256: what was solved with the same deck need not be solved again."""
    return hashlib.sha256(deck.read_bytes()).hexdigest()[:32]
