"""The sector of a carrier around one bolt: plane blocks around the bolt's axis, extruded through plate and bolt.

    core:  a rectangle in the bolt
    bolt:  three blocks from the core to the bolt's circle
    plate: three blocks from that circle to the outer edge, to the cut between two bolts and to the bore

for y ≥ 0; the other half is the mirror image. Blocks meet on two rays from the bolt's axis. Elements are small at the
bolt's foot, where the plate's surface meets the bolt, and at the ends of seat and bore, which rigid couplings hold:
stresses are singular there, and the frequencies of an evenly spaced mesh converge slowly.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from gearfmu.errors import MeshError
from gearfmu.femesh.lattice import (
    extruded,
    graded,
    graded_to_both,
    mirrored,
    numbered,
    quads_of,
    transfinite,
)
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.quality import scaled_jacobian
from gearfmu.geometry.mesh import CarrierGeometry
from gearfmu.geometry.plane import direction
from gearfmu.stagefile.forms.planetary import CarrierMeshSpec

_CORE = 0.55  # reach of the core in parts of the bolt's radius
_OUTWARD, _INWARD = math.radians(52), math.radians(128)  # the two rays, seen from the bolt's axis
_FOOT = 3.0  # growth of elements away from the bolt's foot, the end of its seat and the plate's faces
_DISC = 2.5  # … and in the plate away from bolt and edges
_TOLERANCE = 1e-9  # of the outer radius


def carrier_sector(geometry: CarrierGeometry, mesh: CarrierMeshSpec) -> FeMesh:
    """One sector of the carrier, bolt 0 on +x in its middle; `teeth` of the FeMesh is the number of bolts.

    sets: "bore", and "bolt": the seat of the bolt, z ∈ [−seat/2, seat/2]. MeshError when the numbers leave no valid
    element.
    """
    bolt, plate = _section(geometry, mesh)
    low, high, top = geometry.plate_low, geometry.plate_high, geometry.seat / 2
    foot = mesh.growth(_FOOT)
    through = low + (high - low) * graded_to_both(mesh.scaled(mesh.plate), foot)
    through[-1] = high
    neck = high + geometry.gap * graded_to_both(mesh.scaled(mesh.neck), foot)
    neck[-1] = -top
    seat = -top + 2 * top * graded(mesh.scaled(mesh.length), foot)
    layers = [extruded(np.concatenate([bolt, plate]), through), extruded(bolt, neck), extruded(bolt, seat)]
    nodes, elements = numbered(np.concatenate(layers))
    result = FeMesh(nodes, elements, _sets(geometry, nodes), geometry.planets, *_cuts(geometry, nodes))
    if not (worst := float(scaled_jacobian(result).min())) > 0:
        raise MeshError(f"carrier: an element is folded (scaled Jacobian {worst:.2g}): give the bolts more room")
    return result


def whole_carrier(geometry: CarrierGeometry, sector: FeMesh) -> FeMesh:
    """The whole carrier of its `carrier_sector`: every bolt, with the wedge of the plate that it covers, turned to its
    place, and the plate between two bolts stretched. MeshError where that folds an element."""
    mesh = sector.full()
    even = 2 * math.pi * np.arange(geometry.planets) / geometry.planets
    if np.array_equal(even, geometry.angles):
        return mesh
    covered = 1.1 * math.asin(geometry.r_bolt / geometry.a)
    ends = np.stack([even - covered, even + covered], 1).ravel()
    turned = np.repeat(np.asarray(geometry.angles) - even, 2)
    polar = np.arctan2(mesh.nodes[:, 1], mesh.nodes[:, 0])
    turn = np.interp(polar, ends, turned, period=2 * math.pi)
    c, s = np.cos(turn), np.sin(turn)
    x, y, z = mesh.nodes.T
    moved = replace(mesh, nodes=np.stack([c * x - s * y, s * x + c * y, z], 1))
    if not (worst := float(scaled_jacobian(moved).min())) > 0:
        raise MeshError(f"carrier: an element is folded (scaled Jacobian {worst:.2g}): move the planets apart")
    return moved


def _section(g: CarrierGeometry, mesh: CarrierMeshSpec) -> tuple[np.ndarray, np.ndarray]:
    """Quadrilaterals (E, 8, 2) of the bolt and of the plate around it."""
    around, sides = graded(mesh.scaled(mesh.around), 1.0), graded(mesh.scaled(mesh.sides, 2), 1.0)
    turns = [_OUTWARD * around, _OUTWARD + (_INWARD - _OUTWARD) * sides, _INWARD + (math.pi - _INWARD) * around]
    centre = np.array([g.a, 0.0])
    circle = _joined([centre + g.r_bolt * direction(turn) for turn in turns])
    core = _joined(_core_sides(g, centre, around, sides))
    edge = _joined(_edges_of_plate(g, around, sides))
    bottom = core[2][-1] + np.outer(sides, core[0][0] - core[2][-1])
    bottom[0], bottom[-1], bottom[:, 1] = core[2][-1], core[0][0], 0.0
    inner = quads_of(transfinite(core[2][::-1], core[0], bottom, core[1][::-1]))
    inward = 1 - graded(mesh.scaled(mesh.bolt), mesh.growth(_FOOT))[::-1]
    outward = graded_to_both(mesh.scaled(mesh.disc), mesh.growth(_DISC))
    ring = [quads_of(_between(core[k], circle[k], inward)) for k in range(3)]
    plate = [quads_of(_between(circle[k], edge[k], outward)) for k in range(3)]
    return _both_halves([inner, *ring]), _both_halves(plate)


def _core_sides(g: CarrierGeometry, centre: np.ndarray, around: np.ndarray, sides: np.ndarray) -> list[np.ndarray]:
    """The core's right, upper and left side."""
    reach = _CORE * g.r_bolt
    corners = [centre + reach * direction(angle) for angle in (0, _OUTWARD, _INWARD, math.pi)]
    shares = (around, sides, around)
    return [a + np.outer(t, b - a) for a, b, t in zip(corners[:-1], corners[1:], shares, strict=True)]


