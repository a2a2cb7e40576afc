"""Helical planetary sets of rigid bodies on an elastic foundation of teeth, by hand: axial forces, balance of all
forces and moments, the moment that tilts a planet on its pin, both hands, the spur set as the limit, load sharing; and
the shipped one of finite elements, at rest and in motion."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from rigid_set import SPRINGS, Rigid, RigidSet
from slices import by_functions_alone

from gearfmu.body import load_bodies
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.run.te import TeResult, loaded_te
from gearfmu.stagefile.stage import load_stage

BETA, TORQUE, SLICES, WIDTH, STEEL = math.radians(20), 300.0, 6, 30e-3, 2.06e11
SUPPORTS = ("bearing.sun", "bearing.ring", "bearing.carrier")
FOUNDATION = SPRINGS | {"slices": float(SLICES), "effect.tip_contact": 1.0}
HELICAL = RigidSet(3, contact_ratio=1.4, helix_angle=BETA, width=WIDTH, slices=SLICES, functions=SLICES)
SETS = {
    "three": HELICAL,
    "six": replace(HELICAL, planets=6, teeth=(37, 23)),
    "other hand": replace(HELICAL, helix_angle=-BETA),
}
BESIDE = {"three": (2.2e-3, 3.2e-3), "six": (4e-3, 8e-3)}  # of a moment by middles of slices
BOTH = pytest.mark.parametrize("name", ["three", pytest.param("six", marks=pytest.mark.full)])


@lru_cache(maxsize=8)
def at_rest(name: str, torque: float) -> Kernel:
    """Static equilibrium under torques on carrier and sun."""
    rigid = SETS[name]
    kernel = rigid.model().kernel(**FOUNDATION)
    kernel.set("carrier.tau", torque)
    kernel.set("sun.tau", -torque / rigid.ratio)
    kernel.initialize()
    return kernel


def wrench(kernel: Kernel, name: str) -> np.ndarray:
    """Force (3,) N and moment (2,) N·m across the axis, on what holds the body."""
    return np.array([kernel.get(f"{name}.{component}") for component in ("fx", "fy", "fz", "mx", "my")])


def tangential(rigid: RigidSet, torque: float = TORQUE) -> float:
    """Force (N) on the reference circle in the mean of all meshes: the sun's torque over N r_s."""
    return torque / rigid.ratio / rigid.planets / (rigid.transverse[0] * rigid.teeth[0] / 2)


def centroid(kernel: Kernel, mesh: str) -> float:
    """Where across the face width (m) a mesh presses, by the middles of its slices."""
    middles = WIDTH * ((np.arange(SLICES) + 0.5) / SLICES - 0.5)
    force = np.array([kernel.get(f"{mesh}.slice_{s + 1}") for s in range(SLICES)])
    return float(force @ middles / force.sum())


@pytest.mark.parametrize("torque", [TORQUE, pytest.param(-TORQUE, marks=pytest.mark.full)])
@BOTH
def test_mean_axial_force_of_a_mesh_is_the_tangential_one_times_tan_beta(name: str, torque: float) -> None:
    """All planets together on the sun's bearing and, the other way, on the ring's mounts; nothing on the carrier's. A
    right-handed sun that is driven by the carrier is pushed towards −z. The normal forces are F_t/(cos α_n cos β)."""
    rigid, kernel = SETS[name], at_rest(name, torque)
    axial = rigid.planets * tangential(rigid, torque) * math.tan(BETA)
    assert wrench(kernel, "bearing.sun")[2] == pytest.approx(-axial, rel=1e-6)
    assert wrench(kernel, "bearing.ring")[2] == pytest.approx(axial, rel=1e-6)
    assert abs(wrench(kernel, "bearing.carrier")[2]) < 1e-6 * abs(axial)
    normal = abs(tangential(rigid, torque)) / math.cos(rigid.pressure_angle) / math.cos(BETA)
    for gear in ("sun", "ring"):
        forces = [abs(kernel.get(f"{gear}_planet{k + 1}.force")) for k in range(rigid.planets)]
        assert np.mean(forces) == pytest.approx(normal, rel=1e-6)


@BOTH
def test_axial_forces_on_a_planet_cancel(name: str) -> None:
    rigid, kernel = SETS[name], at_rest(name, TORQUE)
    for k in range(rigid.planets):
        assert abs(wrench(kernel, f"pin.planet{k + 1}")[2]) < 1e-6 * tangential(rigid)


