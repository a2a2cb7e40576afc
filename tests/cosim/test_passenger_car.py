"""The passenger car: its table, its masses and frequencies, firing orders, and that the cut does not move the
physics."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from analytic_stage import energy_of
from pydantic import BaseModel

from evidence.pages.drivetrain import page
from gearfmu.cosim.drive import Drive, car_drive, engine_torque, rig_drive, road_load
from gearfmu.cosim.network import Driven, Network
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.scenefile.drivetrain import PassengerCar, TestRig
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stagefile.forms.turning import Shafts

SHAFTS = Shafts("pinion", "wheel", -1.5)
CAR = PassengerCar()


@pytest.mark.parametrize("drive", [PassengerCar, TestRig])
def test_shafts_are_as_stiff_as_the_cylinders_they_are_said_to_be(drive: type[BaseModel]) -> None:
    """G π d⁴/(32 l), to two digits."""
    said = r"computed: (2 × )?solid steel, G = ([\d.]+) GPa, d = (\d+) mm, l = ([\d.]+) m"
    seen = 0
    for field in drive.model_fields.values():
        if found := re.search(said, str(field)):
            count, shear, diameter, length = 1 + bool(found[1]), *map(float, found.groups()[1:])
            stiffness = count * 1e9 * shear * math.pi * (1e-3 * diameter) ** 4 / 32 / length
            assert field.default == pytest.approx(stiffness, rel=0.02)
            seen += 1
    assert seen == (3 if drive is PassengerCar else 2)


def closure(**changes) -> SceneSpec:
    scene = load_scene("clutch_closure")
    return scene.model_copy(update={"passenger_car": CAR.model_copy(update=changes)})


def drive_of(scene: SceneSpec) -> Drive:
    return car_drive(scene, scene.passenger_car, SHAFTS)


def network_of(drive: Drive) -> Network:
    return drive.partner(lambda torques: {})


def test_docs_show_the_table():
    assert (Path(__file__).parents[2] / "docs" / "drivetrain.md").read_text(encoding="utf-8") == page(), (
        "run: make docs"
    )


def test_dual_mass_flywheel_frequency_is_what_the_table_says():
    j1, j2 = CAR.crank_inertia + CAR.dmf_primary_inertia, CAR.secondary_inertia
    omega = math.sqrt(CAR.dmf_stiffness * (1 / j1 + 1 / j2))
    assert omega / (2 * math.pi) == pytest.approx(18.0, abs=0.5)
    assert CAR.dmf_damping * omega / (2 * CAR.dmf_stiffness) == pytest.approx(0.10, abs=0.005)


def test_firing_orders_are_2_4_and_6_and_nothing_else():
    """Spectrum over whole revolutions."""
    torque, n = engine_torque(CAR), 720
    samples = np.array([torque(0.0, phi, 150.0) for phi in 2 * np.pi * np.arange(4 * n) / n])
    amplitude = np.abs(np.fft.rfft(samples)) / samples.size * 2
    orders = {k / 4: a for k, a in enumerate(amplitude) if a > 1e-9}
    assert orders == pytest.approx({0.0: 2 * CAR.engine_torque, 2.0: CAR.order_2, 4.0: CAR.order_4, 6.0: CAR.order_6})


def test_road_load_opposes_the_motion_and_vanishes_at_rest():
    load = road_load(CAR)
    assert load(0, 0, 0.0) == 0.0 and load(0, 0, 50.0) == -load(0, 0, -50.0) < 0.0
    lever, v = CAR.road_wheel_radius / CAR.final_drive_ratio, 30.0
    force = CAR.rolling_resistance * CAR.vehicle_mass * CAR.gravity + 0.5 * CAR.air_density * CAR.drag_area * v**2
    assert load(0, 0, v / lever) == pytest.approx(-force * lever, rel=1e-12)


def test_kinetic_energy_is_that_of_the_moving_vehicle():
    """Referred inertias hold the energy of mass and four road wheels at the vehicle's speed, besides final drive,
    engine, flywheel and disc."""
    scene = closure(chain_in_fmu=False)
    unit = PyUnit(network_of(drive_of(scene)))
    wheel_w = scene.start.pinion_speed / SHAFTS.ratio
    road_w = wheel_w / CAR.final_drive_ratio
    v, engine_w = road_w * CAR.road_wheel_radius, scene.start.pinion_speed + scene.start.slip
    expected = (
        0.5 * CAR.vehicle_mass * v**2
        + 4 * 0.5 * CAR.road_wheel_inertia * road_w**2
        + 0.5 * CAR.final_drive_inertia * wheel_w**2
    )
    assert energy_of(unit) == pytest.approx(
        expected
        + 0.5 * (CAR.crank_inertia + CAR.dmf_primary_inertia + CAR.secondary_inertia) * engine_w**2
        + 0.5 * CAR.disc_inertia * scene.start.pinion_speed**2,
        rel=1e-12,
    )


def test_rig_holds_speed_and_starts_twisted():
    """The brake is a driven node; the drive's torque balances at nominal speed."""
    scene = load_scene("pair_loaded")
    network = network_of(rig_drive(scene, scene.test_rig, SHAFTS))
    drive, brake = network.nodes
    assert isinstance(brake, Driven) and brake.w == pytest.approx(-drive.w / 1.5)
    rig = scene.test_rig
    assert drive.phi == pytest.approx(rig.torque * (1 / rig.pinion_shaft_stiffness + 2.25 / rig.wheel_shaft_stiffness))
    assert network.sources[0].torque(0.0, 0.0, 0.0) - rig.speed_droop * drive.w == pytest.approx(rig.torque)
