"""Plane mesh of one tooth with half a space on either side, in three blocks of eight-node quadrilaterals per half.

    tooth: surface = flank, core = middle of the tooth; rows run from the root form point F up to the tip
    root:  surface = trochoid and root land, core = an arc; rows run from F to the middle of the space
    rim:   from that arc down to the bore

Tooth, root and rim meet in one point A on the middle of the tooth. Blocks are transfinite interpolations of exact
boundary curves on a lattice that has the mid nodes too; the other half is the mirror image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.femesh.lattice import edges, finder, graded, mirrored, parameter, quads_of, transfinite
from gearfmu.geometry import GearGeometry, involute
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.geometry.plane import direction
from gearfmu.stagefile.tables.bodies import MeshSpec

ROOT_DEPTH = 0.7  # depth of the root block under the root circle, in modules, where the rim allows it
RIM_SHARE = 0.45  # … and in parts of the rim
CORE_SLOPE = 0.577  # A lies this times the half-thickness at F below F: three blocks of 60° meet there


Blocks: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]  # lattices (P, Q, 2), m, of tooth, root and rim


@dataclass(frozen=True)
class Section:
    """nodes: (N, 2) m. quads: (E, 8) counter-clockwise, mid nodes last. bore (of a ring: its rim), cut_plus, cut_minus:
    node indices.

    cut_plus[i] is cut_minus[i] turned by 2π/z.

    flank: for sg = +1 and −1 (2, F, 3) node indices of its edges (start, end, middle) from form to tip form point.
    flank_roll: (F, 3) m.
    """

    nodes: np.ndarray
    quads: np.ndarray
    bore: np.ndarray
    cut_plus: np.ndarray
    cut_minus: np.ndarray
    flank: np.ndarray
    flank_roll: np.ndarray


def section_of(blocks: Blocks, cut: np.ndarray, roll: np.ndarray) -> Section:
    """The section whose upper half consists of the blocks tooth, root and rim; cut (P, 2): its edge to the next sector;
    roll (R,): of the nodes on the flank, the tooth's first edge."""
    tooth, _, rim = blocks
    upper = np.concatenate([quads_of(block) for block in blocks])
    points = np.concatenate([upper, mirrored(upper)])
    nodes, index = np.unique(points.reshape(-1, 2), axis=0, return_inverse=True)
    find, held, flank = finder(nodes), rim[-1], tooth[0, : len(roll)]
    return Section(
        nodes=nodes, quads=index.reshape(-1, 8),
        bore=find(np.concatenate([held, held[held[:, 1] != 0] * [1, -1]])),
        cut_plus=find(cut), cut_minus=find(cut * [1, -1]),
        flank=np.stack([edges(find(flank * [1, sg])) for sg in (1, -1)]),
        flank_roll=edges(roll),
    )  # fmt: skip


def flank_rolls(gear: GearGeometry | InternalGearGeometry, elements: int) -> np.ndarray:
    """Rolls (m) of the flank's nodes: equal arc lengths to the tip form point, then one element to the tip circle."""
    ends = involute.arc_length(np.array([gear.s_form, gear.s_tip, gear.s_a]), gear.r_b)
    length = np.linspace(ends[0], ends[1], 2 * elements + 1)
    if (gear.s_a - gear.s_tip) * (gear.s_tip - gear.s_form) > 0:
        length = np.append(length, [0.5 * (ends[1] + ends[2]), ends[2]])
    roll = involute.roll_at_arc_length(length, gear.r_b)
    roll[0], roll[2 * elements] = gear.s_form, gear.s_tip
    return roll


