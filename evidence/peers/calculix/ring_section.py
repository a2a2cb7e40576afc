"""Plane mesh of a whole ring for a contact solution, as section.py makes it for an external gear: three blocks per half
tooth, fine surface elements where a space is touched.

Space k is centred on the angle 2πk/z; its sg = +1 surface belongs to the tooth between spaces k and k + 1, whose halves
share the elements along it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from evidence.peers.calculix.section import (
    CORE_DEPTH,
    EDGE_TURN,
    Fineness,
    Plane,
    edges,
    joined,
    quadrilaterals,
    stations,
    turning,
)
from gearfmu.femesh.section import graded, transfinite
from gearfmu.geometry import involute
from gearfmu.geometry.gear import InternalGearGeometry


def ring_surface(ring: InternalGearGeometry, u: np.ndarray) -> np.ndarray:
    """Points (N, 2) of space 0's sg = +1 surface at the arc length u (m) from the root form point: involute up to the
    tip form point, then the arc of the tip edge."""
    start, end = involute.arc_length(np.array([ring.s_form, ring.s_tip]), ring.r_b)
    flank = ring.flank_point(involute.roll_at_arc_length(start - np.minimum(u, start - end), ring.r_b))
    turn = np.maximum(u - (start - end), 0.0) / ring.tip_edge
    centre, normal = _tip_edge(ring)
    along = np.array([normal[1], -normal[0]])
    along *= -np.sign(along @ centre)
    arc = centre + ring.tip_edge * (np.cos(turn)[:, None] * normal + np.sin(turn)[:, None] * along)
    return np.where((turn > 0)[:, None], arc, flank)


def _tip_edge(ring: InternalGearGeometry) -> tuple[np.ndarray, np.ndarray]:
    """Centre (2,) m of the tip edge's arc, and the flank's normal (2,) where it begins."""
    normal = ring.flank_normal(ring.s_tip)
    return ring.flank_point(ring.s_tip) - ring.tip_edge * normal, normal


def ring_stations(ring: InternalGearGeometry, roll: float | None, fine: Fineness) -> np.ndarray:
    """`section.stations` of a ring's surface, fine around `roll` (m)."""
    start, end = involute.arc_length(np.array([ring.s_form, ring.s_tip]), ring.r_b)
    centre, normal = _tip_edge(ring)
    turn = math.acos(float(-normal @ centre / np.linalg.norm(centre)))
    middle = None if roll is None else float(start - involute.arc_length(roll, ring.r_b))
    return stations(float(start - end), float(start - end) + EDGE_TURN * turn * ring.tip_edge, middle, fine)


def half_ring_tooth(ring: InternalGearGeometry, along: np.ndarray, root: int, fine: Fineness) -> list[np.ndarray]:
    """Lattices (·, ·, 2) of tooth, root and rim block from mid space 0 to mid tooth at positive angles; the first row
    of the tooth block's second index is the surface."""
    across, share = graded(fine.thickness, fine.depth_growth)[:, None], graded(root, 1.0)
    flank, fillet = ring_surface(ring, along), _root_curve(ring, share)
    fillet[0], fillet[-1] = flank[0], [ring.r_f, 0.0]
    depth, mid = CORE_DEPTH * ring.m, _direction(ring.half_pitch)
    middle = float(flank[0] @ mid + (mid[1] * flank[0, 0] - mid[0] * flank[0, 1]) / math.sqrt(3))
    radius = ring.r_f + depth + (middle - ring.r_f - depth) * (1 - share) ** 2
    turns = (1 - share) * ring.half_pitch
    core = radius[:, None] * _direction(turns)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(flank, axis=0), axis=1))])
    centre = core[0] + (ring.r_a - middle) * (run / run[-1])[:, None] * mid
    tip = flank[-1] + across * (centre[-1] - flank[-1])
    neck = flank[0] + across * (core[0] - flank[0])
    rim = ring.r_rim * _direction(turns)
    out = graded(fine.rim, 1.3)[:, None]
    return [
        transfinite(neck, tip, flank, centre),
        transfinite(neck, fillet[-1] + across * [depth, 0.0], fillet, core),
        transfinite(core[0] + out * (rim[0] - core[0]), core[-1] + out * (rim[-1] - core[-1]), core, rim),
    ]


def ring_plane(ring: InternalGearGeometry, contacts: Mapping[int, float], fine: Fineness) -> Plane:
    """The section of the whole ring; contacts: roll (m) at which the sg = +1 surface of a space is touched. The rim
    takes the place of the bore."""
    cells, rim, flank, patch = [], [], {}, {}
    for tooth in range(-(ring.z // 2), ring.z - ring.z // 2):
        near = min(abs((tooth - k + ring.z // 2) % ring.z - ring.z // 2) for k in contacts) <= fine.toothed
        along = ring_stations(ring, contacts.get(tooth), fine)
        blocks = half_ring_tooth(ring, along, fine.root if tooth in contacts else fine.far_root, fine)
        half = np.concatenate([quadrilaterals(block) for block in blocks[0 if near else 1 :]])
        here, there = (turning(2 * math.pi * k / ring.z) for k in (tooth, tooth + 1))
        cells += [half @ here, (half * [1, -1])[:, [0, 3, 2, 1, 7, 6, 5, 4]] @ there]
        edge = edges(blocks[2][-1])
        rim += [edge @ here, (edge * [1, -1]) @ there]
        if tooth in contacts:
            flank[tooth] = edges(ring_surface(ring, along)) @ here
            patch[tooth] = flank[tooth][np.diff(along[::2]) < 1.2 * fine.size]
    nodes, (quads, rim_edges, *zones) = joined(cells, rim, *flank.values(), *patch.values())
    return Plane(
        nodes=nodes,
        quads=quads,
        bore=rim_edges,
        flank=dict(zip(flank, zones[: len(flank)], strict=True)),
        patch=dict(zip(patch, zones[len(flank) :], strict=True)),
    )


def _root_curve(ring: InternalGearGeometry, share: np.ndarray) -> np.ndarray:
    """Points (P, 2) from the form point over fillet and root land to mid space, at shares of the way."""
    land = ring.fillet_centre[1] * ring.r_f
    wanted = share * (ring.fillet_length + land)
    on_land = ring.r_f * _direction(np.maximum(ring.fillet_length + land - wanted, 0.0) / ring.r_f)
    on_fillet = ring.fillet_point(np.minimum(wanted / ring.fillet_length, 1.0))
    return np.where((wanted > ring.fillet_length)[:, None], on_land, on_fillet)


def _direction(angle: float | np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
