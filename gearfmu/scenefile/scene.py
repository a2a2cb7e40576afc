"""SceneSpec: a stage in a drivetrain, what happens to it, for how long, how the two are coupled, and which gears are
recorded deformed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, Field

from gearfmu.errors import Problem, SpecError, near_or_all
from gearfmu.scenefile.drivetrain import (
    ClutchSpec,
    Drivetrain,
    Found,
    PassengerCar,
    ShaftLoad,
    Speed,
    TestRig,
    Time,
    drivetrain_problems,
    load_problems,
    time_problems,
)
from gearfmu.stagefile.reading.base import LaterFields, Name, Quantity, Spec, Switch, Text, entry, read_toml, validate
from gearfmu.stagefile.reading.files import Changes, changed_tables, merged_tables, shipped_stages
from gearfmu.stagefile.tables.connections import Slices

SHIPPED = Path(__file__).parent.parent / "scenes"
TORQUES = {"test_rig": "torque", "passenger_car": "engine_torque"}
SPEED = "start.pinion_speed"
DRIVES = ("passenger_car", "test_rig", "shaft_loads", "drivetrain")
Level = Literal["rigid", "fast", "standard", "full", "paper", "explicit"]
Integrator = Literal["dg4", "em", "rk45", "central"]
Contact = Literal["by_level", "line", "nodal"]
MOST_FRAMES = 2000


class DeformationChoice(Spec):
    """Gears whose rigid motion and modal amplitudes are recorded, and the frames: `times`, shown as pictures, and one
    `every` so often, shown as a film."""

    gears: Annotated[tuple[Name, ...], Field(min_length=1, description="names of gears, e.g. ring")]
    times: tuple[Time, ...] = entry("the report shows a picture of each", ())
    every: Annotated[float, Quantity("step")] | None = entry("from one frame of the film to the next", None)
    vtu: Switch = entry("also write every frame for ParaView, as .vtu with a .pvd", False)

    def film_steps(self, step: float, steps: int) -> list[int]:
        """Numbers of the communication steps (s) at whose ends the film has a frame, 0: the start."""
        if self.every is None:
            return []
        count = int(steps * step / self.every * (1 + 1e-9)) + 1
        return sorted({round(k * self.every / step) for k in range(count)})

    def picture_steps(self, step: float) -> list[int]:
        """Numbers of the communication steps (s) at whose ends a picture is taken."""
        return sorted({round(time / step) for time in self.times})


def deformation_problems(choice: DeformationChoice, step: float, duration: float) -> Found:
    """What no single field shows."""
    for k, time in enumerate(choice.times):
        if time > duration * (1 + 1e-9):
            yield f"deformation.times[{k}]", f"{time:g} s", f"must not exceed the duration, {duration:g} s"
    if not choice.times and choice.every is None:
        yield "deformation", "", 'when? write times = ["10 ms"], every = "1 ms", or both'
    if choice.every is not None and choice.every < step * (1 - 1e-9):
        yield "deformation.every", f"{choice.every:g} s", f"must not be below the communication step, {step:g} s"
    elif choice.every is not None and duration / choice.every > MOST_FRAMES:
        remedy = f"makes more than {MOST_FRAMES} frames: use {duration / MOST_FRAMES:.2g} s or more"
        yield "deformation.every", f"{choice.every:g} s", remedy


class Effects(LaterFields):
    """Effects of the stage, all on unless switched off: docs/effects.md."""

    later = ("housing",)

    elastic: Switch = True
    residual: Switch = True
    hertz: Switch = True
    coast_flank: Switch = True
    contact_damping: Switch = True
    tip_relief: Switch = True
    tip_contact: Switch = True
    bearings: Switch = True
    modal_damping: Switch = True
    roll_motion: Switch = True
    coriolis: Switch = True
    centrifugal: Switch = True
    gyroscopic: Switch = True
    flank_deviations: Switch = True
    runout: Switch = True
    friction: Switch = True
    film: Switch = True
    housing: Switch = True

    @property
    def off(self) -> tuple[str, ...]:
        """Names of those that are off."""
        return tuple(name for name, on in self if not on)


class StageChoice(Spec):
    """Which stage, and how it is computed. h = 0: the step that suits model and level; contact:
    docs/howto-nodal.md."""

    name: Text = entry('a path or the name of a shipped stage, e.g. "fzg_c/stage_relief"')
    level: Level = "standard"
    integrator: Integrator = "dg4"
    contact: Contact = "by_level"
    slices: Slices = 5
    h: Annotated[float, Quantity("internal_step")] = 0.0
    effects: Effects = Effects()


class CouplingChoice(Spec):
    """Master and communication step; micro_step: largest step of the drivetrain between evaluations of its torques, 0
    for the communication step."""

    step: Annotated[float, Quantity("step")] = entry("communication step")
    master: Literal["gs_mean", "jacobi"] = "gs_mean"
    micro_step: Annotated[float, Quantity("micro_step")] = 0.0


class StartSpec(Spec):
    """Speeds at the start; pinion_speed, also written input_speed: of the stage's input, its first port; slip: engine
    faster than the pinion by this."""

    pinion_speed: Speed = Field(validation_alias=AliasChoices("pinion_speed", "input_speed"))
    slip: Speed = 0.0


class SceneSpec(Spec):
    """A scene. Exactly one of `passenger_car`, `test_rig`, `shaft_loads` and `drivetrain`; the car needs a `clutch`.

    record : names of stage outputs and drivetrain variables, "*" and "?" as in file names. deformation : gears that
    are recorded deformed; nothing of that is computed without.
    """

    name: Name
    description: Text
    duration: Annotated[float, Quantity("duration")]
    settle: Time = 0.0
    stage: StageChoice
    coupling: CouplingChoice
    start: StartSpec
    clutch: ClutchSpec | None = None
    passenger_car: PassengerCar | None = None
    test_rig: TestRig | None = None
    shaft_loads: dict[Name, ShaftLoad] | None = None
    drivetrain: Drivetrain | None = None
    record: tuple[Text, ...] = ("*",)
    deformation: DeformationChoice | None = None

    @property
    def hash(self) -> str:
        """SHA-256, hex, over all values in SI; the text of the file does not matter."""
        values = self.model_dump()
        if not self.stage.effects.off:
            del values["stage"]["effects"]
        if self.stage.contact == "by_level":
            del values["stage"]["contact"]
        for load in (values["shaft_loads"] or {}).values():
            if load["speed_control"] is None:
                del load["speed_control"]
        for added in ("shaft_loads", "drivetrain", "deformation"):
            if values[added] is None:
                del values[added]
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()

    @property
    def chain_in_fmu(self) -> bool:
        """Whether the clutch of a passenger car is inside the stage."""
        return self.passenger_car is not None and self.passenger_car.chain_in_fmu

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.duration / self.coupling.step)

    def with_coupling(self, **changes: Any) -> SceneSpec:
        """The scene with other fields of [coupling], SI."""
        return self.model_copy(update={"coupling": self.coupling.model_copy(update=changes)})

    def with_stage(self, **changes: Any) -> SceneSpec:
        """The scene with other fields of [stage], SI."""
        return self.model_copy(update={"stage": self.stage.model_copy(update=changes)})


def shipped_scenes() -> list[str]:
    """Names of the scenes that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load_scene(path_or_name: str | Path, changes: Changes | None = None) -> SceneSpec:
    """The scene in a TOML file, or the shipped one of that name. SpecError with everything that is wrong.

    changes : fields that are to be other than in the file (`files.py`), {"stage.level": "fast"}; `torque` and `speed`
    are short for those of the drive and of the start (`full_key`).
    """
    path = scene_path(path_or_name)
    tables = read_toml(path)
    full = {full_key(tables, key, str(path)): value for key, value in (changes or {}).items()}
    if SPEED in full and isinstance(tables.get("start"), dict):
        tables["start"].pop("input_speed", None)  # its other name
    scene, problems = validate(SceneSpec, merged_tables(tables, changed_tables(SceneSpec, full)), str(path))
    if scene is not None:
        problems = [Problem(str(path), *found) for found in _problems(scene)]
    if scene is None or problems:
        raise SpecError(problems)
    return scene


