"""Scenes with torques on the shafts: bad files, the laws, second order in time on a rotor with an exact solution, and
the planetary set through the coupling."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from gearfmu.body import load_bodies
from gearfmu.cosim.coupled import Plan, Result, run_coupled
from gearfmu.cosim.masters import Cut
from gearfmu.cosim.scene_run import in_drivetrain
from gearfmu.cosim.shaft_loads import Law, ShaftLoads, start_speeds
from gearfmu.cosim.units import Variable
from gearfmu.scenefile.drivetrain import ShaftLoad
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.stage import load_stage

SPEED = 85.0  # rad/s, of the carrier
PAPER = "planetary_paper"


def test_the_scene_of_the_paper_is_in_balance_at_the_start() -> None:
    """600 N·m on the carrier at 85 rad/s, −150 N·m on the sun at four times that: no power left over."""
    scene = load_scene(PAPER)
    stage = load_stage(scene.stage.name)
    speeds = start_speeds(scene, stage, "carrier")
    assert scene.duration == 0.1 and scene.start.pinion_speed == SPEED and speeds == {"carrier": 85.0, "sun": 340.0}
    power = {name: Law(load).at(0.0, speeds[name]) * speeds[name] for name, load in scene.shaft_loads.items()}
    assert power["carrier"] == 600.0 * SPEED and sum(power.values()) == pytest.approx(0.0, abs=1e-9)


def test_hashes_of_scenes_without_loads_are_those_of_before() -> None:
    """The field that is not there is not in the hash."""
    assert load_scene("pair_light").hash == "0c0c1e12c867288f57f4b04a3e32b8fb52fdb241f1c5a06bf58dcdee81f7a113"


def test_the_laws_add_up_and_their_means_are_exact() -> None:
    load = ShaftLoad(
        constant=3.0,
        over_time=((0.0, 0.0), (1.0, 10.0)),
        proportional={"torque": -4.0, "speed": 2.0},
        alternating={"amplitude": 5.0, "frequency": 0.25},
    )
    law = Law(load)
    assert law.at(0.5, 7.0) == pytest.approx(3.0 + 5.0 - 14.0 + 5.0 * math.sin(math.pi / 4.0))
    assert law.mean(0.0, 0.5, 7.0) == pytest.approx(3.0 + 2.5 - 14.0 + 20.0 / math.pi * (1.0 - math.cos(math.pi / 4.0)))
    jump = Law(ShaftLoad(over_time=((0.0, 1.0), (0.5, 1.0), (0.5, 9.0), (2.0, 9.0))))
    assert (jump.mean(0.4, 0.1, 0.0), jump.mean(0.5, 0.1, 0.0), jump.at(0.5, 0.0)) == (1.0, 9.0, 9.0)


class Rotor:
    """A stage of one inertia (kg·m²) with a torque port, moved exactly under a held torque."""

    INERTIA = 2e-3

    def __init__(self, w: float) -> None:
        self.values = {"shaft.tau": 0.0, "shaft.phi": 0.0, "shaft.w": w}

    def outputs(self) -> dict[str, Variable]:
        return {name: Variable("", "") for name in ("shaft.phi", "shaft.w")}

    def initialize(self, time: float) -> None:
        pass

    def resolve(self, names) -> list[str]:
        return list(names)

    def set(self, handle, values) -> None:
        self.values |= dict(zip(handle, map(float, values), strict=True))

    def get(self, handle) -> np.ndarray:
        return np.array([self.values[name] for name in handle])

    def step(self, time: float, h: float) -> None:
        a = self.values["shaft.tau"] / self.INERTIA
        self.values["shaft.phi"] += h * (self.values["shaft.w"] + 0.5 * a * h)
        self.values["shaft.w"] += a * h

    def log(self, names, points):
        unit, rows = self, []

        class Log:
            def take(self) -> None:
                rows.append(unit.get(names))

            def rows(self) -> np.ndarray:
                return np.array(rows)

        return Log()

    def save(self) -> dict[str, float]:
        return dict(self.values)

    def restore(self, state) -> None:
        self.values = dict(state)


def speed_at_the_end(steps: int, name: str, load: ShaftLoad, duration: float = 0.02, w: float = 100.0) -> Result:
    cut = Cut(Rotor(w), ShaftLoads({"shaft": load}, {"shaft": w}))
    return run_coupled(cut, Plan(name, duration / steps, steps))


def swung() -> tuple[ShaftLoad, float]:
    """J w' = −c w under a swing that the mean takes exactly, and w after 20 ms."""
    c, amplitude, frequency, t = 0.2, 30.0, 60.0, 0.02
    rate, omega = c / Rotor.INERTIA, 2.0 * math.pi * frequency
    swing = amplitude / Rotor.INERTIA / (rate**2 + omega**2)
    exact = (100.0 + swing * omega) * math.exp(-rate * t)
    exact += swing * (rate * math.sin(omega * t) - omega * math.cos(omega * t))
    return ShaftLoad(
        proportional={"torque": -c, "speed": 1.0}, alternating={"amplitude": amplitude, "frequency": frequency}
    ), exact


