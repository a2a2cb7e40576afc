"""Verbs and examples in the process of the tests: the start of another one costs a second and prepares all anew."""

from __future__ import annotations

import re
import runpy
import sys
from collections.abc import Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from types import MappingProxyType
from unittest.mock import patch

from gearfmu import cli

ROOT = Path(__file__).resolve().parents[1]


TINY = {"modes": 40, "roll_points": 8, "width_functions": 3}
TINY |= {"flank": 3, "thickness": 1, "root": 2, "rim": 1, "width": 2}


def words(line: str) -> list[str]:
    """The words of a command line; a comment ends it."""
    found = re.findall(r'"([^"]*)"|(\S+)', line.split(" #")[0])
    return [quoted or plain for quoted, plain in found]


def tiny(path: Path, counts: Mapping[str, int | None] = MappingProxyType({})) -> None:
    """A stage file with so few modes and elements that its bodies are made in a second; None: as it is."""
    text = path.read_text(encoding="utf-8")
    for key, value in (TINY | dict(counts)).items():
        text = re.sub(rf"^{key} = \d+", f"{key} = {value}", text, flags=re.MULTILINE) if value else text
    path.write_text(text, encoding="utf-8")


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