def full_key(tables: Mapping[str, Any], key: str, file: str) -> str:
    """The key of a scene's field that `torque` (mean torque of the drive) or `speed` (of the input, at the start) is
    short for; any other key as it is. SpecError where the scene has no single torque of its own."""
    if key in ("speed", "start.input_speed"):
        return SPEED
    if key != "torque":
        return key
    found = next((f"{drive}.{name}" for drive, name in TORQUES.items() if drive in tables), None)
    if found is None:
        remedy = "this scene's drive has no single torque: name the field, such as shaft_loads.<port>.constant"
        raise SpecError.of(file, "torque", "", remedy)
    return found


def scene_path(path_or_name: str | Path) -> Path:
    """File of a scene. SpecError when there is none, or a stage."""
    given, shipped = Path(path_or_name), SHIPPED / f"{path_or_name}.toml"
    if given.is_file() and not {"kind", "base"} & set(read_toml(given)):
        return given
    if not given.exists() and str(path_or_name) in shipped_scenes():
        return shipped
    file = str(path_or_name)
    if given.exists() or file in shipped_stages():
        remedy = "this is a stage: name it in a scene under [stage] (docs/howto-scene.md), or use the verb simulate"
        raise SpecError.of(file, "", "", remedy)
    hint = near_or_all(file, shipped_scenes(), "shipped are", cutoff=0.6)
    raise SpecError.of(file, "", "", f"no such file and no shipped scene: {hint}")


