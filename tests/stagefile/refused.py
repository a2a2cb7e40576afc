"""What `load_stage` says of a file whose text was changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.stage import load_stage


def refused(folder: Path, text: str, *changes: tuple[str, str]) -> tuple[Problem, ...]:
    """All problems of `text` after the changes (before, after), each made once; written to stage.toml in `folder`."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "stage.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as error:
        load_stage(path)
    assert all(problem.file == str(path) for problem in error.value.problems)
    return tuple(error.value.problems)
