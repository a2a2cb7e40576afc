"""Helical planetary sets of rigid bodies on an elastic foundation of teeth, by hand: axial forces, and the moment that
tilts a planet on its pin. Balance, mirror and other hand: tests/relations."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from driven import begun
from rigid_set import SPRINGS, RigidSet

from gearfmu.kernel import Kernel

BETA, TORQUE, SLICES, WIDTH = math.radians(20), 300.0, 6, 30e-3
FOUNDATION = SPRINGS | {"slices": float(SLICES), "effect.tip_contact": 1.0}
HELICAL = RigidSet(3, contact_ratio=1.4, helix_angle=BETA, width=WIDTH, slices=SLICES, functions=SLICES)
SETS = {"three": HELICAL, "six": replace(HELICAL, planets=6, teeth=(37, 23))}
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
