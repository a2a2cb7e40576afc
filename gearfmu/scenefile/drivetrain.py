"""Drivetrains a stage can be run in: the passenger car and the test rig. Each value with unit, meaning and source,
declared once; docs are made from it."""

from __future__ import annotations

from typing import Annotated, Any

from gearfmu.stagefile.reading.base import Quantity, Spec, entry
from gearfmu.stagefile.tables.connections import Damping, Inertia, Stiffness

ASSUMED = "assumed"
Amplitude = Annotated[float, Quantity("amplitude")]


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
    engine_torque: Annotated[float, Quantity("torque")] = _value(120.0, "mean torque")
    order_2: Amplitude = _value(150.0, "torque amplitude, engine order 2 (firing order of four cylinders, four-stroke)")
    order_4: Amplitude = _value(45.0, "torque amplitude, engine order 4")
    order_6: Amplitude = _value(15.0, "torque amplitude, engine order 6")


class TestRig(Spec):
    """A drive with torque control on the pinion's shaft, a shaft of constant speed on the wheel.

    The controller adds `speed_droop` times the deviation from the nominal speed, which damps the drive.
    """

    __test__ = False  # not a test class, whatever its name

    torque: Annotated[float, Quantity("torque")] = _value(..., "mean torque of the drive on the pinion", "scene")
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
