"""The reduced bodies of a stage, whatever its kind."""

from __future__ import annotations

import os
from typing import Any

from gearfmu.body.planetary import load_set_bodies, reduce_set, set_hashes
from gearfmu.body.reduce import Progress, load_stage_bodies, reduce_stage, stage_hashes
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


def body_hashes(spec: Any) -> tuple[str, ...]:
    """Fingerprints that the bodies of a stage must carry, in the order of `load_bodies`."""
    return set_hashes(spec) if isinstance(spec, PlanetarySpec) else stage_hashes(spec)
