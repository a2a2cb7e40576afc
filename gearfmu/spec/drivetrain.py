"""Drivetrains a stage can be run in: the passenger car and the test rig. Each value with unit, meaning and source,
declared once; docs are made from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from gearfmu.spec.base import Quantity, Spec

ASSUMED = "assumed"


def _about(meaning: str, source: str = ASSUMED) -> Any:
    """Meaning of a value and where it comes from."""
    return Field(description=meaning, json_schema_extra={"source": source})


class PassengerCar(Spec):
    """Four-cylinder car with manual gearbox: engine – dual-mass flywheel – clutch – input shaft – gear pair – output
    shaft – half shafts – wheels – vehicle.

    The gear pair is the loaded pair of the engaged gear, pinion on the input shaft. What lies behind the output shaft
    is lumped with the final drive taken as a rigid ratio: inertias, stiffnesses and torques there are referred to the
    output shaft by its square or by it, and turn with the wheel gear (negative for a pinion that turns positively).
    The gearbox's other pairs and its synchronisers are not modelled.
    """

    chain_in_fmu: Annotated[
        bool, Field(description="secondary mass, clutch and input shaft are computed inside the FMU")
    ] = True
    crank_inertia: Annotated[
        float, Quantity("kg*m^2", above=0), _about("crankshaft with rods' share, four cylinders, 2 l")
    ] = 0.05
    dmf_primary_inertia: Annotated[float, Quantity("kg*m^2", above=0), _about("dual-mass flywheel, primary mass")] = (
        0.11
    )
    dmf_stiffness: Annotated[
        float,
        Quantity("N*m/rad", above=0),
        _about("dual-mass flywheel, arc springs, linear", "assumed: 10 N·m/°, free mode at 18 Hz"),
    ] = 573.0
    dmf_damping: Annotated[
        float,
        Quantity("N*m*s/rad", at_least=0),
        _about("dual-mass flywheel, viscous substitute of its friction", "assumed: 10 % of critical"),
    ] = 1.0
    secondary_inertia: Annotated[
        float, Quantity("kg*m^2", above=0), _about("dual-mass flywheel, secondary mass, with cover and pressure plate")
    ] = 0.06
    disc_inertia: Annotated[
        float, Quantity("kg*m^2", above=0), _about("clutch disc with its share of the input shaft")
    ] = 0.006
    input_shaft_stiffness: Annotated[
        float,
        Quantity("N*m/rad", above=0),
        _about("clutch disc to pinion", "computed: solid steel, G = 79.3 GPa, d = 28 mm, l = 0.2 m"),
    ] = 2.39e4
    input_shaft_damping: Annotated[
        float, Quantity("N*m*s/rad", at_least=0), _about("input shaft with splines", "assumed: 2 % of critical")
    ] = 0.5
    output_shaft_stiffness: Annotated[
        float,
        Quantity("N*m/rad", above=0),
        _about("wheel gear to final drive", "computed: solid steel, G = 79.3 GPa, d = 30 mm, l = 0.25 m"),
    ] = 2.52e4
    output_shaft_damping: Annotated[
        float, Quantity("N*m*s/rad", at_least=0), _about("output shaft", "assumed: 2 % of critical")
    ] = 0.6
    final_drive_ratio: Annotated[float, Quantity(above=0), _about("final drive, rigid")] = 4.0
    final_drive_inertia: Annotated[
        float, Quantity("kg*m^2", above=0), _about("final drive and differential, referred to the output shaft")
    ] = 0.01
    half_shaft_stiffness: Annotated[
        float,
        Quantity("N*m/rad", above=0),
        _about("both half shafts, at the road wheels", "computed: 2 × solid steel, G = 79.3 GPa, d = 25 mm, l = 0.6 m"),
    ] = 1.01e4
    half_shaft_damping: Annotated[
        float,
        Quantity("N*m*s/rad", at_least=0),
        _about("both half shafts, at the road wheels", "assumed: 3 % of critical"),
    ] = 8.0
    road_wheel_inertia: Annotated[
        float, Quantity("kg*m^2", above=0), _about("one road wheel with tyre and brake disc")
    ] = 0.9
    road_wheel_radius: Annotated[float, Quantity("m", above=0), _about("rolling radius")] = 0.3
    tyre_slip_stiffness: Annotated[
        float,
        Quantity("N", above=0),
        _about("longitudinal force per unit slip, both driven tyres; a linear damper at the scene's initial speed"),
    ] = 1.0e5
    vehicle_mass: Annotated[float, Quantity("kg", above=0), _about("vehicle with two persons")] = 1400.0
    drag_area: Annotated[float, Quantity("m^2", at_least=0), _about("drag coefficient times frontal area")] = 0.65
    rolling_resistance: Annotated[float, Quantity(at_least=0), _about("rolling resistance coefficient")] = 0.012
    air_density: Annotated[float, Quantity("kg/m^3", at_least=0), _about("air at sea level, 15 °C", "ISO 2533")] = 1.225
    gravity: Annotated[float, Quantity("m/s^2", at_least=0), _about("standard gravity", "ISO 80000-3")] = 9.80665
    engine_torque: Annotated[float, Quantity("N*m"), _about("mean torque")] = 120.0
    order_2: Annotated[
        float,
        Quantity("N*m", at_least=0),
        _about("torque amplitude, engine order 2 (firing order of four cylinders, four-stroke)"),
    ] = 150.0
    order_4: Annotated[float, Quantity("N*m", at_least=0), _about("torque amplitude, engine order 4")] = 45.0
    order_6: Annotated[float, Quantity("N*m", at_least=0), _about("torque amplitude, engine order 6")] = 15.0


class TestRig(Spec):
    """A rig: a drive with torque control on the pinion's shaft, a shaft of constant speed on the wheel.

    The drive's controller adds `speed_droop` times the deviation from the nominal speed. It damps the drive against
    the shafts and leaves the gears alone, so that the mean torque is reached within the settling time.
    """

    __test__ = False  # not a test class, whatever its name

    torque: Annotated[float, Quantity("N*m"), _about("mean torque of the drive on the pinion", "scene")]
    drive_inertia: Annotated[float, Quantity("kg*m^2", above=0), _about("rotor of the drive")] = 0.02
    speed_droop: Annotated[
        float, Quantity("N*m*s/rad", at_least=0), _about("controller of the drive", "assumed: half of critical")
    ] = 14.0
    pinion_shaft_stiffness: Annotated[
        float,
        Quantity("N*m/rad", above=0),
        _about("drive to pinion", "computed: solid steel, G = 79.3 GPa, d = 28 mm, l = 0.24 m"),
    ] = 2.0e4
    pinion_shaft_damping: Annotated[float, Quantity("N*m*s/rad", at_least=0), _about("pinion's shaft")] = 0.2
    wheel_shaft_stiffness: Annotated[
        float,
        Quantity("N*m/rad", above=0),
        _about("wheel to the shaft of constant speed", "computed: solid steel, G = 79.3 GPa, d = 35 mm, l = 0.23 m"),
    ] = 5.0e4
    wheel_shaft_damping: Annotated[float, Quantity("N*m*s/rad", at_least=0), _about("wheel's shaft")] = 0.5


class Row(NamedTuple):
    """One line of the table of values."""

    name: str
    meaning: str
    value: float | None
    unit: str
    source: str


def table(kind: type[PassengerCar] | type[TestRig]) -> Iterator[Row]:
    """Every value of a drivetrain in the order of declaration; None where the scene must give it."""
    for name, field in kind.model_fields.items():
        quantity = next((item for item in field.metadata if isinstance(item, Quantity)), None)
        if quantity is not None:
            yield Row(
                name,
                field.description,
                None if field.is_required() else field.default,
                quantity.unit,
                field.json_schema_extra["source"],
            )
