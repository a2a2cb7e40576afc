"""Plane mesh of half a tooth for a contact solution: three blocks of eight-node quadrilaterals (tooth, root, rim),
transfinite between exact boundary curves.

The counts across the thickness and the rim are those of every sector, so that sectors fit at their cuts; elements
along the surface are each sector's own. The tip edge rounding is meshed as an arc: it takes part in contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.femesh.section import graded, root_curve, transfinite
from gearfmu.geometry import GearGeometry, involute

EDGE_TURN = 0.5  # part of the tip edge's arc that is meshed; a chamfer closes the tooth (150° instead of 180° corners)
CORE_DEPTH = 0.6  # depth of the root block under the root circle, modules


@dataclass(frozen=True)
class Fineness:
    """Elements of a section. patch: (m) half length of the fine surface zone; inner, below, above: elements in it and
    beside it; growth from the patch outwards. thickness, depth_growth: elements from surface to tooth middle. rim: from
    the root block to the bore. root: along half a space; far_root and far_flank: in sectors without contact. toothed:
    so many sectors beside a touched one have their tooth; farther ones end at the root circle."""

    patch: float
    inner: int = 6
    below: int = 3
    above: int = 3
    growth: float = 2.0
    thickness: int = 2
    depth_growth: float = 2.6
    rim: int = 2
    root: int = 2
    far_root: int = 1
    far_flank: int = 1
    toothed: int = 1


def surface(gear: GearGeometry, u: np.ndarray) -> np.ndarray:
    """Points (N, 2) of tooth 0's sg = +1 surface at the arc length u (m) from the root form point: involute up to the
    tip form point, then the arc of the tip edge."""
    start, end = involute.arc_length(np.array([gear.s_form, gear.s_tip]), gear.r_b)
    flank = gear.flank_point(involute.roll_at_arc_length(start + np.minimum(u, end - start), gear.r_b))
    turn = np.maximum(u - (end - start), 0.0) / gear.tip_edge
    normal = gear.flank_normal(gear.s_tip)
    along = np.array([normal[1], -normal[0]])
    arc = _tip_edge_centre(gear) + gear.tip_edge * (
        np.cos(turn)[:, None] * normal + np.sin(turn)[:, None] * along * np.sign(along[0])
    )
    return np.where((turn > 0)[:, None], arc, flank)


def _tip_edge_centre(gear: GearGeometry) -> np.ndarray:
    """Centre (2,) in m of the tip edge rounding of flank sg = +1."""
    return gear.flank_point(gear.s_tip) - gear.tip_edge * gear.flank_normal(gear.s_tip)


def lengths(gear: GearGeometry) -> tuple[float, float]:
    """Arc length (m) of the flank, and of flank and meshed tip edge together."""
    start, end = involute.arc_length(np.array([gear.s_form, gear.s_tip]), gear.r_b)
    centre = _tip_edge_centre(gear)
    full_turn = math.acos(float(gear.flank_normal(gear.s_tip) @ (centre / np.linalg.norm(centre))))
    return float(end - start), float(end - start) + EDGE_TURN * full_turn * gear.tip_edge


def half_tooth(gear: GearGeometry, stations: np.ndarray, root: int, fine: Fineness) -> list[np.ndarray]:
    """Lattices (·, ·, 2) of tooth, root and rim block of the half tooth at positive angles; the first row of the tooth
    block's second index is the surface."""
    across = graded(fine.thickness, fine.depth_growth)[:, None]
    share = graded(root, 1.0)
    flank, fillet = surface(gear, stations), root_curve(gear, share)
    space = np.array([math.cos(gear.half_pitch), math.sin(gear.half_pitch)])
    fillet[0], fillet[-1] = flank[0], gear.r_f * space
    depth = CORE_DEPTH * gear.m
    middle = flank[0, 0] - flank[0, 1] / math.sqrt(3)
    radius = gear.r_f - depth + (middle - gear.r_f + depth) * (1 - share) ** 2
    core = radius[:, None] * np.stack([np.cos(share * gear.half_pitch), np.sin(share * gear.half_pitch)], axis=1)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(flank, axis=0), axis=1))])
    centre = core[0] + (gear.r_a - middle) * (run / run[-1])[:, None] * [1, 0]
    tip = flank[-1] + across * (centre[-1] - flank[-1])
    neck = flank[0] + across * (core[0] - flank[0])
    bore = gear.r_bore * np.stack([np.cos(share * gear.half_pitch), np.sin(share * gear.half_pitch)], axis=1)
    down = graded(fine.rim, 1.3)[:, None]
    return [
        transfinite(neck, tip, flank, centre),
        transfinite(neck, fillet[-1] - across * depth * space, fillet, core),
        transfinite(core[0] + down * (bore[0] - core[0]), core[-1] + down * (bore[-1] - core[-1]), core, bore),
    ]


def quadrilaterals(lattice: np.ndarray) -> np.ndarray:
    """Coordinates (E, 8, 2) of the counter-clockwise quadrilaterals of a lattice (2a + 1, 2b + 1, 2)."""
    rows, columns = lattice.shape[0] - 1, lattice.shape[1] - 1
    steps = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    quads = np.stack([lattice[i : i + rows - 1 : 2, j : j + columns - 1 : 2] for i, j in steps], axis=2)
    quads = quads.reshape(-1, 8, 2)
    first, last = quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0]
    clockwise = np.median(first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0]) < 0
    return quads[:, [0, 3, 2, 1, 7, 6, 5, 4]] if clockwise else quads


def joined(groups: Sequence[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Nodes (N, 2), and each group's points (…, 2) as node numbers (…). Points within 10 nm of each other are one node;
    the bins are shifted off the axes, where the rounding of turned points has either sign."""
    points = np.concatenate([group.reshape(-1, 2) for group in groups])
    bins = np.floor(points / 1e-8 + 0.37).astype(np.int64)
    _, first, index = np.unique(bins, axis=0, return_index=True, return_inverse=True)
    ends = np.cumsum([group.size // 2 for group in groups])[:-1]
    parts = np.split(index.ravel(), ends)
    return points[first], [part.reshape(group.shape[:-1]) for part, group in zip(parts, groups, strict=True)]


def turning(angle: float) -> np.ndarray:
    """points @ matrix turns points about the axis by `angle`."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def edges(line: np.ndarray) -> np.ndarray:
    """Start, end and middle (E, 3, …) of the edges along a line of corner and mid nodes."""
    return np.stack([line[:-2:2], line[2::2], line[1::2]], axis=1)
