"""Drivetrains of own parts: bad files told at once, speeds and torques of the start against closed forms, and the
network that comes of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from analytic_stage import values

from gearfmu.cosim.network import Driven
from gearfmu.cosim.parts import Rest, Start, part_network, part_ports, start_of, start_speeds_of
from gearfmu.cosim.py_unit import PyUnit
from gearfmu.errors import SpecError
from gearfmu.scenefile.scene import SHIPPED, SceneSpec, load_scene
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import PortSpec

SHIFT = "planetary_shift"
PAIR = """
name = "two_machines"
description = "A motor drives a pair, a machine behind a shaft brakes it"
duration = "0.1 s"
[stage]
name = "fzg_c"
[coupling]
step = "20 us"
[start]
input_speed = "100 rad/s"
[drivetrain.ports.pinion]
on = "motor"
stiffness = "2e4 N*m/rad"
damping = "0.2 N*m*s/rad"
[drivetrain.ports.wheel]
on = "flange"
stiffness = "5e4 N*m/rad"
damping = "0.5 N*m*s/rad"
[drivetrain.inertias]
motor = { inertia = "0.03 kg*m^2" }
flange = { inertia = "0.01 kg*m^2" }
machine = { inertia = "0.2 kg*m^2" }
[drivetrain.shafts.half_shaft]
between = ["flange", "machine"]
stiffness = "800 N*m/rad"
[drivetrain.torques]
air_gap = { on = "motor", constant = "60 N*m" }
load = { on = "machine", proportional = { torque = "45 N*m", speed = "-66.66666666666667 rad/s" } }
"""


def ports_of(scene: SceneSpec, stage: Stage) -> dict[str, PortSpec]:
    return part_ports(scene.name, scene.drivetrain, stage)


def speeds_of(scene: SceneSpec, stage: Stage) -> dict[str, float]:
    return start_speeds_of(scene, scene.drivetrain, stage)


@pytest.fixture(scope="module")
def pair() -> Stage:
    return load_stage("fzg_c")


def scene_of(folder: Path, text: str) -> SceneSpec:
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return load_scene(folder / "scene.toml")


def test_what_a_port_does_not_say_is_the_stage_s(tmp_path: Path, pair: Stage) -> None:
    ports = ports_of(scene_of(tmp_path, PAIR.replace('stiffness = "2e4 N*m/rad"\n', "")), pair)
    assert ports["pinion"].k == pair.ports["pinion"].k and ports["pinion"].c == 0.2 and ports["wheel"].k == 5e4


def test_speeds_that_nothing_decides_or_that_contradict_each_other(tmp_path: Path, pair: Stage) -> None:
    alone = PAIR.replace("[drivetrain.shafts.half_shaft]", "[drivetrain.clutches.coupling]")
    alone = alone.replace('stiffness = "800 N*m/rad"', 'capacity = [["0 s", "5 N*m"]]')
    with pytest.raises(SpecError, match=r"drivetrain\.inertias\.machine\.speed.*nothing decides its speed"):
        speeds_of(scene_of(tmp_path, alone), pair)
    wrong = PAIR.replace('inertia = "0.2 kg*m^2"', 'inertia = "0.2 kg*m^2", speed = "66 rad/s"')
    with pytest.raises(SpecError, match="do not allow these speeds together"):
        speeds_of(scene_of(tmp_path, wrong), pair)


def rest_at(angles: dict[str, float], seen: dict[str, float]):
    """A stage that rests at these angles, and tells under which torques."""

    def rest(torques):
        seen.update(torques)
        return angles

    return rest


def test_everything_gathers_speed_together_and_shafts_carry_what_that_takes(tmp_path: Path, pair: Stage) -> None:
    """Ratio i: (J_m + (J_f + J_l)/i²) a = T_m + T_l/i; the pinion's shaft carries T_m − J_m a, the half shaft of the
    machine J_l a_l − T_l."""
    scene, seen = scene_of(tmp_path, PAIR), {}
    start = begin(scene, pair, rest_at({"pinion": 2e-3, "wheel": -1e-3}, seen))
    i, drive, load = -1.5, 60.0, 45.0
    a = (drive + load / i) / (0.03 + 0.21 / i**2)
    assert seen["pinion"] == pytest.approx(drive - 0.03 * a) and seen["wheel"] == pytest.approx(-i * seen["pinion"])
    assert start.angle["motor"] == pytest.approx(2e-3 + seen["pinion"] / 2e4)
    assert start.angle["flange"] == pytest.approx(-1e-3 + seen["wheel"] / 5e4)
    twist = 800.0 * (start.angle["machine"] - start.angle["flange"])
    assert twist == pytest.approx(load - 0.2 * a / i)
    unit = PyUnit(part_network(scene.drivetrain, start))
    unit.initialize(0.0)
    unit.hold([-seen["pinion"], -seen["wheel"]])
    found = values(unit, ["motor.a", "flange.a", "machine.a"])
    assert found.tolist() == pytest.approx([a, a / i, a / i])


def begin(scene: SceneSpec, stage: Stage, rest: Rest) -> Start:
    return start_of(scene, scene.drivetrain, stage, rest)


def brake_of(scene: SceneSpec, capacity: float, peak: float = 1.0) -> SceneSpec:
    brake = scene.drivetrain.clutches["brake"].model_copy(update={"capacity": ((0.0, capacity),), "peak": peak})
    parts = scene.drivetrain.model_copy(update={"clutches": {"brake": brake}})
    return scene.model_copy(update={"drivetrain": parts})


def test_a_brake_that_holds_carries_the_ring_and_one_that_does_not_slips() -> None:
    """The ring carries three quarters of the carrier's torque (54/72), the sun one: in balance, as the scene begins.
    With less capacity than that the brake carries what it can."""
    scene, stage = load_scene(SHIFT), load_stage("planetary54/stage_ring_port")
    seen: dict[str, float] = {}
    start = begin(scene, stage, rest_at(dict.fromkeys(stage.ports, 0.0), seen))
    assert start.speed == pytest.approx({"turbine": 85.0, "drum": 0.0, "output": 340.0, "vehicle": 340.0})
    assert seen == pytest.approx({"carrier": 200.0, "sun": -50.0, "ring": -150.0})
    assert start.angle["drum"] == pytest.approx(-150.0 / stage.ports["ring"].k) and start.ground == {"ground": 0.0}
    begin(brake_of(scene, 160.0), stage, rest_at(dict.fromkeys(stage.ports, 0.0), seen))
    assert seen["ring"] == pytest.approx(-150.0)
    begin(brake_of(scene, 100.0), stage, rest_at(dict.fromkeys(stage.ports, 0.0), seen))
    assert abs(seen["ring"]) < 150.0 and seen["carrier"] == pytest.approx(-4.0 * seen["sun"])
    begin(brake_of(scene, 100.0, peak=1.6), stage, rest_at(dict.fromkeys(stage.ports, 0.0), seen))
    assert seen["ring"] == pytest.approx(-150.0)


def test_a_port_on_the_ground_is_held_at_the_angle_its_torque_needs(tmp_path: Path) -> None:
    text = (SHIPPED / f"{SHIFT}.toml").read_text(encoding="utf-8").replace('on = "drum"', 'on = "ground"')
    text = text.replace('between = ["drum", "ground"]', 'between = ["drum", "turbine"]')
    scene, stage = scene_of(tmp_path, text), load_stage("planetary54/stage_ring_port")
    scene = brake_of(scene, 0.0)
    start = begin(scene, stage, rest_at({"carrier": 0.0, "sun": 0.0, "ring": 1e-3}, {}))
    assert start.ground == {"ground.ring": pytest.approx(1e-3 - 150.0 / stage.ports["ring"].k)}
    network = part_network(scene.drivetrain, start)
    assert network.torque_ports["ring"] == "ground.ring"
    assert isinstance(next(node for node in network.nodes if node.name == "ground.ring"), Driven)


def test_the_drivetrain_of_the_page_loads_and_starts_with_a_clutch_that_slips(tmp_path: Path, pair: Stage) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "howto-scene.md").read_text(encoding="utf-8")
    block = next(text for text in page.split("```toml\n") if text.startswith('name = "two_machines"'))
    scene, seen = scene_of(tmp_path, block.partition("```")[0]), {}
    start = begin(scene, pair, rest_at({"pinion": 0.0, "wheel": 0.0}, seen))
    i, friction = -1.5, 20.0  # N·m: the machine, slower by 26.7 rad/s, holds the flange back
    assert start.speed == pytest.approx({"motor": 100.0, "flange": 100.0 / i, "machine": -40.0})
    a = (10.0 + friction / i) / (0.03 + 0.01 / i**2)
    assert seen["pinion"] == pytest.approx(10.0 - 0.03 * a)
