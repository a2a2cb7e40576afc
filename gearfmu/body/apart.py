"""Gears reduced side by side, each in a process of its own with one thread of arithmetic.

The processes are started as programs and not forked or spawned: a script that reduces needs no main guard, and the
number of threads is set before numpy is loaded. They end with the one that started them, or when it is interrupted.
"""

from __future__ import annotations

import json
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gearfmu.errors import BodyError
from gearfmu.reduction.cyclic.modal import Progress
from gearfmu.reduction.memory import Need, available_memory
from gearfmu.stagefile.forms.general import Stage

Job = tuple[Stage, str, Path]  # a stage, the name of the gear, the file of its body

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_SERVE = "from gearfmu.body.apart import serve; serve()"
_FAILED = "failed"
_AT_ONCE = 2  # gears in processes of their own
_WORTH = 8000  # unknowns of a sector from which on that is faster


def side_by_side(jobs: Sequence[tuple[Need | None, Job]]) -> list[Job]:
    """The jobs that are worth processes of their own, the longest first; none where processors or memory are for one
    only. A job whose need is not known is none of them."""
    found = [(need, job) for need, job in jobs if need is not None and need.unknowns > _WORTH]
    found.sort(key=lambda entry: -entry[0].unknowns * entry[0].sectors)
    most = sum(sorted((need.memory for need, _ in found), reverse=True)[:_AT_ONCE])
    there = available_memory()
    if len(found) < 2 or (os.cpu_count() or 1) < 2 or (there is not None and most > there):
        return []
    return [job for _, job in found]


def reduce_apart_together(jobs: Sequence[Job], progress: Progress | None = None) -> None:
    """Reduce and store gears, `_AT_ONCE` at the same time.

    Raises what the reduction raised, and BodyError where a process ended without a word.
    """
    waiting, running = list(jobs), list[subprocess.Popen[bytes]]()
    heard: queue.Queue[tuple[subprocess.Popen[bytes], str | None]] = queue.Queue()
    try:
        while waiting or running:
            while waiting and len(running) < _AT_ONCE:
                running.append(_started(waiting.pop(0), heard))
            process, line = heard.get()
            if line is None:
                running.remove(process)
                if process.wait():
                    raise BodyError(f"a process that reduced a gear ended with status {process.returncode}")
                continue
            what, value = json.loads(line)
            if what == _FAILED:
                raise pickle.loads(bytes.fromhex(value))
            if progress:
                progress(what, value)
    finally:
        for process in running:
            process.kill()
            process.wait()


def serve() -> None:
    """What the process does: a job from standard input, progress and failure to standard output, a line each."""
    from gearfmu.body.bodies import make_body

    def tell(what: str, value: float | str) -> None:
        print(json.dumps([what, value]), flush=True)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that started it ends it
    job: Job = pickle.load(sys.stdin.buffer)
    try:
        make_body(*job, tell)
    except Exception as error:
        tell(_FAILED, pickle.dumps(error).hex())


def _started(job: Job, heard: queue.Queue[tuple[subprocess.Popen[bytes], str | None]]) -> subprocess.Popen[bytes]:
    """A process at work on a job, and a thread that hands on its lines, and None at its end."""
    home = str(Path(__file__).resolve().parents[2])
    known = [part for part in (home, os.environ.get("PYTHONPATH")) if part]
    environment = {**os.environ, **dict.fromkeys(_THREADS, "1"), "PYTHONPATH": os.pathsep.join(known)}
    command = [sys.executable, "-c", _SERVE]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
    assert process.stdin and process.stdout
    process.stdin.write(pickle.dumps(job))
    process.stdin.close()

    def listen(lines: Any) -> None:
        for line in lines:
            heard.put((process, line.decode()))
        heard.put((process, None))

    threading.Thread(target=listen, args=(process.stdout,), daemon=True).start()
    return process