def _problems(scene: SceneSpec) -> Found:
    """What no single field shows."""
    chosen = [key for key in DRIVES if getattr(scene, key) is not None]
    if len(chosen) != 1:
        remedy = "give exactly one of [passenger_car], [test_rig], [shaft_loads] and [drivetrain]"
        yield "", "", f"{remedy}, found {' and '.join(chosen) or 'none'}"
    if scene.passenger_car is not None and scene.clutch is None:
        yield "clutch", "", "the passenger car has a clutch: add [clutch] with its capacity"
    if scene.passenger_car is None and scene.clutch is not None:
        remedy = "only the passenger car has this clutch: remove this table, or write [drivetrain.clutches.…]"
        yield "clutch", "", remedy
    if scene.passenger_car is None and scene.start.slip:
        yield "start.slip", f"{scene.start.slip:g} rad/s", "only the passenger car's clutch slips: remove it"
    if scene.shaft_loads is not None:
        yield from load_problems(scene.shaft_loads)
    if scene.drivetrain is not None:
        yield from drivetrain_problems(scene.drivetrain)
    if scene.clutch is not None:
        yield from time_problems(scene.clutch.capacity, "clutch.capacity")
        if scene.clutch.peak != 1.0 and scene.chain_in_fmu:
            remedy = "the clutch inside the FMU has no peak: remove it, or set passenger_car.chain_in_fmu = false"
            yield "clutch.peak", f"{scene.clutch.peak:g}", remedy
    yield from _time_problems(scene)
    if scene.deformation is not None:
        yield from deformation_problems(scene.deformation, scene.coupling.step, scene.duration)


def _time_problems(scene: SceneSpec) -> Found:
    step, micro, duration = scene.coupling.step, scene.coupling.micro_step, scene.duration
    if scene.settle >= duration:
        yield "settle", f"{scene.settle:g} s", f"must be shorter than the duration, {duration:g} s"
    if step > duration:
        yield "coupling.step", f"{step:g} s", f"must not exceed the duration, {duration:g} s"
    elif abs(scene.steps * step - duration) > 1e-9 * duration:
        remedy = f"the duration, {duration:g} s, must be a whole number of steps: use {duration / scene.steps:.6g} s"
        yield "coupling.step", f"{step:g} s", remedy
    if micro > step:
        yield "coupling.micro_step", f"{micro:g} s", f"must not exceed the communication step, {step:g} s"
