"""A helical pair in the kernel: axial force, leads and misaligned axes, tip edges."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from driven import begun

from gearfmu.body import Body, load_bodies
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import LeadSpec
from gearfmu.stagefile.tables.connections import Misalignment, PortSpec

TORQUE = 150.0  # N·m on the pinion
HELD = {"pinion": PortSpec(kind="torque"), "wheel": PortSpec(kind="fixed")}
SHAFTS = ("pinion", "wheel")


@pytest.fixture(scope="module")
def demo() -> SimpleNamespace:
    spec = load_stage("helical_demo")
    return SimpleNamespace(spec=spec, pair=spec.written.geometry, bodies=load_bodies(spec))


def plain(spec: Stage, **pair: object) -> Stage:
    """Without profile and lead modification, the pinion under a given torque, the wheel held."""
    gears = tuple(gear.model_copy(update={"tip_relief": None, "lead": None}) for gear in spec.written.gears)
    return rewritten(spec, gears=gears, ports=HELD, pair=spec.written.pair.model_copy(update=pair))


@pytest.fixture(scope="module")
def involute(demo: SimpleNamespace) -> StageModel:
    return assemble(plain(demo.spec), demo.bodies)


def at_rest(model: StageModel, torque: float, **parameters: float) -> Kernel:
    return begun(model.kernel(**{"level": 1.0, "effect.tip_contact": 0.0} | parameters), {"pinion.tau": torque})


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
    assert abs(kernel.get("mesh.force")) == pytest.approx(normal, rel=1e-6)
    assert pinion[2] == pytest.approx(tangential * math.tan(gear.beta), rel=1e-6)
    assert wheel[2] == pytest.approx(-pinion[2], rel=1e-6)


def with_bearings(spec: Stage) -> Stage:
    """A spur pair whose gears may move along their axes and tilt."""
    held = {"axial": 1e8, "tilt": 1e5}
    gears = tuple(g.model_copy(update={"bearing": g.bearing.model_copy(update=held)}) for g in spec.written.gears)
    return rewritten(spec, gears=gears, ports=HELD)


def slices_at_rest(model: StageModel, torque: float, slices: int = 10) -> np.ndarray:
    """Force of every slice, all tooth pairs together, N."""
    kernel = statics_of(model, **{"slices": slices, "effect.tip_contact": 0.0})
    forces = kernel.transmission(0.0, torque).forces
    return np.sum([of_pair for (flank, _), of_pair in forces.items() if flank == 0], axis=0)


def test_lead_and_misalignment_load_one_end(relief_spec: Stage, bodies: list[Body]) -> None:
    """A helix slope of f over the face width opens one end of the flanks as much as axes out of parallel that are
    turned about the direction across the line of action; the other end carries more."""
    spec = with_bearings(relief_spec)
    width, f = spec.written.gears[0].face_width, 20e-6
    alpha = spec.written.geometry.alpha_wt

    def slope(value: float) -> Stage:
        gears = (spec.written.gears[0].model_copy(update={"lead": LeadSpec(slope=value)}), spec.written.gears[1])
        return rewritten(spec, gears=gears)

    def misaligned(**errors: float) -> Stage:
        pair = spec.written.pair.model_copy(update={"misalignment": Misalignment(span=width, **errors)})
        return rewritten(spec, pair=pair)

    even = slices_at_rest(assemble(spec, bodies), TORQUE)
    turned = slices_at_rest(assemble(slope(f), bodies), TORQUE)
    assert np.allclose(even, even[::-1], rtol=1e-6)
    assert turned.sum() == pytest.approx(even.sum(), rel=1e-3)
    assert turned[-1] > 1.2 * even[-1] and turned[0] < 0.8 * even[0]
    assert np.allclose(slices_at_rest(assemble(slope(-f), bodies), TORQUE), turned[::-1], rtol=1e-6)
    for change, share in (("out_of_plane", math.cos(alpha)), ("in_plane", math.sin(alpha))):
        found = [slices_at_rest(assemble(misaligned(**{change: sign * f / share}), bodies), TORQUE) for sign in (1, -1)]
        assert min(np.abs(f - turned).max() for f in found) < 2e-3 * even.sum(), change


def test_a_slice_past_the_end_of_its_flank_carries_by_its_tip_edge(demo: SimpleNamespace, involute: StageModel) -> None:
    """At rest with the line of contact of one tooth pair ending 0.05 mm of roll before a slice begins: that slice still
    carries a part of its neighbour's load; without tip contact nothing."""
    gear, pair = demo.pair.gears[0], demo.pair
    slices, roll = 10, gear.s_tip + 0.05e-3  # at mid-width, where slice 5 begins
    turn = roll / gear.r_b - gear.psi_b - pair.alpha_wt
    carried = []
    for edges in (1.0, 0.0):
        kernel = statics_of(involute, **{"slices": slices, "effect.tip_contact": edges, "effect.bearings": 0.0})
        forces = kernel.transmission(-turn * gear.r_b / pair.gears[1].r_b, TORQUE).forces
        pair_forces = next(np.array(f) for f in forces.values() if f[4] > 0 and f[9] == 0 and f[0] > 0)
        carried.append(pair_forces[5] / pair_forces[4])
    assert carried[0] > 0.1 and carried[1] == 0
