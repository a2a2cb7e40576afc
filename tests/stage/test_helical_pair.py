"""A helical pair in the kernel: axial force, balance of all forces and moments, the spur gear as its limit,
leads and misaligned axes."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from gearfmu.body import Body, load_bodies
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, assemble, loaded_te, simulate
from gearfmu.stage.assembly.blob import GEAR_NUMBERS, read_blob, write_blob
from gearfmu.stagefile.forms.expand import rewritten, with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import LeadSpec, Misalignment
from gearfmu.stagefile.tables.connections import PortSpec

TORQUE, SPEED = 150.0, 2000 * math.pi / 30  # N·m, rad/s of the pinion
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


@pytest.mark.parametrize("edges", [0.0, 1.0])
@pytest.mark.parametrize("torque", [TORQUE, -TORQUE])
def test_six_forces_and_moments_of_the_whole_stage_are_in_balance(
    demo: SimpleNamespace, involute: StageModel, torque: float, edges: float
) -> None:
    """Everything the bearings carry, about the pinion's axis, is what the ports bring in; also where tip edges carry,
    off the line of action."""
    kernel = at_rest(involute, torque, **{"effect.tip_contact": edges})
    (f_p, m_p), (f_w, m_w) = (support(kernel, shaft) for shaft in SHAFTS)
    arm = np.array([demo.spec.written.pair.center_distance, 0.0, 0.0])
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


def with_bearings(spec: Stage) -> Stage:
    """A spur pair whose gears may move along their axes and tilt."""
    held = {"axial": 1e8, "tilt": 1e5}
    gears = tuple(g.model_copy(update={"bearing": g.bearing.model_copy(update=held)}) for g in spec.written.gears)
    return rewritten(spec, gears=gears, ports=HELD)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_spur_gears_that_may_tilt_are_those_that_may_not(relief_spec: Stage, bodies: list[Body], level: float) -> None:
    """Nothing tilts a symmetric pair: strips with their own gaps give what halved strips give."""
    planar = assemble(with_ports(relief_spec, HELD), bodies)
    spatial = assemble(with_bearings(relief_spec), bodies)
    results = []
    for model in (planar, spatial):
        kernel = model.kernel(level=level)
        kernel.set("pinion.tau", TORQUE)
        kernel.initialize()
        for i in range(40):
            kernel.step(i * 2e-5, 2e-5)
        results.append([kernel.get(n) for n in ("mesh.te", "mesh.force", "bearing.pinion.fx", "bearing.wheel.fy")])
    print(results)
    assert results[1] == pytest.approx(results[0], rel=1e-6)


def test_helix_angle_of_nothing_is_a_spur_gear(relief_spec: Stage, bodies: list[Body]) -> None:
    """The same bodies on flanks of 1e-10 rad: the rows of the kernel go over continuously."""
    spur = assemble(with_bearings(relief_spec), bodies)
    blobs = dict(read_blob(spur.blob))
    for g, hand in enumerate((1, -1)):
        blobs[f"gear{g}"] = np.array(blobs[f"gear{g}"], float)
        blobs[f"gear{g}"][GEAR_NUMBERS.index("helix")] = hand * 1e-10
    found = []
    for blob in (spur.blob, write_blob(blobs)):
        kernel = Kernel(blob, {"level": 0.0})
        kernel.prepare()
        found.append([kernel.transmission(-0.05 * i, TORQUE).te for i in range(12)])
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def slices_at_rest(model: StageModel, torque: float, slices: int = 10) -> np.ndarray:
    """Force of every slice, all tooth pairs together, N."""
    kernel = model.kernel(**{"level": 0.0, "slices": slices, "effect.tip_contact": 0.0})
    kernel.prepare()
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
        print(np.round(turned), np.round(found[0]), np.round(found[1]))
        assert min(np.abs(f - turned).max() for f in found) < 2e-3 * even.sum(), change


@pytest.mark.parametrize("slices", [*(pytest.param(n, marks=pytest.mark.full) for n in (5.0, 10.0)), 7.0])
def test_transmission_error_is_smooth_without_a_filter(
    demo: SimpleNamespace, involute: StageModel, slices: float
) -> None:
    te = loaded_te(involute, [TORQUE], 64, slices=slices).te[0]
    harmonics = 2 * np.abs(np.fft.rfft(te)) / te.size
    print(
        f"mean {1e6 * te.mean():.2f}, peak to peak {1e6 * np.ptp(te):.3f}, above 12 {1e6 * harmonics[13:].max():.4f} µm"
    )
    assert harmonics[13:].max() < 0.05e-6


def test_mean_transmission_error_does_not_depend_on_the_number_of_slices(involute: StageModel) -> None:
    """Tip edges carry a line of contact on past the end of its flank. Cut off there, five slices differ from ten by
    0.44 %."""
    mean = [loaded_te(involute, [TORQUE], 8, slices=slices).te.mean() for slices in (5.0, 10.0)]
    print(f"{1e6 * mean[0]:.3f} and {1e6 * mean[1]:.3f} µm")
    assert mean[0] == pytest.approx(mean[1], rel=3e-3)


def test_a_slice_past_the_end_of_its_flank_carries_by_its_tip_edge(demo: SimpleNamespace, involute: StageModel) -> None:
    """At rest with the line of contact of one tooth pair ending 0.05 mm of roll before a slice begins: that slice still
    carries a part of its neighbour's load; without tip contact nothing."""
    gear, pair = demo.pair.gears[0], demo.pair
    slices, roll = 10, gear.s_tip + 0.05e-3  # at mid-width, where slice 5 begins
    turn = roll / gear.r_b - gear.psi_b - pair.alpha_wt
    carried = []
    for edges in (1.0, 0.0):
        kernel = involute.kernel(
            **{"level": 0.0, "slices": slices, "effect.tip_contact": edges, "effect.bearings": 0.0}
        )
        kernel.prepare()
        forces = kernel.transmission(-turn * gear.r_b / pair.gears[1].r_b, TORQUE).forces
        pair_forces = next(np.array(f) for f in forces.values() if f[4] > 0 and f[9] == 0 and f[0] > 0)
        print(edges, np.round(pair_forces))
        carried.append(pair_forces[5] / pair_forces[4])
    assert carried[0] > 0.1 and carried[1] == 0


