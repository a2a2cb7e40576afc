"""Internal gears and planetary sets: involute by finite differences, tangents, areas, path of contact, assembly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gearfmu.stagefile.forms.shapes import carrier_geometry, set_geometry
from gearfmu.stagefile.stage import load_stage

SPEC = load_stage("planetary54")
SET = set_geometry(SPEC.written)
RING = SET.ring_mesh.ring


def test_flank_is_the_involute_of_the_base_circle_and_its_normal_points_into_the_space():
    roll, step = np.linspace(RING.s_a, RING.s_form, 50), 1e-8
    for sg in (1, -1):
        tangent = (RING.flank_point(roll + step, sg) - RING.flank_point(roll - step, sg)) / (2 * step)
        normal, point = RING.flank_normal(roll, sg), RING.flank_point(roll, sg)
        assert np.abs((tangent * normal).sum(axis=1)).max() < 1e-7
        assert np.linalg.norm(tangent, axis=1) == pytest.approx(roll / RING.r_b, rel=1e-6)  # dσ = s ds/r_b
        foot = point + roll[:, None] * normal  # the normal's line is tangent to the base circle at distance s
        assert np.linalg.norm(foot, axis=1) == pytest.approx(RING.r_b, rel=1e-12)
        assert np.all(normal[:, 1] * sg < 0)  # out of the ring's material, towards the middle of space 0


def test_space_and_tooth_share_the_pitch_on_the_reference_circle():
    assert float(RING.thickness_angle(RING.r)) == pytest.approx(RING.half_pitch / 2, rel=1e-12)


def test_fillet_is_tangent_to_flank_and_root_circle():
    start, end = RING.fillet_point(0.0), RING.fillet_point(1.0)
    assert start == pytest.approx(RING.flank_point(RING.s_form), abs=1e-15)
    assert np.hypot(*end) == pytest.approx(RING.r_f, rel=1e-13)
    share, step = np.array([step for step in (1e-7, 1 - 1e-7)]), 1e-8
    tangent = RING.fillet_point(share + step) - RING.fillet_point(share - step)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    assert abs(tangent[0] @ RING.flank_normal(RING.s_form)) < 1e-6
    assert abs(tangent[1] @ end) / RING.r_f < 1e-6


def test_tip_edge_rounding_touches_flank_and_tip_circle():
    centre = RING.flank_point(RING.s_tip) - RING.tip_edge * RING.flank_normal(RING.s_tip)
    assert np.hypot(*centre) == pytest.approx(RING.r_a + RING.tip_edge, rel=1e-13)


def test_least_tip_radius_is_where_the_planets_form_circle_is_met():
    assert SET.ring_mesh.least_tip_radius == pytest.approx(65.36e-3, abs=5e-6)
    edge = replace(RING, r_a=SET.ring_mesh.least_tip_radius, tip_edge=0.0)
    assert replace(SET.ring_mesh, gears=(SET.ring_mesh.planet, edge)).path["A"] == pytest.approx(
        SET.ring_mesh.planet.s_form, abs=1e-12
    )


def test_planets_fit_between_sun_and_ring():
    z_s, z_p, z_r = SET.sun_mesh.gears[0].z, SET.ring_mesh.planet.z, RING.z
    assert SET.ratio == 4 and SET.neighbour_clearance == pytest.approx(13.64e-3, abs=1e-5)
    three = replace(SET, angles=(0.0, 2 * math.pi / 3, 4 * math.pi / 3))
    sun = math.pi / z_s if z_p % 2 == 0 else 0.0  # angle of the sun's tooth 0 in mesh with planet 0
    uneven = replace(SET, angles=tuple(2 * math.pi * k / 72 for k in (0, 14, 29, 43, 58)))
    for case in (SET, three, uneven):
        for theta in case.angles:
            phase = math.remainder(theta * (1 - z_r / z_p), 2 * math.pi / z_p)  # rolled in the ring
            assert abs(phase) <= math.pi / z_p * (1 + 1e-9)
            in_ring = (z_p * (theta - phase) - z_r * theta) / (2 * math.pi)  # a tooth meets a space of the ring
            in_sun = (z_p * (theta + math.pi - phase) + z_s * (theta - sun)) / (2 * math.pi)
            assert in_ring == pytest.approx(round(in_ring), abs=1e-9)
            assert in_sun - 0.5 == pytest.approx(round(in_sun - 0.5), abs=1e-9)  # … and a space of the sun


def test_no_backlash_at_the_centre_distance_of_the_reference_circles():
    assert SET.ring_mesh.nominal_backlash == pytest.approx(0, abs=1e-15)
    wider = replace(SET.ring_mesh, a=SET.ring_mesh.a - 1e-5)  # the planet moves away from the ring's flanks
    assert wider.nominal_backlash == pytest.approx(2e-5 * math.tan(wider.alpha_wt), rel=1e-2)


def test_tips_collide_when_the_ring_has_few_teeth_more_than_the_planet():
    small = replace(RING, z=22, r_a=RING.m * 11 - RING.m)
    close = replace(SET.ring_mesh, gears=(SET.ring_mesh.planet, small), a=RING.m * 2)
    assert SET.ring_mesh.tip_clearance_angle > 0 > close.tip_clearance_angle


def test_carrier_volume_is_a_sum_of_cylinders():
    g = carrier_geometry(SPEC.bodies["carrier"])
    plate, bolt = math.pi * (60e-3**2 - 20e-3**2) * 12e-3, math.pi * 8e-3**2 * 22e-3
    assert g.volume == pytest.approx(plate + 4 * bolt)
    assert g.bolt_axis(1) == pytest.approx([0, 45e-3, 0], abs=1e-15)
