"""The four tables of a scene that make a `Drive`: the only place that asks which one a scene has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gearfmu.cosim.drive import Drive
from gearfmu.cosim.drivetrain import car_drive, rig_drive
from gearfmu.cosim.parts import part_network, part_ports
from gearfmu.cosim.shaft_loads import start_speeds, torque_ports
from gearfmu.cosim.start import start_of, start_speeds_of
from gearfmu.spec.forms.expand import as_general
from gearfmu.spec.forms.general import Stage
from gearfmu.spec.forms.members import Form
from gearfmu.spec.forms.turning import Shafts, require_driven, shafts_of, with_ports
from gearfmu.spec.scene import SceneSpec
from gearfmu.spec.scenes.parts import Drivetrain
from gearfmu.spec.scenes.shaft_loads import ShaftLoad
from gearfmu.spec.tables.ports import PortSpec


def drive_of(scene: SceneSpec, stage: Stage) -> Drive:
    """The drive of a scene on this stage. SpecError where it leaves a spring port alone, or has something for a port
    that the stage does not have."""
    shafts = shafts_of(stage)
    if scene.shaft_loads is not None:
        return _loads(scene, stage, shafts, scene.shaft_loads)
    if scene.drivetrain is not None:
        return _parts(scene, stage, scene.drivetrain)
    require_driven(stage, (shafts.input, shafts.output), "a scene")
    if scene.passenger_car is not None:
        return car_drive(scene, scene.passenger_car, shafts)
    assert scene.test_rig is not None, "a scene has one of the four"
    return rig_drive(scene, scene.test_rig, shafts)


def in_drivetrain(scene: SceneSpec, spec: Form) -> Form:
    """The stage with the ports that the scene's drive needs. SpecError: `drive_of`."""
    changed: Form = with_ports(spec, dict(drive_of(scene, as_general(spec)).ports))
    return changed


def with_shafts(scene: SceneSpec, shafts: Shafts, ports: Mapping[str, PortSpec]) -> SceneSpec:
    """The scene with the stiffness and damping of a stage's ports, where its start follows from them."""
    if scene.test_rig is not None:
        ends = {"pinion_shaft": ports[shafts.input], "wheel_shaft": ports[shafts.output]}
        numbers = {f"{end}_stiffness": port.k for end, port in ends.items()}
        numbers |= {f"{end}_damping": port.c for end, port in ends.items()}
        return scene.model_copy(update={"test_rig": scene.test_rig.model_copy(update=numbers)})
    if (parts := scene.drivetrain) is not None:
        held = {
            name: part.model_copy(update={"stiffness": ports[name].k, "damping": ports[name].c})
            for name, part in parts.ports.items()
        }
        return scene.model_copy(update={"drivetrain": parts.model_copy(update={"ports": held})})
    return scene


def _loads(scene: SceneSpec, stage: Stage, shafts: Shafts, loads: dict[str, ShaftLoad]) -> Drive:
    """Torques that are functions of time and speed."""

    def start() -> dict[str, float]:
        return {f"{name}.w_start": speed for name, speed in start_speeds(scene, stage, shafts.input, loads).items()}

    return Drive(torque_ports(scene.name, loads, stage), loads, start, frequencies=_frequencies(loads))


def _parts(scene: SceneSpec, stage: Stage, parts: Drivetrain) -> Drive:
    """A drivetrain of the scene's own parts."""

    def start() -> dict[str, float]:
        speeds = start_speeds_of(scene, parts, stage)
        free = [name for name, port in stage.ports.items() if port.kind == "torque" and name not in parts.ports]
        return {f"{name}.w_start": speeds.get(f"stage.{stage.rotor_of(stage.ports[name].body)}", 0.0) for name in free}

    return Drive(
        part_ports(scene.name, parts, stage),
        lambda rest: part_network(parts, start_of(scene, parts, stage, rest)),
        start,
        watched=tuple(parts.clutches),
        frequencies=_frequencies(parts.torques),
    )


def _frequencies(loads: Mapping[str, Any]) -> tuple[float, ...]:
    return tuple(load.alternating.frequency for load in loads.values() if load.alternating is not None)
