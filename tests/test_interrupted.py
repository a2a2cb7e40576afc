"""Ctrl-C in long work, two processes on one body, a disk without room: files are whole, and one line says it."""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
from verbs import tiny

from gearfmu import cli
from gearfmu.body import load_body
from gearfmu.stagefile.proposals.numbers import Wish, new_from_numbers

INTERRUPTED = "gearfmu: interrupted; files that were being written are as they were before"
LATEST = 120.0  # s until there is something to interrupt


def made_tiny(folder: Path) -> Path:
    """A pair whose bodies are made in a second."""
    path = Path(new_from_numbers("tiny", Wish((17, 19), 1e-3, 5e-3), str(folder)))
    tiny(path)
    return path


def forked(words: list[str], folder: Path, told: Path, before: Callable[[], object] = lambda: None) -> int:
    """Number of a process that runs the verb in `folder`: a fork, so that modules are not read again. What it writes
    goes to the file `told`."""
    if number := os.fork():
        return number
    code = -1
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell may have told us to ignore
        os.chdir(folder)
        with told.open("w", encoding="utf-8") as file, redirect_stdout(file), redirect_stderr(file):
            before()
            cli.main(words)
    except SystemExit as end:
        code = end.code
    finally:
        os._exit(code)


def exit_code(number: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])


def left_over(folder: Path) -> list[str]:
    """Temporary files."""
    return [path.name for path in folder.rglob(".*") if path.is_file()]


OVER = ["--over", "torque=10:300:200 N*m", "--over", "positions=4"]


@pytest.mark.parametrize(
    ("words", "file", "sign"),  # the file that shows that it is at work, and what that holds then
    [
        (["reduce", "tiny"], "told", "reducing"),
        (["sweep", "fzg_c", *OVER, "--jobs", "1", "--out", "out"], "points.jsonl", "\n"),
        pytest.param(["study", "pair_loaded", "--quick", "--out", "out"], "study.csv", "\n", marks=pytest.mark.full),
    ],
    ids=["reduce", "sweep", "study"],
)
def test_interrupted_work_is_one_line_and_whole_files(words: list[str], file: str, sign: str, tmp_path: Path) -> None:
    made_tiny(tmp_path)
    told = tmp_path / "told"
    work, end = forked(words, tmp_path, told), time.monotonic() + LATEST
    while not (found := [path for path in tmp_path.rglob(file) if sign in path.read_text("utf-8")]):
        assert os.waitpid(work, os.WNOHANG) == (0, 0) and time.monotonic() < end, "it ended by itself"
        time.sleep(0.05)
    os.kill(work, signal.SIGINT)
    assert exit_code(work) == 130
    text = told.read_text(encoding="utf-8")
    assert text.splitlines()[-1] == INTERRUPTED and "Traceback" not in text
    assert not left_over(tmp_path)
    assert found[0].read_text(encoding="utf-8").endswith("\n")


def test_two_processes_may_reduce_one_stage(tmp_path: Path) -> None:
    made_tiny(tmp_path)
    told = [tmp_path / name for name in ("one", "other")]
    both = [forked(["reduce", "tiny"], tmp_path, path) for path in told]
    assert [exit_code(work) for work in both] == [0, 0], [path.read_text(encoding="utf-8") for path in told]
    assert {path.name for path in (tmp_path / "tiny").iterdir()} == {"stage.toml", "pinion.h5", "wheel.h5"}
    assert load_body(tmp_path / "tiny" / "wheel.h5").toothed.teeth == 19


def _no_room() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # writing more is an OSError then, as on a full disk
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
    sys.dont_write_bytecode = True  # a cut-off file would stay and be read


def test_a_full_disk_is_one_line_and_leaves_the_old_file(tmp_path: Path) -> None:
    table, told = tmp_path / "te.csv", tmp_path / "told"
    table.write_text("old\n", encoding="utf-8")
    words = ["te", "fzg_c", "--torque", "100 N*m", "--positions", "40", "--out", "te.csv"]
    assert exit_code(forked(words, tmp_path, told, before=_no_room)) == 1
    (line,) = [line for line in told.read_text(encoding="utf-8").splitlines() if line.startswith("gearfmu:")]
    assert "te.csv: cannot be written, File too large: make room" in line
    assert table.read_text(encoding="utf-8") == "old\n" and not left_over(tmp_path)
