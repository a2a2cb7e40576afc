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
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gearfmu.errors import BodyError

Progress = Callable[[str, float], None]
Job = tuple[Any, int, Path]

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_SERVE = "from gearfmu.body.apart import serve; serve()"
_FAILED = "failed"


def reduce_apart_together(jobs: Sequence[Job], at_once: int, progress: Progress | None = None) -> None:
    """Reduce and store gears, `at_once` at the same time; a job is (stage, number of the gear, file).

    Raises what the reduction raised, and BodyError where a process ended without a word.
    """
    waiting, running = list(jobs), list[subprocess.Popen[bytes]]()
    heard: queue.Queue[tuple[subprocess.Popen[bytes], str | None]] = queue.Queue()
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
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
    from gearfmu.body.reduce import reduce_gear
    from gearfmu.body.store import save_body

    def tell(what: str, value: float | str) -> None:
        print(json.dumps([what, value]), flush=True)

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that started it ends it
    spec, index, path = pickle.load(sys.stdin.buffer)
    try:
        save_body(reduce_gear(spec, index, tell), path)
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
