"""An FMU in a scene: whether its stage is one for the scene, and whether its ports are those that the scene needs.

The shafts at the cut belong to the stage, so an FMU brings its own. Where their stiffness or damping differs from the
scene's, the run takes the FMU's, at its start too, and says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from gearfmu.cosim.drive import Drive
from gearfmu.errors import Problem, SpecError
from gearfmu.fmu.opened import OpenedFmu
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import PortSpec

UNITS = {"k": "N*m/rad", "c": "N*m*s/rad", "inertia": "kg*m^2", "disc_inertia": "kg*m^2"}
UNITS |= {"shaft_k": UNITS["k"], "shaft_c": UNITS["c"]}


def of_scene(scene: SceneSpec, opened: OpenedFmu, own: Stage | None = None) -> SceneSpec:
    """The scene with the stage of an FMU. own : the stage that it must be, when given; else it must be of the kind of
    the scene's stage, where that can be read. SpecError that names FMU and stage."""
    if own is not None:
        if problems := opened.problems_of(own):
            raise SpecError(problems)
        return scene
    usual = _usual(scene)
    own_kind = opened.model.stage.written.kind
    if usual is not None and (kind := usual.written.kind) != own_kind:
        remedy = (
            f"scene {scene.name} is made for a stage of kind {kind}, {scene.stage.name}: choose a scene for this "
            f"kind, or name the FMU's stage beside the FMU (--stage) to run it here all the same"
        )
        raise SpecError([Problem(str(opened.path), f"kind of stage {opened.model.name}", own_kind, remedy)])
    if usual is not None and not opened.problems_of(usual):
        return scene
    return scene.with_stage(name=opened.model.name)


def fitted(
    scene: SceneSpec, opened: OpenedFmu, drive_of: Callable[[SceneSpec, Stage], Drive]
) -> tuple[SceneSpec, tuple[str, ...]]:
    """The scene with the FMU's shafts, and in words what is other there than the scene says. drive_of : of
    `scene_run`. SpecError with every port that does not fit, and every gear that the scene records and the FMU does not
    show."""
    export = f"export it with `gearfmu export {opened.model.name} --scene SCENE`"
    recorded = scene.deformation.gears if scene.deformation is not None else ()
    problems = []
    if missing := [gear for gear in recorded if gear not in opened.observed]:
        remedy = f"scene {scene.name} records how {', '.join(missing)} moves: {export}, or with --observe {missing[0]}"
        problems.append(Problem(str(opened.path), "observed gears", ", ".join(opened.observed) or "none", remedy))
    own: Mapping[str, PortSpec] = opened.model.stage.ports
    try:
        drive = drive_of(scene, opened.model.stage)
    except SpecError as error:
        remedy = f"stage {opened.model.name} does not fit scene {scene.name}: choose another scene or FMU"
        ports = Problem(str(opened.path), "ports", ", ".join(own), remedy)
        raise SpecError([ports, *error.problems, *problems]) from error
    wanted = {**own, **drive.ports}
    problems += [found for name in own for found in _misfits(scene, opened, name, wanted[name], export)]
    if problems:
        raise SpecError(problems)
    remarks = [text for name in own for text in _others(name, own[name], wanted[name])]
    if not remarks:
        return scene, ()
    head = f"{opened.path} keeps its own shafts, which are not those of scene {scene.name} ({export})"
    return drive.with_shafts(own) if drive.with_shafts else scene, (f"{head}: {'; '.join(remarks)}",)


def _usual(scene: SceneSpec) -> Stage | None:
    """The stage that the scene names, None where it cannot be read: a run with an FMU does not need it."""
    try:
        return load_stage(scene.stage.name)
    except SpecError:
        return None


def _misfits(scene: SceneSpec, opened: OpenedFmu, name: str, wanted: PortSpec, export: str) -> Iterator[Problem]:
    own = opened.model.stage.ports[name]
    if own.kind != wanted.kind:
        remedy = f"scene {scene.name} needs a port of kind {wanted.kind}: {export}"
        yield Problem(str(opened.path), f"ports.{name}.kind", own.kind, remedy)
    elif (own.chain is None) != (wanted.chain is None):
        remedy = f"scene {scene.name} needs a port {'without' if wanted.chain is None else 'with'} a chain: {export}"
        yield Problem(str(opened.path), f"ports.{name}.chain", "none" if own.chain is None else "there", remedy)


def _others(name: str, own: PortSpec, wanted: PortSpec) -> Iterator[str]:
    """Numbers of a spring port, with its chain, that differ."""
    if own.kind != "spring":
        return
    for field, unit in UNITS.items():
        first, second = (getattr(port, field, None) or getattr(port.chain, field, 0.0) for port in (own, wanted))
        if first != second:
            yield f"ports.{name}.{field} {first:g} {unit}, in the scene {second:g} {unit}"
