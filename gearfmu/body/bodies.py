"""The reduced bodies of a stage, whatever its kind."""

from __future__ import annotations

import os
from typing import Any

from gearfmu.body.planetary import load_set_bodies, reduce_set
from gearfmu.body.reduce import Progress, load_stage_bodies, reduce_stage
from gearfmu.spec.planetary import PlanetarySpec


def reduce_bodies(
    spec: Any, folder: str | os.PathLike[str] | None = None, force: bool = False, progress: Progress | None = None
) -> list[Any]:
    """`reduce_stage`, or of a set `reduce_set`: what `assemble` takes."""
    if isinstance(spec, PlanetarySpec):
        return list(reduce_set(spec, folder, force, progress))
    return list(reduce_stage(spec, folder, force, progress))


def load_bodies(spec: Any, folder: str | os.PathLike[str] | None = None) -> list[Any]:
    """`load_stage_bodies`, or of a set `load_set_bodies`."""
    if isinstance(spec, PlanetarySpec):
        return list(load_set_bodies(spec, folder))
    return list(load_stage_bodies(spec, folder))
