"""The reduced bodies of a stage, whatever its kind."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from gearfmu.body.planetary import is_current_in_set, load_set_bodies, reduce_set, set_hashes
from gearfmu.body.reduce import (
    Progress,
    gear_geometry,
    gear_work,
    gears_of,
    is_current,
    load_stage_bodies,
    reduce_stage,
    stage_hashes,
)
from gearfmu.geometry.planetary import set_geometry
from gearfmu.reduction.carrier import carrier_need
from gearfmu.reduction.memory import Need
from gearfmu.spec.library import model_folder
from gearfmu.spec.planetary import PlanetarySpec
from gearfmu.spec.planetary_body import SET_BODIES


def reduce_bodies(
    spec: Any, folder: str | os.PathLike[str] | None = None, force: bool = False, progress: Progress | None = None
) -> list[Any]:
    """`reduce_stage`, or of a set `reduce_set`: what `assemble` takes."""
    if isinstance(spec, PlanetarySpec):
        return list(reduce_set(spec, folder, force, progress))
    return list(reduce_stage(spec, folder, force, progress))


def reduce_apart(
    spec: Any, folder: str | os.PathLike[str], force: bool = False, progress: Progress | None = None
) -> list[Any]:
    """`reduce_bodies` of a stage that is not as its file says, into a folder of its own: bodies beside the file that
    fit are taken over, and stay."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for path in model_folder(spec).glob("*.h5"):
        if not (Path(folder) / path.name).exists():
            shutil.copy(path, folder)
    return reduce_bodies(spec, folder, force, progress)


def current_bodies(spec: Any, folder: str | os.PathLike[str] | None = None) -> set[str]:
    """Names of the bodies that `reduce_bodies` would read and not make."""
    if isinstance(spec, PlanetarySpec):
        return {name for name in SET_BODIES if is_current_in_set(spec, name, folder)}
    return {own.gears[index].name for own, index in gears_of(spec) if is_current(own, index, folder)}


def load_bodies(spec: Any, folder: str | os.PathLike[str] | None = None) -> list[Any]:
    """`load_stage_bodies`, or of a set `load_set_bodies`."""
    if isinstance(spec, PlanetarySpec):
        return list(load_set_bodies(spec, folder))
    return list(load_stage_bodies(spec, folder))


def body_needs(spec: Any) -> dict[str, Need]:
    """Memory that the reduction of every body takes, estimated from its mesh; bodies meshed elsewhere are not among
    them. Raises MeshError."""
    if isinstance(spec, PlanetarySpec):
        works = {gear.name: gear_work(gear, set_geometry(spec, gear.name)) for gear in spec.gears}
        own = {} if spec.carrier.imported is not None else {"carrier": carrier_need(spec)}
    else:
        works = {stage.gears[i].name: gear_work(stage.gears[i], gear_geometry(stage, i)) for stage, i in gears_of(spec)}
        own = {}
    return {name: work.need for name, work in works.items() if work is not None} | own


def body_hashes(spec: Any) -> tuple[str, ...]:
    """Fingerprints that the bodies of a stage must carry, in the order of `load_bodies`."""
    return set_hashes(spec) if isinstance(spec, PlanetarySpec) else stage_hashes(spec)