def controlled() -> tuple[ShaftLoad, float]:
    """J w' = c (w₀ + a t − w) from w₀: w = w₀ + a (t − J/c (1 − e^(−ct/J)))."""
    c, gain, t = 0.5, 400.0, 0.02
    lag = Rotor.INERTIA / c
    load = ShaftLoad(speed_control={"damping": c, "over_time": ((0.0, 100.0), (1.0, 100.0 + gain))})
    return load, 100.0 + gain * (t - lag * (1.0 - math.exp(-t / lag)))


@pytest.mark.parametrize(
    ("law", "name", "order", "limit"),
    [(swung, "gs_mean", 2, 2e-3), (swung, "jacobi", 1, 0.3), (controlled, "gs_mean", 2, 1e-3)],
)
def test_a_rotor_follows_its_exact_solution_with_the_order_of_the_master(
    law, name: str, order: int, limit: float
) -> None:
    load, exact = law()
    results = [speed_at_the_end(steps, name, load) for steps in (400, 800)]
    errors = [abs(result.trace["shaft.w"][-1] - exact) for result in results]
    assert all(result.order == order for result in results)
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15) and errors[1] < limit, errors


class Resonator(Rotor):
    """A rotor whose port is a resonance of its own: angle and speed of the port are the rotor's and those of a damped
    oscillator, both moved exactly under a held torque."""

    LIGHT, FREQUENCY, DAMPING = 1e-4, 33.3e3, 4e-3  # kg·m², Hz, of critical

    def __init__(self, w: float) -> None:
        super().__init__(w)
        self.swing = np.zeros(2)  # the port's angle and speed beside the rotor's

    def step(self, time: float, h: float) -> None:
        Rotor.step(self, time, h)
        omega, at_rest = 2.0 * math.pi * self.FREQUENCY, self.values["shaft.tau"] / self.LIGHT
        system = np.array([[0.0, 1.0, 0.0], [-(omega**2), -2.0 * self.DAMPING * omega, at_rest], [0.0, 0.0, 0.0]])
        before = self.swing
        self.swing = (expm(system * h) @ [*before, 1.0])[:2]
        self.values["shaft.phi"] += self.swing[0] - before[0]
        self.values["shaft.w"] += self.swing[1] - before[1]


def test_a_brake_does_not_feed_a_resonance_beyond_half_the_sampling_rate() -> None:
    """A brake of 0.44 N·m·s/rad at 20 µs, a resonance of the bore at 33 kHz with 0.4 % of damping. With the change of
    the last step alone carried on the resonance grows, by a factor of 9 in this run."""
    load = ShaftLoad(proportional={"torque": -0.44, "speed": 1.0}, constant=0.44 * 100.0)
    cut = Cut(Resonator(100.0), ShaftLoads({"shaft": load}, {"shaft": 100.0}))
    cut.stage.swing[1] = 1.0
    run_coupled(cut, Plan("gs_mean", 20e-6, 500))
    assert np.abs(cut.stage.swing[1]) < 0.1


def test_work_of_the_loads_is_the_kinetic_energy_gained() -> None:
    result = speed_at_the_end(50, "gs_mean", ShaftLoad(constant=3.0, alternating={"amplitude": 7.0, "frequency": 90.0}))
    gained = 0.5 * Rotor.INERTIA * (result.trace["shaft.w"][-1] ** 2 - 100.0**2)
    assert result.trace["drive.shaft.work"][-1] == pytest.approx(gained, rel=1e-12)
    assert -result.work == pytest.approx(gained, rel=1e-12) and result.throughput >= abs(gained)
    assert result.trace["drive.shaft.tau"][0] == 3.0


@pytest.fixture(scope="module")
def planetary() -> StageModel:
    spec = load_stage("planetary54")
    return assemble(in_drivetrain(load_scene(PAPER), spec), load_bodies(spec))


def test_the_scene_of_the_page_loads_and_balances(tmp_path: Path) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "howto-planetary-scenes.md").read_text(encoding="utf-8")
    (tmp_path / "my_run.toml").write_text(page.partition("```toml\n")[2].partition("```")[0], encoding="utf-8")
    loads = load_scene(tmp_path / "my_run.toml").shaft_loads
    assert Law(loads["carrier"]).at(0.0, SPEED) == 100.0 and Law(loads["sun"]).at(0.0, 4 * SPEED) == -25.0
    assert Law(loads["carrier"]).at(0.02, SPEED) == pytest.approx(400.0 + 20.0 * math.sin(2 * math.pi * 37.0 * 0.02))
