"""Drivetrains a stage can be run in: the passenger car and the test rig; torques on the stage's shafts, sums of laws of
time and speed; and the scene's own parts, inertias, shafts, clutches and torques round any number of the stage's ports.
Each value with unit and meaning, those of car and rig with their source too, declared once; docs are made from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import Field

from gearfmu.stagefile.reading.base import Name, Quantity, Spec, entry
from gearfmu.stagefile.tables.connections import Damping, Inertia, Stiffness

Found = Iterator[tuple[str, str, str]]  # field of the scene, value, remedy
ASSUMED, GROUND = "assumed", "ground"
Amplitude = Annotated[float, Quantity("amplitude")]
Capacity = Annotated[float, Quantity("clutch_capacity")]
Speed = Annotated[float, Quantity("speed")]
Time = Annotated[float, Quantity("time")]
Torque = Annotated[float, Quantity("torque")]


def _value(default: Any, meaning: str, source: str = ASSUMED) -> Any:
    """A value with its meaning and where it comes from; `...` where the scene must give it."""
    return entry(meaning, default, json_schema_extra={"source": source})


class PassengerCar(Spec):
    """Four-cylinder car with manual gearbox.

    The gear pair is that of the engaged gear, pinion on the input shaft. Everything behind the output shaft is referred
    to it by the rigid final drive ratio, and turns with the wheel gear. Other pairs and synchronisers are not modelled.
    """

    chain_in_fmu: bool = entry("secondary mass, clutch and input shaft are computed inside the FMU", True)
    crank_inertia: Inertia = _value(0.05, "crankshaft with rods' share, four cylinders, 2 l")
    dmf_primary_inertia: Inertia = _value(0.11, "dual-mass flywheel, primary mass")
    dmf_stiffness: Stiffness = _value(
        573.0, "dual-mass flywheel, arc springs, linear", "assumed: 10 N·m/°, free mode at 18 Hz"
    )
    dmf_damping: Damping = _value(
        1.0, "dual-mass flywheel, viscous substitute of its friction", "assumed: 10 % of critical"
    )
    secondary_inertia: Inertia = _value(0.06, "dual-mass flywheel, secondary mass, with cover and pressure plate")
    disc_inertia: Inertia = _value(0.006, "clutch disc with its share of the input shaft")
    input_shaft_stiffness: Stiffness = _value(
        2.39e4, "clutch disc to pinion", "computed: solid steel, G = 79.3 GPa, d = 28 mm, l = 0.2 m"
    )
    input_shaft_damping: Damping = _value(0.5, "input shaft with splines", "assumed: 2 % of critical")
    output_shaft_stiffness: Stiffness = _value(
        2.52e4, "wheel gear to final drive", "computed: solid steel, G = 79.3 GPa, d = 30 mm, l = 0.25 m"
    )
    output_shaft_damping: Damping = _value(0.6, "output shaft", "assumed: 2 % of critical")
    final_drive_ratio: Annotated[float, Quantity("gear_ratio")] = _value(4.0, "final drive, rigid")
    final_drive_inertia: Inertia = _value(0.01, "final drive and differential, referred to the output shaft")
    half_shaft_stiffness: Stiffness = _value(
        1.01e4, "both half shafts, at the road wheels", "computed: 2 × solid steel, G = 79.3 GPa, d = 25 mm, l = 0.6 m"
    )
    half_shaft_damping: Damping = _value(8.0, "both half shafts, at the road wheels", "assumed: 3 % of critical")
    road_wheel_inertia: Inertia = _value(0.9, "one road wheel with tyre and brake disc")
    road_wheel_radius: Annotated[float, Quantity("wheel_radius")] = _value(0.3, "rolling radius")
    tyre_slip_stiffness: Annotated[float, Quantity("tyre_stiffness")] = _value(
        1.0e5, "longitudinal force per unit slip, both driven tyres; a linear damper at the scene's initial speed"
    )
    vehicle_mass: Annotated[float, Quantity("vehicle_mass")] = _value(1400.0, "vehicle with two persons")
    drag_area: Annotated[float, Quantity("drag_area")] = _value(0.65, "drag coefficient times frontal area")
    rolling_resistance: Annotated[float, Quantity("rolling_resistance")] = _value(
        0.012, "rolling resistance coefficient"
    )
    air_density: Annotated[float, Quantity("air_density")] = _value(1.225, "air at sea level, 15 °C", "ISO 2533")
    gravity: Annotated[float, Quantity("gravity")] = _value(9.80665, "standard gravity", "ISO 80000-3")
    engine_torque: Torque = _value(120.0, "mean torque")
    order_2: Amplitude = _value(150.0, "torque amplitude, engine order 2 (firing order of four cylinders, four-stroke)")
    order_4: Amplitude = _value(45.0, "torque amplitude, engine order 4")
    order_6: Amplitude = _value(15.0, "torque amplitude, engine order 6")


class TestRig(Spec):
    """A drive with torque control on the pinion's shaft, a shaft of constant speed on the wheel.

    The controller adds `speed_droop` times the deviation from the nominal speed, which damps the drive.
    """

    __test__ = False  # not a test class, whatever its name

    torque: Torque = _value(..., "mean torque of the drive on the pinion", "scene")
    drive_inertia: Inertia = _value(0.02, "rotor of the drive")
    speed_droop: Damping = _value(14.0, "controller of the drive", "assumed: half of critical")
    pinion_shaft_stiffness: Stiffness = _value(
        2.0e4, "drive to pinion", "computed: solid steel, G = 79.3 GPa, d = 28 mm, l = 0.24 m"
    )
    pinion_shaft_damping: Damping = _value(0.2, "pinion's shaft")
    wheel_shaft_stiffness: Stiffness = _value(
        5.0e4, "wheel to the shaft of constant speed", "computed: solid steel, G = 79.3 GPa, d = 35 mm, l = 0.23 m"
    )
    wheel_shaft_damping: Damping = _value(0.5, "wheel's shaft")


class ProportionalTorque(Spec):
    """A torque that follows the speed of the shaft: `torque` at `speed`, zero at rest. A brake has the other sign than
    its speed."""

    torque: Torque = entry("torque at that speed")
    speed: Speed = entry("speed at which the shaft has this torque")

    @property
    def slope(self) -> float:
        """Torque per speed, N·m·s/rad."""
        return self.torque / self.speed


class AlternatingTorque(Spec):
    """amplitude · sin(2π frequency t)."""

    amplitude: Amplitude = entry("of the sine")
    frequency: Annotated[float, Quantity("frequency")] = entry("of the sine, which begins at zero")


class SpeedControl(Spec):
    """A drive that follows a speed over time: damping · (wanted speed − speed), on top of the other torques."""

    damping: Annotated[float, Quantity("control_damping")] = entry("torque per deviation of the speed")
    over_time: Annotated[
        tuple[tuple[Time, Speed], ...],
        Field(min_length=1, description="wanted speed: straight lines through (time, speed), constant outside"),
    ]


class ShaftLoad(Spec):
    """Torque of the outside on one shaft about +z: the sum of the given laws."""

    constant: Torque | None = entry("the same at all times", None)
    over_time: Annotated[tuple[tuple[Time, Torque], ...], Field(min_length=1)] | None = entry(
        "straight lines through (time, torque), constant outside; the same time twice jumps", None
    )
    proportional: ProportionalTorque | None = entry("follows the speed of the shaft", None)
    alternating: AlternatingTorque | None = entry("a sine of time", None)
    speed_control: SpeedControl | None = entry("follows a wanted speed over time", None)


def load_problems(loads: dict[str, ShaftLoad]) -> Found:
    """What no single field of [shaft_loads] shows."""
    if not loads:
        yield "shaft_loads", "", 'no shaft has a load: write e.g. [shaft_loads.sun] constant = "9 N*m"'
    for name, load in loads.items():
        yield from law_problems(load, f"shaft_loads.{name}")


def law_problems(load: ShaftLoad, table: str) -> Found:
    """What no single field of the torque in `table` shows."""
    laws = ShaftLoad.model_fields
    if all(getattr(load, name) is None for name in laws):
        yield table, "", f"this shaft has no torque: give one or more of {', '.join(laws)}"
    wanted = load.speed_control.over_time if load.speed_control is not None else ()
    for field, points in (("over_time", load.over_time or ()), ("speed_control.over_time", wanted)):
        yield from time_problems(points, f"{table}.{field}")
    if load.proportional is not None and load.proportional.speed == 0.0:
        yield f"{table}.proportional.speed", "0 rad/s", "a torque at rest follows no speed: write it as constant"


def time_problems(points: Sequence[tuple[float, float]], field: str) -> Found:
    """Points (time, value) that go back in time."""
    times = [time for time, _ in points]
    if any(b < a for a, b in zip(times, times[1:], strict=False)):
        yield field, "", "times must not decrease: sort the points by time"


class ClutchSpec(Spec):
    """Capacity over time: straight lines through (time, torque), constant outside; the same time twice is a jump."""

    capacity: Annotated[tuple[tuple[Time, Capacity], ...], Field(min_length=1)] = entry(
        "torque that it transmits when it slips, over time"
    )
    peak: Annotated[float, Quantity("peak")] = entry("when it sticks it holds up to this many times its capacity", 1.0)


class PortShaft(Spec):
    """The shaft between a port of the stage and a part; it belongs to the stage. What is not given is that of the
    stage's port."""

    on: Name = entry("an inertia, or ground")
    stiffness: Stiffness | None = entry("of the shaft", None)
    damping: Damping | None = entry("of the shaft", None)


