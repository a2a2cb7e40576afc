"""The sector of an internal gear: tooth space 0 on +x with half a tooth on either side, cut through the teeth.

    tooth: surface = flank, core = middle of the tooth (the cut); rows run from the root form point F to the tip
    root:  surface = fillet and root land, core = an arc; rows run from F to the middle of the space
    rim:   from that arc out to the rim

as in `section`, inside out; for y ≥ 0, the other half is the mirror image.
"""

from __future__ import annotations

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.femesh.lattice import graded, parameter, transfinite
from gearfmu.femesh.section import CORE_SLOPE, RIM_SHARE, ROOT_DEPTH, Blocks, rim_parameters
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.geometry.plane import direction
from gearfmu.stagefile.tables.bodies import MeshSpec


def ring_blocks(ring: InternalGearGeometry, mesh: MeshSpec, roll: np.ndarray) -> tuple[Blocks, np.ndarray]:
    """Tooth, root and rim, and the edge (P, 2) to the next sector; roll (R,): of the nodes on the flank, m. MeshError
    when the rim leaves no room for the root block."""
    across = graded(mesh.scaled(mesh.thickness), mesh.growth(mesh.thickness_grading))[:, None]
    share = graded(mesh.scaled(mesh.root, 2), 1.0)
    flank, surface = ring.flank_point(roll), _root_curve(ring, share)
    surface[0] = flank[0]
    tooth_middle = direction(ring.half_pitch)
    core, depth = _core_arc(ring, flank[0], share)
    top = ring.r_a * tooth_middle
    middle = core[0] + parameter(flank)[:, None] * (top - core[0])
    half = ring.half_pitch - ring.tip_half_angle
    tip = ring.r_a * direction(half + (ring.half_pitch - half) * across[:, 0])
    middle[-1], tip[0], tip[-1] = top, flank[-1], top
    neck = flank[0] + across * (core[0] - flank[0])
    neck[-1] = core[0]
    outer = ring.r_rim * direction((1 - share) * ring.half_pitch)
    outer[-1] = (ring.r_rim, 0.0)
    up = rim_parameters(ring.r_rim - ring.r_f - depth, depth, mesh)[:, None]
    below = np.concatenate([surface[-1:], surface[-1] + across[1:] * [depth, 0.0]])
    below[-1] = core[-1]
    tooth, root = transfinite(neck, tip, flank, middle), transfinite(neck, below, surface, core)
    first, last = (core[k] + up * (outer[k] - core[k]) for k in (0, -1))
    first[-1], last[-1] = outer[0], outer[-1]
    rim = transfinite(first, last, core, outer)
    return (tooth, root, rim), np.concatenate([tooth[-1, ::-1], rim[1:, 0]])


def _root_curve(ring: InternalGearGeometry, share: np.ndarray) -> np.ndarray:
    """Points (P, 2) from the form point over fillet and root land to mid space, at shares of the way."""
    land = ring.fillet_centre[1] * ring.r_f
    wanted = share * (ring.fillet_length + land)
    angle = np.maximum(ring.fillet_length + land - wanted, 0.0) / ring.r_f
    on_fillet = ring.fillet_point(np.minimum(wanted / ring.fillet_length, 1.0))
    curve = np.where((wanted > ring.fillet_length)[:, None], ring.r_f * direction(angle), on_fillet)
    curve[-1] = (ring.r_f, 0.0)
    return curve


def _core_arc(ring: InternalGearGeometry, form: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, float]:
    """Arc (P, 2) around the root from mid tooth to mid space, square to the symmetry line; its depth there (m)."""
    rim = ring.r_rim - ring.r_f
    if rim <= 0:
        raise MeshError(f"the rim of {1e3 * rim:.3g} mm leaves no room for elements: make its diameter larger")
    depth = min(ROOT_DEPTH * ring.m, RIM_SHARE * rim)
    along = direction(ring.half_pitch)
    half_thickness = along[1] * form[0] - along[0] * form[1]
    middle = min(form @ along + CORE_SLOPE * half_thickness, ring.r_f + RIM_SHARE * rim)
    radius = ring.r_f + depth + (middle - ring.r_f - depth) * (1 - share) ** 2
    arc = radius[:, None] * direction((1 - share) * ring.half_pitch)
    arc[0], arc[-1] = middle * along, (ring.r_f + depth, 0.0)
    return arc, depth
