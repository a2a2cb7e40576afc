"""What a stage is: a new one, its effects, its modes, its efficiency."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypedDict, cast

from typing_extensions import Unpack

from gearfmu.api.models import AnyStage, PathLike, assemble, loaded_stage, model_of, reduce
from gearfmu.api.settings import Quantity, Settings, checked, in_si
from gearfmu.errors import Problem, SpecError
from gearfmu.modes.bodies import body_modes, gear_modes
from gearfmu.modes.linear import StageModes, stage_modes
from gearfmu.modes.shapes import BodyModes
from gearfmu.stage.effects import EFFECTS, Effect
from gearfmu.stage.run.bearings import Bearings, stage_bearings
from gearfmu.stage.run.efficiency import Efficiency, mesh_efficiency
from gearfmu.stage.run.limits import largest_torque
from gearfmu.stage.run.steady import parameters
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.proposals.numbers import new_from_numbers, wish_of

_UNITS = {"module": "m", "width": "m", "center": "m", "helix": "rad", "pressure_angle": "rad", "torque": "N*m",
          "speed": "rad/s", "relief": "m"}  # fmt: skip


class Numbers(TypedDict, total=False):
    """Numbers of a new stage, as those of `gearfmu new`: quantities as text with their unit, or SI."""

    teeth: tuple[int, ...]
    module: Quantity
    diametral_pitch: float
    width: Quantity
    planets: int
    unequal: bool
    center: Quantity
    helix: Quantity
    pressure_angle: Quantity
    torque: Quantity
    speed: Quantity
    shifts: tuple[float, ...]
    bores: tuple[Quantity, ...]
    relief: Quantity


def new(name: str, like: str | None = None, folder: PathLike = ".", **numbers: Unpack[Numbers]) -> Path:
    """Write folder/name/stage.toml, every field commented, and return its path; never overwrites.

    like : shipped stage to copy, "fzg_c" when neither this nor numbers are given.
    numbers : gf.new("mine", teeth=(31, 73), module="2.5 mm", width="30 mm"); everything else is proposed and marked so.
        diametral_pitch, in 1/inch, in place of the module.

    Raises SpecError, which lists everything that is wrong.
    """
    if not numbers:
        return new_stage(name, like or "fzg_c", folder)
    if like is not None:
        raise SpecError([Problem("", "like", like, "a copy or numbers, not both")])
    return new_from_numbers(name, wish_of(_in_si(numbers)), folder)


def _in_si(numbers: Numbers) -> dict[str, object]:
    given = cast(Mapping[str, Quantity], numbers)
    found: dict[str, object] = {key: in_si(value, _UNITS[key]) for key, value in given.items() if key in _UNITS}
    if "bores" in numbers:
        found["bores"] = tuple(in_si(bore, "m") for bore in numbers["bores"])
    return {**given, **found}


def effects() -> tuple[Effect, ...]:
    """All effects: name, formula, when each matters, how to switch it. `gearfmu effects STAGE` prints the numbers of a
    stage."""
    return EFFECTS


def efficiency(
    stage: AnyStage, torque: Quantity, speed: Quantity, pitches: int = 8, **settings: Unpack[Settings]
) -> Efficiency:
    """What the meshes lose to friction in a run at constant load, beside P µ H_V (ISO/TR 14179-2).

    stage, settings : as in `simulate`. torque, speed : of the input. pitches : whole ones of the slowest mesh.
    """
    model = model_of(stage)
    asked = checked("torque", torque, "torque"), checked("speed", speed, "speed")
    return mesh_efficiency(model, *asked, parameters(model, settings), pitches=pitches)


def bearings(stage: PathLike | Stage, torque: Quantity | None = None) -> Bearings:
    """The rolling bearings of a stage under load: forces, displacements, contact pressure, stiffness, ball pass.

    stage : a name or path, or a `load`ed stage. torque : of the input, that of [operating] in its file when None.

    Raises ModelError for a stage without rolling bearings, and where one cannot carry its load.
    """
    spec = loaded_stage(stage)
    return stage_bearings(spec, reduce(spec), None if torque is None else checked("torque", torque, "torque"))


def modes(
    stage: PathLike | Stage, body: str | None = None, torque: Quantity | None = None, count: int = 20
) -> StageModes | BodyModes:
    """Natural frequencies: of the stage linearised in loaded contact, or of one of its bodies.

    stage : a name or path, or a `load`ed stage. body : a gear, "ring", "carrier"; the whole stage when None.
    torque : of the input, the largest that torque_max allows when None; bodies have none.

    Of a stage StageModes: frequency (positions, count) Hz, damping_ratio, shares of the energy; of a body BodyModes
    with shapes. Raises SpecError for a body that there is not.
    """
    spec = loaded_stage(stage)
    if body is None:
        bodies, model = reduce(spec), assemble(spec)
        asked = largest_torque(model) if torque is None else checked("torque", torque, "torque")
        return stage_modes(model, bodies, asked, count)
    names = spec.files
    if body not in names:
        raise SpecError([Problem(str(spec.source), "body", body, f"the stage has {', '.join(names)}")])
    if spec.carriers or body in {housing.name for housing in spec.housings}:
        return body_modes(spec, body, count)
    return gear_modes(spec, reduce(spec)[names.index(body)], count)
