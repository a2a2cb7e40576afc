"""Verbs and examples in the process of the tests: the start of another one costs a second and prepares all anew."""

from __future__ import annotations

import runpy
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from unittest.mock import patch

from gearfmu import cli

ROOT = Path(__file__).resolve().parents[1]


def call(*arguments: object) -> tuple[int, str, str]:
    """Exit code of the command line, with what it wrote to standard output and to standard error."""
    with redirect_stdout(_text()) as out, redirect_stderr(_text()) as err:
        code = cli.outcome([str(argument) for argument in arguments])
    return code, _written(out), _written(err)


def example(name: str, *arguments: object, cwd: Path) -> str:
    """Standard output of a script of examples/ in that folder."""
    script = str(ROOT / "examples" / name)
    with chdir(cwd), patch.object(sys, "argv", [script, *map(str, arguments)]), redirect_stdout(_text()) as out:
        runpy.run_path(script, run_name="__main__")
    return _written(out)


def _text() -> TextIOWrapper:
    return TextIOWrapper(BytesIO(), encoding="utf-8", write_through=True)


def _written(stream: TextIOWrapper) -> str:
    buffer = stream.buffer
    assert isinstance(buffer, BytesIO)
    return buffer.getvalue().decode()
