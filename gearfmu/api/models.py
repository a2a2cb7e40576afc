"""From a stage's file to its bodies and its model: load, reduce missing bodies, assemble."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeAlias

from gearfmu.body import Body, body_hashes, reduce_apart, reduce_bodies
from gearfmu.errors import Problem, SpecError
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.scenefile.scene import load_scene as load_scene_file
from gearfmu.stage import StageModel
from gearfmu.stage import assemble as assemble_model
from gearfmu.stagefile.forms.expand import with_bores, with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.reading.files import Changes, model_folder
from gearfmu.stagefile.stage import load_stage as load_stage_file
from gearfmu.stagefile.tables.connections import PortSpec

BORES = ("averaging", "rigid")
PORT_KINDS = ("spring", "torque", "fixed")
PathLike: TypeAlias = str | os.PathLike[str]
AnyStage: TypeAlias = PathLike | Stage | StageModel


class Progress(Protocol):
    """How far a long function is: called with the part done, 0 … 1, and the present task."""

    def __call__(self, fraction: float, text: str = "") -> None: ...


def load(stage: PathLike, changes: Changes | None = None) -> Stage:
    """The numbers of a stage, checked and in SI: bodies, rotors, engagements, supports and ports, in the same terms for
    a pair, a planetary set and any other; `written` holds the fields of the file of a pair or set.

    stage : path of a stage.toml or its folder, or the name of a shipped one ("fzg_c", "fzg_c/stage_relief",
        "two_stage", "planetary54").
    changes : fields that are to be other than in the file, by their dotted keys:
        {"gears.pinion.tip_relief.amount": "20 um", "contact.slices": 7}. Values as the file would say them, SI
        numbers, or None to leave a field out. The file stays as it is.

    Raises SpecError, which lists everything that is wrong.
    """
    return load_stage_file(stage, changes)


def loaded_stage(stage: PathLike | Stage) -> Stage:
    """`load`, unless it is loaded already."""
    return load(stage) if isinstance(stage, (str, os.PathLike)) else stage


def load_scene(scene: PathLike, changes: Changes | None = None) -> SceneSpec:
    """A scene: a stage in a drivetrain, with its events and duration.

    scene : path of a scene.toml or the name of a shipped one ("pair_loaded", "clutch_closure", …).
    changes : as in `load`: {"stage.level": "fast", "torque": 200.0, "speed": "1500 rpm"}; `torque` and `speed` are
        short for those of the drive and of the input at the start.

    Raises SpecError, which lists everything that is wrong.
    """
    return load_scene_file(Path(scene) if isinstance(scene, os.PathLike) else scene, changes)


def reduce(
    stage: PathLike | Stage, folder: PathLike | None = None, force: bool = False, progress: Progress | None = None
) -> list[Body]:
    """The reduced bodies of a stage, in the order of its gears; missing or stale ones are made first (about a minute
    a gear) and stored as .h5.

    folder : of the .h5 files; when None that of the stage file, or bodies_<fingerprint> beside it where `changes` ask
        for other bodies than the file.
    force : make all of them again.
    progress : called with (part of a body that is done, present task).

    Raises MeshError and BodyError.
    """
    spec = loaded_stage(stage)
    told = None if progress is None else lambda text, part: progress(part, text)
    apart = changed_folder(spec) if folder is None else None
    return reduce_bodies(spec, folder, force, told) if apart is None else reduce_apart(spec, apart, force, told)


def changed_folder(spec: Stage) -> Path | None:
    """Where the bodies of a stage lie that asks for others than its file: bodies_<fingerprint> beside it; None where
    its own will do."""
    hashes = body_hashes(spec)
    if hashes == body_hashes(load(spec.source)):
        return None
    return model_folder(spec) / f"bodies_{hashlib.sha256(''.join(hashes).encode()).hexdigest()[:12]}"


def assemble(
    stage: PathLike | Stage,
    ports: Mapping[str, str] | None = None,
    bore: str | None = None,
    observe: Sequence[str] = (),
    folder: PathLike | None = None,
    progress: Progress | None = None,
) -> StageModel:
    """The model of a stage that everything else runs, from its reduced bodies; missing ones are made (`reduce`).

    ports : other kinds of port than the file's: {"pinion": "torque"}; kinds are spring, torque, fixed.
    bore : coupling of every bore, "averaging" or "rigid"; as the file says when None. Bodies that are not the stage's
        own lie in the folder bores_<coupling> beside it.
    observe : gears whose rigid motion and modal amplitudes are outputs.
    folder, progress : as in `reduce`.

    Raises SpecError, MeshError, BodyError, ModelError.
    """
    spec, bodies = reduced_to_move(stage, bore, folder, progress)
    return assemble_model(with_port_kinds(spec, ports or {}), bodies, observe=observe)


def reduced_to_move(
    stage: PathLike | Stage, bore: str | None = None, folder: PathLike | None = None, progress: Progress | None = None
) -> tuple[Stage, list[Body]]:
    """The stage with these bores, and its bodies, for `assemble`. SpecError, before anything is reduced,
    for a set that does not say all that it needs to move."""
    spec = loaded_stage(stage)
    spec.require_motion()
    coupled = spec if bore is None else with_other_bores(spec, bore)
    return coupled, reduce(coupled, folder or bodies_folder(spec, bore), progress=progress)


def model_of(stage: AnyStage) -> StageModel:
    """`assemble`, unless it is a model already."""
    return stage if isinstance(stage, StageModel) else assemble(stage)


def bodies_folder(spec: Stage, bore: str | None) -> Path | None:
    """Where `assemble` looks for bodies with these bores: None for the folder of the stage file."""
    if bore is None or with_other_bores(spec, bore) == spec:
        return None
    return model_folder(spec) / f"bores_{bore}"


def with_other_bores(spec: Stage, coupling: str) -> Stage:
    """`with_bores`, "averaging" or "rigid"; SpecError for any other word."""
    if coupling not in BORES:
        raise SpecError([Problem(str(spec.source), "bore", coupling, f"choose {' or '.join(BORES)}")])
    return with_bores(spec, coupling)


def with_port_kinds(spec: Stage, kinds: Mapping[str, str]) -> Stage:
    """The stage with the ports' kinds replaced; SpecError for a port it does not have and for a spring without k and
    c."""
    changed: dict[str, PortSpec] = {}
    problems = []
    for name, kind in kinds.items():
        port = spec.ports.get(name)
        if kind not in PORT_KINDS:
            remedy = f"there are the kinds {', '.join(PORT_KINDS)}"
            problems.append(Problem(str(spec.source), f"ports.{name}.kind", kind, remedy))
        elif port is None:
            problems.append(Problem(str(spec.source), "ports", name, f"the stage has {', '.join(spec.ports)}"))
        elif kind == "spring" and port.k is None:
            problems.append(Problem(str(spec.source), f"ports.{name}", "spring", "write k and c into this table"))
        else:
            chain = port.chain if kind == "spring" else None
            changed[name] = port.model_copy(update={"kind": kind, "chain": chain})
    if problems:
        raise SpecError(problems)
    return with_ports(spec, changed)