def gear_blocks(gear: GearGeometry, mesh: MeshSpec, roll: np.ndarray) -> tuple[Blocks, np.ndarray]:
    """Tooth, root and rim, and the edge (P, 2) to the next sector; roll (R,): of the nodes on the flank, m. MeshError
    when the rim leaves no room for the root block."""
    across = graded(mesh.scaled(mesh.thickness), mesh.growth(mesh.thickness_grading))[:, None]
    share = graded(mesh.scaled(mesh.root, 2), 1.0)
    flank, surface = gear.flank_point(roll), root_curve(gear, share)
    surface[0] = flank[0]
    space = np.array([math.cos(gear.half_pitch), math.sin(gear.half_pitch)])
    core, depth = _core_arc(gear, flank[0], share)
    core[-1], surface[-1] = (gear.r_f - depth) * space, gear.r_f * space
    middle = core[0] + (gear.r_a - core[0, 0]) * parameter(flank)[:, None] * [1, 0]
    tip_angle = gear.tip_half_angle * (1 - across)
    tip = gear.r_a * direction(tip_angle[:, 0])
    middle[-1], tip[0], tip[-1] = (gear.r_a, 0.0), flank[-1], (gear.r_a, 0.0)
    neck = flank[0] + across * (core[0] - flank[0])
    neck[-1] = core[0]
    bore = gear.r_bore * direction(share * gear.half_pitch)
    bore[-1] = gear.r_bore * space
    down = rim_parameters(gear.r_f - depth - gear.r_bore, depth, mesh)[:, None]
    tooth = transfinite(neck, tip, flank, middle)
    root = transfinite(neck, surface[-1] - across * depth * space, surface, core)
    under, below = core[0] + down * (bore[0] - core[0]), core[-1] + down * (bore[-1] - core[-1])
    rim = transfinite(under, below, core, bore)
    return (tooth, root, rim), np.concatenate([root[:, -1], rim[1:, -1]])


def rim_parameters(height: float, depth: float, mesh: MeshSpec) -> np.ndarray:
    """Grading through a rim of this height; its first element continues the last one of the root block, `depth`
    high."""
    across = graded(mesh.thickness, mesh.thickness_grading)
    first = depth * (across[-1] - across[-3])
    wanted = math.log1p(height / first * (mesh.rim_grading - 1)) / math.log(mesh.rim_grading)
    count = max(mesh.rim, math.ceil(wanted))
    growth = mesh.rim_grading if wanted > mesh.rim else _fitting_growth(height / first, count)
    return graded(mesh.scaled(count), mesh.growth(growth))


def _fitting_growth(sum_of_series: float, terms: int) -> float:
    """The growth q ≥ 1 with 1 + q + … + q^(terms−1) = sum_of_series; 1 when even that is too long. Bisection."""
    low, high = 1.0, 5.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sum(middle**k for k in range(terms)) < sum_of_series else (low, middle)
    return low


def root_curve(gear: GearGeometry, share: np.ndarray) -> np.ndarray:
    """Points (P, 2) from the form point over trochoid and root land to mid space, at shares of the way."""
    rounding = gear.rounding
    tau = np.linspace(gear.form_angle, math.pi / 2, 2001)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rounding.point(tau), axis=0), axis=1))])
    land = rounding.land_angle * gear.r_f
    wanted = share * (run[-1] + land)
    angle = gear.half_pitch - rounding.land_angle + np.maximum(wanted - run[-1], 0.0) / gear.r_f
    on_land = gear.r_f * direction(angle)
    on_trochoid = rounding.point(np.interp(wanted, run, tau))
    return np.where((wanted > run[-1])[:, None], on_land, on_trochoid)


def _core_arc(gear: GearGeometry, form: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, float]:
    """Arc (P, 2) under the root from mid tooth to mid space, square to the cut there, and its depth there (m)."""
    rim = gear.r_f - gear.r_bore
    depth = min(ROOT_DEPTH * gear.m, RIM_SHARE * rim)
    middle = max(form[0] - CORE_SLOPE * form[1], gear.r_f - RIM_SHARE * rim)
    radius = gear.r_f - depth + (middle - gear.r_f + depth) * (1 - share) ** 2
    if rim <= 0 or radius.min() <= gear.r_bore:
        raise MeshError(f"the rim of {1e3 * rim:.3g} mm leaves no room for elements: make the bore smaller")
    return radius[:, None] * direction(share * gear.half_pitch), depth
