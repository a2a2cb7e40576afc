"""Who computes: this process, processes of this machine, or a dask cluster. All call a function for every argument and
yield (number of the argument, result) as they come; a result that no worker lived to give is a Lost."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gearfmu.extras import required

TRIES = 3  # workers that may die over the same argument
PACKAGES = Path(__file__).resolve().parents[2]
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

Runner = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[tuple[int, Any]]]


@dataclass(frozen=True)
class Lost:
    """In place of a result when workers died over it."""

    message: str


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_this_process(function: Callable[[Any], Any], arguments: Sequence[object]) -> Iterator[tuple[int, Any]]:
    """A Runner: one argument after the other, here."""
    for number, argument in enumerate(arguments):
        yield number, function(argument)


def runner_of(on: object) -> Runner:
    """The Runner of a number of processes, this one for 1 and None; else that of a dask cluster (`on_cluster`)."""
    if on is None or on == 1:
        return in_this_process
    return on_this_machine(on) if isinstance(on, int) else on_cluster(on)


def on_this_machine(workers: int | None = None) -> Runner:
    """A Runner with so many processes of this machine, one a core when None. They are Python processes of their own
    (`worker.py`), so that scripts need no `if __name__ == "__main__":`; one that dies is replaced and its argument
    tried again."""

    def run(function: Callable[[Any], Any], arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        team = _Team()
        with contextlib.closing(team), ThreadPoolExecutor(min(workers or cores(), max(1, len(arguments)))) as threads:
            futures = {threads.submit(team.call, function, argument): n for n, argument in enumerate(arguments)}
            try:
                for future in as_completed(futures):
                    yield futures[future], future.result()
            finally:
                threads.shutdown(wait=False, cancel_futures=True)
                team.close()

    return run


def on_cluster(scheduler: Any) -> Runner:
    """A Runner on a dask cluster: the address of its scheduler ("tcp://host:8786"), a dask Client or a cluster.
    Workers need the same gearfmu and see the files under the same paths. Needs gearfmu[dist]."""
    distributed = required("distributed", "dist")

    def run(function: Callable[[Any], Any], arguments: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        own = not isinstance(scheduler, distributed.Client)
        client = distributed.Client(scheduler) if own else scheduler
        futures = {client.submit(function, argument, pure=False): n for n, argument in enumerate(arguments)}
        try:
            for future in distributed.as_completed(list(futures)):
                error = future.exception()
                lost = None if error is None else Lost(f"{type(error).__name__}: {error}")
                yield futures[future], lost or future.result()
                future.release()
        finally:
            client.cancel(list(futures))
            if own:
                client.close()

    return run


class _Team:
    """One worker process a thread."""

    def __init__(self) -> None:
        self._own = threading.local()
        self._workers: list[subprocess.Popen[bytes]] = []
        self._closed = False

    def call(self, function: Callable[[Any], Any], argument: object) -> Any:
        """function(argument), computed by this thread's worker; Lost when TRIES of them died over it."""
        code: int | None = None
        for _ in range(TRIES):
            worker = self._worker()
            assert worker.stdin is not None and worker.stdout is not None
            try:
                pickle.dump((function, argument), worker.stdin)
                worker.stdin.flush()
                return pickle.load(worker.stdout)
            except (EOFError, OSError, pickle.UnpicklingError):
                code = worker.wait()
                if self._closed:
                    break
        return Lost(f"{TRIES} worker processes ended over it, the last with exit code {code}")

    def _worker(self) -> subprocess.Popen[bytes]:
        found: subprocess.Popen[bytes] | None = getattr(self._own, "worker", None)
        if found is None or found.poll() is not None:
            path = os.pathsep.join(filter(None, [str(PACKAGES), os.environ.get("PYTHONPATH")]))
            found = self._own.worker = subprocess.Popen(
                [sys.executable, "-m", "gearfmu.sweeps.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**ONE_THREAD, **os.environ, "PYTHONPATH": path},
            )
            self._workers.append(found)
        return found

    def close(self) -> None:
        """End all workers."""
        self._closed = True
        for worker in self._workers:
            worker.kill()
            worker.wait()