@BOTH
def test_all_forces_and_moments_of_the_set_balance(name: str) -> None:
    """On the ground, about the origin: what bearings and mounts carry, and torques."""
    rigid, kernel = SETS[name], at_rest(name, TORQUE)
    total = sum(wrench(kernel, held) for held in SUPPORTS)
    largest = max(np.abs(wrench(kernel, held)).max() for held in SUPPORTS)
    assert np.abs(total[:3]).max() < 1e-6 * largest
    assert np.abs(total[3:]).max() < 1e-6 * largest * rigid.distance
    assert kernel.get("bearing.ring.mz") == pytest.approx(TORQUE * (1 - 1 / rigid.ratio), rel=1e-6)


@BOTH
def test_a_pin_carries_the_moment_that_tilts_its_planet(name: str) -> None:
    """About the tangent F_t tan β d_w, and F_t tan α_t (z_s − z_r) for forces that do not press at mid-width; about the
    radius F_t (z_s + z_r). Found 2.0e-3 and 3.0e-3 of three planets, 3.8e-3 and 7.4e-3 of six: a slice that carries in
    part presses beside its middle."""
    rigid, kernel = SETS[name], at_rest(name, TORQUE)
    tangent, radius = BESIDE[name]
    force = tangential(rigid)
    module, alpha = rigid.transverse
    by_hand = force * math.tan(BETA) * module * rigid.teeth[1]
    for k, angle in enumerate(rigid.angles()):
        moment = wrench(kernel, f"pin.planet{k + 1}")[3:]
        about_tangent = moment @ [-math.sin(angle), math.cos(angle)]
        about_radius = moment @ [math.cos(angle), math.sin(angle)]
        z_s, z_r = (centroid(kernel, f"{gear}_planet{k + 1}") for gear in ("sun", "ring"))
        print(about_tangent / by_hand, about_radius / by_hand, 1e3 * z_s, 1e3 * z_r)
        assert about_tangent == pytest.approx(by_hand + force * math.tan(alpha) * (z_s - z_r), abs=tangent * by_hand)
        assert about_radius == pytest.approx(force * (z_s + z_r), abs=radius * by_hand)


def test_a_set_of_the_other_hand_is_the_mirror_image() -> None:
    """About mid-width: axial forces and tilting moments change their sign, nothing else does."""
    right, left = at_rest("three", TORQUE), at_rest("other hand", TORQUE)
    mirrored = np.array([1, 1, -1, -1, -1])
    for name in (*SUPPORTS, *(f"pin.planet{k + 1}" for k in range(3))):
        here, there = wrench(right, name), wrench(left, name)
        assert there == pytest.approx(here * mirrored, abs=1e-6 * tangential(HELICAL)), name
    for mesh in ("sun_planet2", "ring_planet3"):
        forces = [[kernel.get(f"{mesh}.slice_{s + 1}") for s in range(SLICES)] for kernel in (right, left)]
        assert forces[0] == pytest.approx(forces[1][::-1], rel=1e-6)


def errors(rigid: RigidSet, torque: float = TORQUE, positions: int = 12) -> TeResult:
    return loaded_te(rigid.model(), [torque], positions, **FOUNDATION)


def test_a_vanishing_helix_is_the_spur_set() -> None:
    """But for what helical slices yield of their own, which spur gears go without."""
    models = [by_functions_alone(replace(HELICAL, helix_angle=beta).model()) for beta in (1e-7, 0.0)]
    nearly, spur = (loaded_te(model, [TORQUE], 3, **FOUNDATION) for model in models)
    assert np.abs(nearly.te - spur.te).max() < 1e-6 * np.abs(spur.te).max()
    assert np.abs(nearly.sharing - spur.sharing).max() < 1e-6


def overlapping(slices: int, helix_angle: float = BETA) -> TeResult:
    """At an overlap ratio of one, flanks of steel: parts of a line of contact yield each by itself."""
    width = math.pi * HELICAL.module / math.sin(BETA)
    rigid = replace(HELICAL, teeth=(27, 33), width=width, slices=slices, youngs_modulus=STEEL, helix_angle=helix_angle)
    return loaded_te(rigid.model(), [TORQUE], 6, **FOUNDATION | {"slices": float(slices)})


def test_overlap_smooths_the_transmission_error() -> None:
    """Teeth on a foundation at an overlap ratio of one: lines of contact have one length in all positions, where the
    spur set changes between one and two pairs of teeth, all planets at once. 0.15: six slices (0.10)."""
    found, spur = overlapping(SLICES), overlapping(SLICES, 0.0)
    print(np.ptp(found.te), np.ptp(spur.te))
    assert np.ptp(found.te) < 0.15 * np.ptp(spur.te)


