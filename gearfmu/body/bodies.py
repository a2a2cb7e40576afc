"""The reduced bodies of a stage of any kind: their fingerprints and files, made where they are missing or stale."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from gearfmu.body.apart import Work, reduce_apart_together, side_by_side
from gearfmu.body.carrier import reduced_carrier
from gearfmu.body.interface_body import InterfaceBody, load_interface_body, save_interface_body
from gearfmu.body.layout import ALGORITHM_VERSION
from gearfmu.body.reduced import ReducedBody
from gearfmu.body.stale import refuse_stale
from gearfmu.body.store import load_body, save_body
from gearfmu.body.toothed import gear_work, reduced_gear
from gearfmu.errors import BodyError, MeshError
from gearfmu.reduction.carrier import carrier_need
from gearfmu.reduction.memory import Need
from gearfmu.spec.forms.body import body_hash, body_inputs
from gearfmu.spec.forms.members import Form, body_names, carriers, members
from gearfmu.spec.reading.library import model_folder

Body: TypeAlias = ReducedBody | InterfaceBody
Folder: TypeAlias = "str | os.PathLike[str] | None"
Progress = Callable[[str, float], None]


def expected_hash(spec: Form, name: str) -> str:
    """Fingerprint that the body `name` must carry: of its inputs and the version of the algorithms."""
    return body_hash({**body_inputs(spec, name), "algorithm_version": ALGORITHM_VERSION})


def body_hashes(spec: Form) -> tuple[str, ...]:
    """`expected_hash` of every body, in the order of `load_bodies`."""
    return tuple(expected_hash(spec, name) for name in body_names(spec))


def body_path(spec: Form, name: str, folder: Folder = None) -> Path:
    """Where a body is stored: `<folder>/<name>.h5`, the folder of the stage file when None."""
    return (Path(folder) if folder is not None else model_folder(spec)) / f"{name}.h5"


def load_bodies(spec: Form, folder: Folder = None) -> Any:
    """The stored bodies: gears in the order of the stage, then the carrier of a set. BodyError when one is missing,
    damaged or stale."""
    return [_load_current(spec, name, folder) for name in body_names(spec)]


def is_current(spec: Form, name: str, folder: Folder = None) -> bool:
    """Is the stored body sound and made from these numbers?"""
    return _current(spec, name, folder) is not None


def current_bodies(spec: Form, folder: Folder = None) -> set[str]:
    """Names of the bodies that `reduce_bodies` would read and not make."""
    return {name for name in body_names(spec) if is_current(spec, name, folder)}


def reduce_bodies(
    spec: Form, folder: Folder = None, force: bool = False, progress: Progress | None = None
) -> list[Body]:
    """Reduce what is missing or stale and store it: two large gears at the same time where processors and memory are
    there, the carrier last, which takes the most memory. Shafts need no file. Returns what `assemble` takes.

    folder : of the .h5 files, that of the stage file when None. force : reduce in any case. progress : called with
    (what is being done, share done of it). Raises MeshError and BodyError.
    """
    names = body_names(spec)
    stored = {} if force else {name: _current(spec, name, folder) for name in names}
    wanted = [name for name in names if stored.get(name) is None]
    works, paths = _works(spec, wanted), {name: body_path(spec, name, folder) for name in wanted}
    if apart := side_by_side([(works.get(name), (spec, name, paths[name])) for name in wanted]):
        reduce_apart_together(apart, progress)
    together = {name for _, name, _ in apart}
    for name in wanted:
        if name not in together:
            make_body(spec, name, paths[name], progress)
    return [stored.get(name) or _load_current(spec, name, folder) for name in names]


def reduce_apart(
    spec: Form, folder: str | os.PathLike[str], force: bool = False, progress: Progress | None = None
) -> list[Body]:
    """`reduce_bodies` of a stage that is not as its file says, into a folder of its own: bodies beside the file that
    fit are taken over, and stay."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for path in model_folder(spec).glob("*.h5"):
        if not (Path(folder) / path.name).exists():
            shutil.copy(path, folder)
    return reduce_bodies(spec, folder, force, progress)


def make_body(spec: Form, name: str, path: Path, progress: Progress | None = None) -> None:
    """Reduce one body and store it at `path`. Raises MeshError and BodyError."""
    body = reduce_body(spec, name, progress)
    if isinstance(body, InterfaceBody):
        save_interface_body(body, path)
    else:
        save_body(body, path)


def reduce_body(spec: Form, name: str, progress: Progress | None = None) -> Body:
    """One body from the numbers of its stage. Raises MeshError with the place of the body in the stage file."""
    toothed, wanted = members(spec), expected_hash(spec, name)
    try:
        if name in toothed:
            return reduced_gear(toothed[name], wanted, progress)
        return reduced_carrier(spec, wanted, progress)
    except MeshError as error:
        place = toothed[name].place if name in toothed else name
        raise MeshError(f"{spec.source}: {place}: {error}") from error


def body_needs(spec: Form) -> dict[str, Need]:
    """Memory that the reduction of every body takes, estimated from its mesh; bodies meshed elsewhere are not among
    them. Raises MeshError."""
    needs = {name: work.need for name, work in _works(spec, body_names(spec)).items()}
    return needs | {name: carrier_need(spec) for name, own in carriers(spec).items() if own.part.imported is None}


def _works(spec: Form, names: Sequence[str]) -> dict[str, Work]:
    """What the reduction of those gears takes that are meshed here."""
    chosen = {name: member for name, member in members(spec).items() if name in names}
    return {name: work for name, member in chosen.items() if (work := gear_work(member)) is not None}


def _current(spec: Form, name: str, folder: Folder) -> Body | None:
    """The stored body; None where it is missing, damaged or made from other numbers."""
    try:
        return _load_current(spec, name, folder)
    except BodyError:
        return None


def _load_current(spec: Form, name: str, folder: Folder) -> Body:
    """The stored body. Raises BodyError when it is missing, damaged or stale."""
    path = body_path(spec, name, folder)
    body: Body = load_body(path) if name in members(spec) else load_interface_body(path)
    refuse_stale(path, body, expected_hash(spec, name), spec.source)
    return body
