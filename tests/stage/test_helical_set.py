"""Helical planetary sets of rigid bodies on an elastic foundation of teeth, by hand: axial forces, balance of all
forces and moments, the moment that tilts a planet on its pin, both hands, the spur set as the limit."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from driven import begun
from rigid_set import SPRINGS, RigidSet
from slices import by_functions_alone

from gearfmu.kernel import Kernel
from gearfmu.stage.run.te import loaded_te

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
    loads = {"carrier.tau": torque, "sun.tau": -torque / rigid.ratio}
    return begun(rigid.model().kernel(**FOUNDATION), loads)


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
def test_all_forces_and_moments_of_the_set_and_axial_ones_of_planets_balance(name: str) -> None:
    """On the ground, about the origin: what bearings and mounts carry, and torques."""
    rigid, kernel = SETS[name], at_rest(name, TORQUE)
    carried = np.array([wrench(kernel, held) for held in SUPPORTS])
    total, largest = carried.sum(axis=0), np.abs(carried).max()
    assert np.abs(total[:3]).max() < 1e-6 * largest
    assert np.abs(total[3:]).max() < 1e-6 * largest * rigid.distance
    assert kernel.get("bearing.ring.mz") == pytest.approx(TORQUE * (1 - 1 / rigid.ratio), rel=1e-6)
    for k in range(rigid.planets):
        assert abs(wrench(kernel, f"pin.planet{k + 1}")[2]) < 1e-6 * tangential(rigid)


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


def test_a_vanishing_helix_is_the_spur_set() -> None:
    """But for what helical slices yield of their own, which spur gears go without."""
    models = [by_functions_alone(replace(HELICAL, helix_angle=beta).model()) for beta in (1e-7, 0.0)]
    nearly, spur = (loaded_te(model, [TORQUE], 3, **FOUNDATION) for model in models)
    assert np.abs(nearly.te - spur.te).max() < 1e-6 * np.abs(spur.te).max()
    assert np.abs(nearly.sharing - spur.sharing).max() < 1e-6


def test_overlap_smooths_the_transmission_error() -> None:
    """Teeth on a foundation at an overlap ratio of one: lines of contact have one length in all positions, where the
    spur set changes between one and two pairs of teeth, all planets at once. 0.15: six slices (0.10)."""
    width = math.pi * HELICAL.module / math.sin(BETA)
    rigid = replace(HELICAL, teeth=(27, 33), width=width, youngs_modulus=STEEL)
    found, spur = (
        loaded_te(replace(rigid, helix_angle=beta).model(), [TORQUE], 6, **FOUNDATION) for beta in (BETA, 0.0)
    )
    assert np.ptp(found.te) < 0.15 * np.ptp(spur.te)