@pytest.fixture(scope="module")
def undamped(demo: SimpleNamespace) -> dict[str, np.ndarray]:
    """Relief and crowning as shipped, no damping but the bearings'."""
    return steady(assemble(demo.spec, demo.bodies), **{"effect.contact_damping": 0.0, "effect.modal_damping": 0.0})


def test_forces_of_the_slices_are_outputs(
    demo: SimpleNamespace, involute: StageModel, undamped: dict[str, np.ndarray]
) -> None:
    """In motion they add up to the mesh force; at rest they are the slices that `te` finds."""
    slices = [f"mesh.slice_{k + 1}" for k in range(demo.spec.written.contact.slices)]
    assert np.stack([undamped[name] for name in slices]).sum(axis=0) == pytest.approx(undamped["mesh.force"], rel=1e-9)
    assert f"mesh.slice_{len(slices) + 1}" not in involute.kernel().variables
    kernel = at_rest(involute, TORQUE)
    shares = np.array([kernel.get(name) for name in slices])
    assert shares == pytest.approx(slices_at_rest(involute, TORQUE, len(slices)), rel=1e-3)
    assert np.ptp(shares) > 0.2 * shares.mean()


def test_energy_is_kept_in_motion(demo: SimpleNamespace, undamped: dict[str, np.ndarray]) -> None:
    """Of the energy that passes through, what the balance leaves."""
    left, through = np.abs(undamped["energy.residual"]).max(), TORQUE * SPEED * 10 * 2 * math.pi / 23 / SPEED
    print(f"{through:.0f} J passed through, left {left:.2e} J")
    assert left < 1e-5 * through
    assert undamped["mesh.force_mean"].mean() == pytest.approx(
        TORQUE / (demo.pair.gears[0].r_b * math.cos(demo.pair.gears[0].beta_b)), rel=5e-3
    )
