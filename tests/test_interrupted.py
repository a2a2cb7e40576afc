"""Ctrl-C in long work, two processes on one body, a disk without room: files are whole, and one line says it."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gearfmu.body import load_body
from gearfmu.stagefile.proposals.numbers import Wish, new_from_numbers

GEARFMU = [sys.executable, "-m", "gearfmu.cli"]
INTERRUPTED = "gearfmu: interrupted; files that were being written are as they were before"
SMALL = {"modes": 40, "roll_points": 8, "width_functions": 3, "flank": 6, "thickness": 2, "width": 2}
LATEST = 120.0  # s until there is something to interrupt


def tiny(folder: Path) -> Path:
    """A pair whose bodies are made in a second."""
    path = Path(new_from_numbers("tiny", Wish((17, 19), 1e-3, 5e-3), str(folder)))
    lines = path.read_text(encoding="utf-8").splitlines()
    for place, line in enumerate(lines):
        key = line.split(" = ")[0]
        lines[place] = f"{key} = {SMALL[key]}" if key in SMALL else line
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def _heeds_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # which a test run in the background of a shell ignores


def started(words: list[str], folder: Path) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [*GEARFMU, *words], cwd=folder, stdout=pipe, stderr=pipe, text=True, preexec_fn=_heeds_interrupts
    )


def left_over(folder: Path) -> list[str]:
    """Temporary files."""
    return [path.name for path in folder.rglob(".*") if path.is_file()]


SLOW = pytest.param("study", marks=pytest.mark.full)
OVER = ["--over", "torque=10:300:200 N*m", "--over", "positions=4"]
WORK = {  # verb with its arguments, and the file or line that shows that it is at work
    "reduce": (["reduce", "tiny"], ""),
    "sweep": (["sweep", "fzg_c", *OVER, "--jobs", "1", "--out", "out"], "points.jsonl"),
    "study": (["study", "pair_loaded", "--quick", "--out", "out"], "study.csv"),
}


@pytest.mark.parametrize("verb", ["reduce", "sweep", SLOW])
def test_interrupted_work_is_one_line_and_whole_files(verb: str, tmp_path: Path) -> None:
    if verb == "reduce":
        tiny(tmp_path)
    words, sign = WORK[verb]
    work = started(words, tmp_path)
    assert work.stderr is not None
    if not sign:
        while "reducing" not in (line := work.stderr.readline()):
            assert line, "it ended by itself"
    end = time.monotonic() + LATEST
    while sign and not (found := list(tmp_path.rglob(sign))) and work.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    work.send_signal(signal.SIGINT)
    _, told = work.communicate(timeout=60)
    assert work.returncode == 130, told
    assert told.splitlines()[-1] == INTERRUPTED and "Traceback" not in told
    assert not left_over(tmp_path)
    assert not sign or found[0].read_text(encoding="utf-8").endswith("\n")


def test_two_processes_may_reduce_one_stage(tmp_path: Path) -> None:
    tiny(tmp_path)
    both = [started(["reduce", "tiny"], tmp_path) for _ in range(2)]
    told = [work.communicate(timeout=300) for work in both]
    assert [work.returncode for work in both] == [0, 0], told
    assert {path.name for path in (tmp_path / "tiny").iterdir()} == {"stage.toml", "pinion.h5", "wheel.h5"}
    assert load_body(tmp_path / "tiny" / "wheel.h5").toothed.teeth == 19


def _no_room() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # writing more is an OSError then, as on a full disk
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


def test_a_full_disk_is_one_line_and_leaves_the_old_file(tmp_path: Path) -> None:
    table = tmp_path / "te.csv"
    table.write_text("old\n", encoding="utf-8")
    words = ["te", "fzg_c", "--torque", "100 N*m", "--positions", "40", "--out", "te.csv"]
    whole = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}  # a cut-off file of bytecode would stay and be read
    done = subprocess.run(
        [*GEARFMU, *words], cwd=tmp_path, env=whole, capture_output=True, text=True, check=False, preexec_fn=_no_room
    )
    (told,) = [line for line in done.stderr.splitlines() if line.startswith("gearfmu:")]
    assert done.returncode == 1 and "te.csv: cannot be written, File too large: make room" in told
    assert table.read_text(encoding="utf-8") == "old\n" and not left_over(tmp_path)
