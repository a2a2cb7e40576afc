"""Reduced gears of a general stage: stored beside its file as `<gear name>.h5`, and reused whenever the gear is the
same, whatever stage it came from."""

from __future__ import annotations

import os
from pathlib import Path

from gearfmu.body.reduce import Progress, body_path, load_stage_bodies, reduce_stage
from gearfmu.body.reduced import ReducedBody
from gearfmu.spec.general import GeneralStage, gear_as_pair
from gearfmu.spec.library import model_folder


def load_general_bodies(stage: GeneralStage, folder: str | os.PathLike[str] | None = None) -> list[ReducedBody]:
    """The stored bodies in the order of `stage.gears`. Raises BodyError when one is missing, damaged or stale."""
    return [load_stage_bodies(gear_as_pair(stage, gear.name), _home(stage, folder))[0] for gear in stage.gears]


def reduce_general(
    stage: GeneralStage,
    folder: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> list[ReducedBody]:
    """Reduce every gear and store it; a stored body whose input hash matches is read instead. Shafts need no file.

    folder, force, progress : as in `reduce_stage`. Raises MeshError and BodyError.
    """
    home = _home(stage, folder)
    return [reduce_stage(gear_as_pair(stage, gear.name), home, force, progress)[0] for gear in stage.gears]


def general_body_path(stage: GeneralStage, gear: str, folder: str | os.PathLike[str] | None = None) -> Path:
    """Where the body of a gear lies."""
    return body_path(gear_as_pair(stage, gear), 0, _home(stage, folder))


def _home(stage: GeneralStage, folder: str | os.PathLike[str] | None) -> Path:
    return Path(folder) if folder is not None else model_folder(stage)
