"""A helical pair in the kernel: axial force, balance of all forces and moments, hands, the spur gear as its limit,
leads and misaligned axes."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from gearfmu.body import load_stage_bodies
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.spec.ports import PortSpec
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.stage import StageModel, Steady, assemble, simulate

TORQUE, SPEED = 150.0, 2000 * math.pi / 30  # N·m, rad/s of the pinion
HELD = {"pinion": PortSpec(kind="torque"), "wheel": PortSpec(kind="fixed")}
SHAFTS = ("pinion", "wheel")


@pytest.fixture(scope="module")
def demo() -> SimpleNamespace:
    spec = load_stage("helical_demo")
    return SimpleNamespace(spec=spec, pair=PairGeometry.of(spec), bodies=load_stage_bodies(spec))


def plain(spec: StageSpec, **pair: object) -> StageSpec:
    """Without profile and lead modification, the pinion under a given torque, the wheel held."""
    gears = tuple(gear.model_copy(update={"tip_relief": None, "lead": None}) for gear in spec.gears)
    return spec.model_copy(update={"gears": gears, "ports": HELD, "pair": spec.pair.model_copy(update=pair)})


@pytest.fixture(scope="module")
def involute(demo: SimpleNamespace) -> StageModel:
    return assemble(plain(demo.spec), demo.bodies)


def at_rest(model: StageModel, torque: float, **parameters: float) -> Kernel:
    kernel = model.kernel(**{"level": 1.0, "effect.tip_contact": 0.0} | parameters)
    kernel.set("pinion.tau", torque)
    kernel.initialize()
    return kernel


def support(kernel: Kernel, shaft: str) -> tuple[np.ndarray, np.ndarray]:
    """Force (3,) N and moment (3,) N·m of a gear on its bearing, about its mid-width."""
    force = [kernel.get(f"bearing.{shaft}.f{axis}") for axis in "xyz"]
    return np.array(force), np.array([*(kernel.get(f"bearing.{shaft}.m{axis}") for axis in "xy"), 0.0])


@pytest.mark.parametrize("torque", [TORQUE, 20.0, -TORQUE])
def test_axial_force_is_the_tangential_one_times_tan_beta(
    demo: SimpleNamespace, involute: StageModel, torque: float
) -> None:
    """On drive and coast flanks; the right-handed pinion that drives is pushed towards −z … the wheel the other way."""
    kernel = at_rest(involute, torque)
    gear = demo.pair.gears[0]
    tangential = torque / (gear.m_t * gear.z / 2)
    (pinion, _), (wheel, _) = (support(kernel, shaft) for shaft in SHAFTS)
    normal = abs(torque) / (gear.r_b * math.cos(gear.beta_b))
    print(f"F_t {tangential:.3f} N, axial {pinion[2]:.4f} N, F_t tan β {tangential * math.tan(gear.beta):.4f} N")
    assert abs(kernel.get("mesh.force")) == pytest.approx(normal, rel=1e-6)
    assert pinion[2] == pytest.approx(tangential * math.tan(gear.beta), rel=1e-6)
    assert wheel[2] == pytest.approx(-pinion[2], rel=1e-6)


@pytest.mark.parametrize("torque", [TORQUE, -TORQUE])
def test_six_forces_and_moments_of_the_whole_stage_are_in_balance(
    demo: SimpleNamespace, involute: StageModel, torque: float
) -> None:
    """Everything the bearings carry, about the pinion's axis, is what the ports bring in."""
    kernel = at_rest(involute, torque)
    (f_p, m_p), (f_w, m_w) = (support(kernel, shaft) for shaft in SHAFTS)
    arm = np.array([demo.spec.pair.center_distance, 0.0, 0.0])
    at_p, at_w = (np.array([kernel.get(f"{shaft}.gear.{axis}") for axis in "xyz"]) for shaft in SHAFTS)
    moment = m_p + m_w + np.cross(at_p, f_p) + np.cross(arm + at_w, f_w)
    outside = np.array([0.0, 0.0, torque - kernel.get("wheel.tau")])
    scale = np.abs(f_p).max()
    print("forces", f_p, f_w, "moments", moment, outside)
    assert np.allclose(f_p, -f_w, rtol=0, atol=1e-8 * scale)
    assert np.allclose(moment, outside, rtol=0, atol=3e-5 * scale * arm[0])  # of second order in the deflection


def steady(model: StageModel, torque: float = TORQUE, **parameters: float) -> dict[str, np.ndarray]:
    """Constant speed and load for ten mesh periods, the first four left away."""
    period = 2 * math.pi / 23 / SPEED
    trace = simulate(model, Steady(model, SPEED, torque), 10 * period, period / 60, {"level": 1.0} | parameters)
    return {name: trace[name][240:] for name in trace.channels}
