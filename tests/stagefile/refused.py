"""What `load_stage` says of a stage whose fields were changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.stage import load_stage


def problems(changes: dict[str, Any], stage: Path | str = "fzg_c") -> dict[str, Problem]:
    """All that is wrong after these changes, by field; none where the stage loads."""
    try:
        load_stage(stage, changes)
    except SpecError as error:
        assert str(error) == "\n".join(map(str, error.problems))
        return {problem.field: problem for problem in error.problems}
    return {}