@pytest.mark.full
def test_more_slices_than_width_functions_find_the_same_equilibrium() -> None:
    """Twelve slices of teeth with six width functions: the mean within 1e-3 of that of six, and smoother still."""
    six, twelve = overlapping(SLICES), overlapping(2 * SLICES)
    print(six.te.mean(), twelve.te.mean(), np.ptp(six.te), np.ptp(twelve.te))
    assert twelve.te.mean() == pytest.approx(six.te.mean(), rel=1e-3)
    assert np.ptp(twelve.te) < np.ptp(six.te)


@pytest.mark.full
def test_three_helical_planets_share_alike_whatever_the_error_of_a_pin() -> None:
    """The sun floats to where its three forces are in balance; on a bearing it does not."""
    rigid = replace(HELICAL, pins={1: (5e-6, 12e-6)}, sun=Rigid(0.4, 0.39, 1e4))
    assert errors(rigid, 1000.0, 6).sharing.mean(axis=1).max() == pytest.approx(1.0, abs=1e-3)
    held = errors(replace(rigid, sun=Rigid(0.4, 0.39, 1e9)), 1000.0, 6)
    assert held.sharing.mean(axis=1).max() > 1.03 and held.load_factor.min() > 1.03


CARRIER, RATIO = 400.0, 90 / 26  # N·m; speed of the sun over that of the carrier
TANGENT = CARRIER / RATIO / 3 / (1.75e-3 * 26 / 2 / math.cos(BETA))  # N on the sun's reference circle, one mesh
AXIAL = TANGENT * math.tan(BETA)


@pytest.fixture(scope="module")
def shipped() -> StageModel:
    spec = load_stage("helical_set")
    return assemble(spec, load_bodies(spec))


@pytest.fixture(scope="module")
def running(shipped: StageModel) -> tuple[Kernel, dict[str, np.ndarray]]:
    """helical_set at 85 rad/s under 400 N·m on the carrier: 2 ms, means of 40 steps, the first 10 left out."""
    kernel, found = shipped.kernel(level=0.0), []
    for name, value in {"tau": CARRIER, "w_start": 85.0}.items():
        kernel.set(f"carrier.{name}", value)
        kernel.set(f"sun.{name}", value * (-1 / RATIO if name == "tau" else RATIO))
    kernel.initialize()
    names = [f"{name}.{component}_mean" for name in (*SUPPORTS, "pin.planet1", "pin.planet2", "pin.planet3")
             for component in ("fx", "fy", "fz", "mx", "my")]  # fmt: skip
    for i in range(40):
        kernel.step(5e-5 * i, 5e-5)
        found.append([kernel.get(name) for name in names])
    return kernel, dict(zip(names, np.array(found)[10:].T, strict=True))


def test_the_shipped_set_runs_and_carries_its_axial_forces(running: tuple[Kernel, dict[str, np.ndarray]]) -> None:
    """Sun and ring push opposite ways by N F_t tan β, 1 %: the run is short; planets stay where they are along their
    pins; the energy of 2 ms is closed to 1e-3 of what goes through."""
    kernel, found = running
    mean = {name: values.mean() for name, values in found.items()}
    assert mean["bearing.sun.fz_mean"] == pytest.approx(-3 * AXIAL, rel=0.01)
    assert mean["bearing.ring.fz_mean"] == pytest.approx(3 * AXIAL, rel=0.01)
    for k in range(3):
        assert abs(mean[f"pin.planet{k + 1}.fz_mean"]) < 0.01 * AXIAL
    assert kernel.get("solver.retried_steps") == 0
    assert abs(kernel.get("energy.residual")) < 1e-3 * CARRIER * 85.0 * 2e-3


def test_tilting_planets_of_the_shipped_set_take_load_to_the_ends_of_their_teeth(
    running: tuple[Kernel, dict[str, np.ndarray]],
) -> None:
    """About the tangent of its place a pin carries what pressing at mid-width would give, less what the load gives
    back that a soft pin lets wander: between two thirds and all of F_t tan β d."""
    _, found = running
    by_hand = AXIAL * 1.75e-3 * 19 / math.cos(BETA)
    for k, angle in enumerate(2 * math.pi / 3 * np.arange(3)):
        moment = [found[f"pin.planet{k + 1}.m{axis}_mean"].mean() for axis in "xy"]
        assert 0.66 < np.dot(moment, [-math.sin(angle), math.cos(angle)]) / by_hand < 1.0


@pytest.mark.full
def test_the_shipped_set_is_smooth_and_shares_alike(shipped: StageModel) -> None:
    """At 400 N·m: 0.2 µm of 172 µm, planets a third of a pitch apart."""
    found = loaded_te(shipped, [CARRIER], 12)
    print(found.te.mean(), np.ptp(found.te), found.load_factor)
    assert np.ptp(found.te) < 0.3e-6 and found.load_factor.max() < 1.01
    assert found.sharing.mean(axis=1) == pytest.approx(1.0, abs=1e-3)