class InertiaPart(Spec):
    """A rigid inertia."""

    inertia: Inertia = entry("about its axis")
    speed: Speed | None = entry("at the start; not needed where shafts or meshes lead to a known speed", None)


class ShaftPart(Spec):
    """A shaft between two inertias, or an inertia and ground."""

    between: tuple[Name, Name] = entry("its two ends: inertias, or an inertia and ground")
    stiffness: Stiffness = entry("torque per twist")
    damping: Damping = entry("torque per speed of twist", 0.0)


class ClutchPart(ClutchSpec):
    """A dry clutch between two inertias; between an inertia and ground it is a brake."""

    between: tuple[Name, Name] = entry("its two sides; slip is the first's speed less the second's")


class TorquePart(ShaftLoad):
    """A torque of the outside on one inertia: the sum of the given laws, about +z."""

    on: Name = entry("the inertia")


class Drivetrain(Spec):
    """Parts by name. A stage's port hangs on the inertia that `ports` names; ports without an entry stay as the stage
    has them, fixed or without torque."""

    ports: dict[Name, PortShaft] = entry("part on each port of the stage")
    inertias: dict[Name, InertiaPart] = entry("rigid inertias")
    shafts: dict[Name, ShaftPart] = entry("shafts between inertias", {})
    clutches: dict[Name, ClutchPart] = entry("clutches and brakes", {})
    torques: dict[Name, TorquePart] = entry("torques of the outside on inertias", {})