def _edges_of_plate(g: CarrierGeometry, around: np.ndarray, sides: np.ndarray) -> list[np.ndarray]:
    """Outer edge from the middle to the cut, the cut inwards, the bore's edge from the cut to the middle."""
    half = math.pi / g.planets
    cut = (g.r_o + (g.r_bore - g.r_o) * sides)[:, None] * direction(half)
    return [g.r_o * direction(half * around), cut, g.r_bore * direction(half * (1 - around))]


def _joined(curves: list[np.ndarray]) -> list[np.ndarray]:
    """The same curves with exactly common ends, the first and last one on y = 0 exactly."""
    curves = [curve.copy() for curve in curves]
    for before, after in zip(curves[:-1], curves[1:], strict=True):
        after[0] = before[-1]
    curves[0][0, 1] = curves[-1][-1, 1] = 0.0
    return curves


def _between(inner: np.ndarray, outer: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Lattice between two curves (P, 2) with straight lines across, at shares `depth` (Q,)."""
    rungs = [inner[k] + np.outer(depth, outer[k] - inner[k]) for k in (0, -1)]
    for rung, k in zip(rungs, (0, -1), strict=True):
        rung[0], rung[-1] = inner[k], outer[k]
    return transfinite(rungs[0], rungs[1], inner, outer)


def _both_halves(blocks: list[np.ndarray]) -> np.ndarray:
    upper = np.concatenate(blocks)
    return np.concatenate([upper, mirrored(upper)])


def _sets(g: CarrierGeometry, nodes: np.ndarray) -> dict[str, np.ndarray]:
    slack = _TOLERANCE * g.r_o
    bore = np.abs(np.hypot(nodes[:, 0], nodes[:, 1]) - g.r_bore) < slack
    on_bolt = np.abs(np.hypot(nodes[:, 0] - g.a, nodes[:, 1]) - g.r_bolt) < slack
    return {"bore": np.flatnonzero(bore), "bolt": np.flatnonzero(on_bolt & (nodes[:, 2] > -g.seat / 2 - slack))}


def _cuts(g: CarrierGeometry, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of the cut at −π/N and, in the same order, of that at +π/N."""
    half = math.pi / g.planets
    across = nodes[:, 1] * math.cos(half) - nodes[:, 0] * math.sin(half)
    plus = np.flatnonzero(np.abs(across) < _TOLERANCE * g.r_o)
    _, minus = cKDTree(nodes).query(nodes[plus] * [1, -1, 1])
    return minus, plus
