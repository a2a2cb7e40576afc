"""The reduced bodies of a stage of any kind: their files, made where they are missing or stale."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from gearfmu.body.apart import reduce_apart_together, side_by_side
from gearfmu.body.body import Body
from gearfmu.body.layout import FORMAT_VERSION
from gearfmu.body.sound import make_radiation, sound_path
from gearfmu.body.store import load_body, save_body
from gearfmu.body.toothed import named, reduced_gear
from gearfmu.body.whole import reduced_carrier, reduced_housing
from gearfmu.errors import BodyError, MeshError
from gearfmu.femesh.sector import gear_sector
from gearfmu.files import format_of
from gearfmu.reduction.carrier import carrier_need
from gearfmu.reduction.cyclic.modal import Progress
from gearfmu.reduction.memory import Need, gear_need
from gearfmu.stagefile.former import former_hash
from gearfmu.stagefile.forms.general import Reduced, Stage, ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.reading.files import model_folder
from gearfmu.stagefile.stored import ALGORITHMS, expected_hash
from gearfmu.stagefile.tables.housing import HousingBody

Folder: TypeAlias = "str | os.PathLike[str] | None"


def body_hashes(stage: Stage) -> tuple[str, ...]:
    """`expected_hash` of every body, in the order of `load_bodies`."""
    return tuple(expected_hash(stage, name) for name in stage.files)


def body_path(stage: Stage, name: str, folder: Folder = None) -> Path:
    """Where a body is stored: `<folder>/<name>.h5`, the folder of the stage file when None."""
    return (Path(folder) if folder is not None else model_folder(stage)) / f"{name}.h5"


def load_bodies(stage: Stage, folder: Folder = None) -> list[Body]:
    """The stored bodies: gears in the order of the stage, then the carrier of a set. BodyError when one is missing,
    damaged or stale."""
    return [_load_current(stage, name, folder) for name in stage.files]


def current_bodies(stage: Stage, folder: Folder = None) -> set[str]:
    """Names of the bodies that `reduce_bodies` would read and not make."""
    return {name for name in stage.files if _current(stage, name, folder) is not None}


def reduce_bodies(
    stage: Stage, folder: Folder = None, force: bool = False, progress: Progress | None = None
) -> list[Body]:
    """Reduce what is missing or stale and store it: two large gears at the same time where processors and memory are
    there, the carrier last, which takes the most memory. Shafts need no file. Returns what `assemble` takes.

    folder : of the .h5 files, that of the stage file when None; those of gearfmu 0.2 and 0.3 that fit are written anew
    in the format of today. force : reduce in any case. progress : called with (what is being done, share done of it).
    Raises MeshError and BodyError.
    """
    names = stage.files
    stored = {} if force else {name: _current(stage, name, folder) for name in names}
    for name, body in stored.items():
        if body is not None and format_of(path := body_path(stage, name, folder))[1] != FORMAT_VERSION:
            save_body(body, path)
    wanted = [name for name in names if stored.get(name) is None]
    paths = {name: body_path(stage, name, folder) for name in wanted}
    gears = {name: table for name in wanted if isinstance(table := stage.by_file[name], ToothedBody)}
    if apart := side_by_side([(_need(table), (stage, name, paths[name])) for name, table in gears.items()]):
        reduce_apart_together(apart, progress)
    together = {name for _, name, _ in apart}
    for name in wanted:
        if name not in together:
            make_body(stage, name, paths[name], progress)
    return [stored.get(name) or _load_current(stage, name, folder) for name in names]


def reduce_apart(
    stage: Stage, folder: str | os.PathLike[str], force: bool = False, progress: Progress | None = None
) -> list[Body]:
    """`reduce_bodies` of a stage that is not as its file says, into a folder of its own: bodies beside the file that
    fit are taken over, and stay."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for path in model_folder(stage).glob("*.h5"):
        if not (Path(folder) / path.name).exists():
            shutil.copy(path, folder)
    return reduce_bodies(stage, folder, force, progress)


def make_body(stage: Stage, name: str, path: Path, progress: Progress | None = None) -> None:
    """Reduce one body and store it at `path`, the radiation matrix of its skin beside it. Raises MeshError, BodyError
    and SoundError."""
    body = reduce_body(stage, name, progress)
    save_body(body, path)
    if body.skin is not None:
        named(progress, name)("radiation matrix of the skin", 0.9)
        make_radiation(body, sound_path(path))


def reduce_body(stage: Stage, name: str, progress: Progress | None = None) -> Body:
    """One body of a stage. Raises MeshError with the place of the body in the stage file."""
    try:
        return make(stage.by_file[name], progress)
    except MeshError as error:
        raise MeshError(f"{stage.source}: {stage.table_of(name)}: {error}") from error


def make(table: Reduced, progress: Progress | None = None) -> Body:
    """A body from its table, whatever stage it stands in. Raises MeshError and BodyError."""
    if isinstance(table, CarrierBody):
        return reduced_carrier(table, progress)
    return reduced_housing(table, progress) if isinstance(table, HousingBody) else reduced_gear(table, progress)


def body_needs(stage: Stage) -> dict[str, Need]:
    """Memory that the reduction of every body takes, estimated from its mesh; bodies meshed elsewhere are not among
    them. Raises MeshError."""
    needs = {name: _need(table) for name, table in stage.by_file.items()}
    return {name: need for name, need in needs.items() if need is not None}


def _need(table: Reduced) -> Need | None:
    if table.imported is not None or isinstance(table, HousingBody):
        return None
    if isinstance(table, CarrierBody):
        return carrier_need(table)
    return gear_need(gear_sector(gear_shape(table), table.face_width, table.body.mesh), table.body)


def _current(stage: Stage, name: str, folder: Folder) -> Body | None:
    """The stored body; None where it is missing, damaged or made from other numbers."""
    try:
        return _load_current(stage, name, folder)
    except BodyError:
        return None


def _load_current(stage: Stage, name: str, folder: Folder) -> Body:
    """The stored body; one that gearfmu 0.2 or 0.3 made from these numbers gets its hash of today. Raises BodyError
    when it is missing, damaged or stale: it says whether the program or the numbers are others."""
    path = body_path(stage, name, folder)
    body, wanted = load_body(path), expected_hash(stage, name)
    if body.how.hash == wanted:
        return body
    algorithm = ALGORITHMS[stage.by_file[name].kind]
    if body.how.hash == former_hash(stage, name):
        return replace(body, how=replace(body.how, hash=wanted, algorithm=algorithm))
    if body.how.algorithm != algorithm:
        why = f"made by version {body.how.algorithm} of the reduction, this program has version {algorithm}"
    else:
        why = f"made from other numbers than {stage.source} asks for now"
    raise BodyError(f"{path}: stale: {why}; make it again with 'gearfmu reduce STAGE'")