def drivetrain_problems(parts: Drivetrain) -> Found:
    """What no single field of [drivetrain] shows."""
    if not parts.ports:
        yield "drivetrain.ports", "", 'nothing hangs on the stage: write e.g. [drivetrain.ports.carrier] on = "engine"'
    yield from _name_problems(parts)
    for field, used, may_be_ground in _uses(parts):
        known = [*parts.inertias, *([GROUND] if may_be_ground else [])]
        if used not in known:
            yield field, f'"{used}"', f"there is no such part; there are {', '.join(known)}"
    for table in ("shafts", "clutches"):
        for name, part in getattr(parts, table).items():
            if part.between[0] == part.between[1]:
                yield f"drivetrain.{table}.{name}.between", f'"{part.between[0]}" twice', "name two different ends"
    for name, clutch in parts.clutches.items():
        yield from time_problems(clutch.capacity, f"drivetrain.clutches.{name}.capacity")
    for name, torque in parts.torques.items():
        yield from law_problems(torque, f"drivetrain.torques.{name}")


def _name_problems(parts: Drivetrain) -> Found:
    seen: dict[str, str] = {GROUND: "the ground"}
    for table in ("inertias", "shafts", "clutches", "torques"):
        for name in getattr(parts, table):
            if name in seen:
                yield f"drivetrain.{table}.{name}", "", f"the name is that of {seen[name]}: give it another"
            seen.setdefault(name, f"drivetrain.{table}.{name}")


def _uses(parts: Drivetrain) -> Iterator[tuple[str, str, bool]]:
    """Field, name of the node it uses, whether that may be the ground."""
    for port, shaft in parts.ports.items():
        yield f"drivetrain.ports.{port}.on", shaft.on, True
    for table in ("shafts", "clutches"):
        for name, part in getattr(parts, table).items():
            for end in part.between:
                yield f"drivetrain.{table}.{name}.between", end, True
    for name, torque in parts.torques.items():
        yield f"drivetrain.torques.{name}.on", torque.on, False
