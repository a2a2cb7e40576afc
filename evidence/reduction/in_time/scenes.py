"""The intermediate models of the paper as assemblies: carrier + one planet, carrier + planet + sun, planet + ring.

Bodies, pin, bearings and backlash are those of the shipped planetary54; the planet of bolt 0 alone is there. Nothing is
damped. `carrier_planet`: a quarter of the paper's 600 N·m acts on the carrier's bore, growing within 0.1 ms.
`hammering`: carrier and planet turn at 25 rad/s about the axis besides, the sun is at rest, and the teeth are in the
middle of their backlash: they meet, let go and meet again. `ring_hammering`: the same of a planet that turns on a pin
that stands, and the ring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from evidence.reduction.in_time.contact_points import Grid, Placed, Points, contact_points
from evidence.reduction.in_time.transient import Assembly, Joints, Member
from gearfmu.fem import hex20
from gearfmu.femesh.mesh import rotated
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry.mesh import contact_modulus, half_width
from gearfmu.reduction.carrier import carrier_elements, scaled_sector
from gearfmu.reduction.couplings import Coupling, Elements, full_order
from gearfmu.reduction.full_order import FullOrder, Interface
from gearfmu.reduction.toothed import toothed_full_order
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import set_geometry
from gearfmu.stagefile.stage import load_stage

TORQUE, RAMP = 150.0, 0.1e-3  # N·m, s
SPEED = 25.0  # rad/s of carrier and planet where they hammer
GRID = Grid(along=41, across=5, reach=0.12e-3)
FIVE = ("ux", "uy", "uz", "rx", "ry")  # what a bearing holds


@dataclass(frozen=True, eq=False)
class Solid:
    """A body in axes of the set about its centre. inputs: of a ring, `full` with the interfaces alone by which it is
    reduced, without the points of its flanks."""

    full: FullOrder
    inputs: FullOrder | None = None

    def index(self, interface: str, component: str) -> int:
        """Number of a row among all rows of the interfaces."""
        labels = [(i.name, c) for i in self.full.interfaces for c in i.components]
        return labels.index((interface, component))


@dataclass(frozen=True, eq=False)
class Scene:
    """solids by name in the order of the assembly's members; radius (m) on which the bolts stand."""

    solids: dict[str, Solid]
    assembly: Assembly
    radius: float


@dataclass(frozen=True)
class Meshes:
    """Factors on the element counts of planetary54's stage file."""

    carrier: float = 0.5
    gear: float = 0.25
    ring: float = 0.25


def carrier_planet(meshes: Meshes) -> Scene:
    """Fig. 3: the carrier is driven, the planet hangs on its pin."""
    stage = load_stage("planetary54")
    spec = stage.written
    planet = placed_planet(spec, meshes)
    solids = {"carrier": _carrier(stage, meshes), "planet": gear("planet", planet, spec.planet.material)}
    return scene(spec, solids, (np.zeros(6), np.zeros(6)))


def hammering(meshes: Meshes) -> Scene:
    """Fig. 4: the planet's teeth meet those of the sun."""
    stage = load_stage("planetary54")
    spec = stage.written
    mesh, planet = set_geometry(spec).sun_mesh, placed_planet(spec, meshes)
    # the tooth or space that the planet shows the sun meets a space or tooth
    angle = 0.0 if spec.planet.teeth % 2 else np.pi / spec.sun.teeth
    sun = placed_gear(spec.sun, mesh.gears[0], np.zeros(2), angle, meshes.gear)
    points = points_in_the_middle(planet, sun, mesh)
    solids = {
        "carrier": _carrier(stage, meshes),
        "planet": gear("planet", planet, spec.planet.material, points.rows[0]),
        "sun": gear("sun", sun, spec.sun.material, points.rows[1]),
    }
    roll, turning = mesh.path["C"], SPEED * np.eye(6)[5]
    start = (turning, turning + SPEED * spec.set.center_distance * np.eye(6)[1], np.zeros(6))
    return scene(spec, solids, start, points, roll * (mesh.length - roll) / mesh.length)


def ring_hammering(meshes: Meshes) -> Scene:
    """The planet's teeth meet those of the elastic ring on its mounts. The ring is reduced from 54 input nodes, one a
    tooth, as in the paper; contact points are read from its motion."""
    stage = load_stage("planetary54")
    spec = stage.written
    mesh, planet, ring = set_geometry(spec).ring_mesh, placed_planet(spec, meshes), placed_ring(spec, meshes)
    points = points_in_the_middle(planet, ring, mesh)
    inputs = toothed_full_order(stage.by_file["ring"], stage.mounts, meshes.ring)
    solids = {
        "planet": gear("planet", planet, spec.planet.material, points.rows[0]),
        "ring": Solid(with_flank(inputs, points.rows[1]), inputs),
    }
    roll, start = mesh.path["C"], (SPEED * np.eye(6)[5], np.zeros(0))
    return scene(spec, solids, start, points, roll * (mesh.length + roll) / mesh.length)


def scene(
    spec: Any, solids: dict[str, Solid], start: tuple[np.ndarray, ...], points: Points | None = None, curve: float = 0.0
) -> Scene:
    """All bodies unreduced on their supports, TORQUE on the bore of a carrier. curve: relative radius of curvature (m)
    of the teeth that touch at the points."""
    joints = _supports(spec, solids)
    if points:
        joints = touching(joints, solids, points, foundation(spec, curve))
    patterns = {name: np.zeros(solid.full.rows().shape[0]) for name, solid in solids.items()}
    if "carrier" in solids:
        patterns["carrier"][solids["carrier"].index("bore", "rz")] = TORQUE
    members = tuple(Member.whole(solid.full) for solid in solids.values())
    assembly = Assembly(members, joints, tuple(patterns.values()), _ramp, start)
    return Scene(solids, assembly, spec.set.center_distance)


def _ramp(time: float) -> float:
    """Half a cosine from 0 to 1: the 0.1 ms of a tooth contact, from which the paper's 10 kHz come."""
    return 0.5 * (1 - math.cos(math.pi * min(time / RAMP, 1.0)))


def _carrier(stage: Stage, meshes: Meshes) -> Solid:
    carrier = stage.by_file["carrier"]
    elements, couplings = carrier_elements(carrier, scaled_sector(carrier, meshes.carrier))
    return Solid(full_order("carrier", elements, couplings, ("bore",), stage.written.set.center_distance))


def placed_planet(spec: Any, meshes: Meshes) -> Placed:
    """The planet of bolt 0, tooth 0 on +x."""
    centre = np.array([spec.set.center_distance, 0.0])
    return placed_gear(spec.planet, set_geometry(spec).sun_mesh.gears[1], centre, 0.0, meshes.gear)


def points_in_the_middle(planet: Placed, other: Placed, mesh: Any) -> Points:
    """Contact points of two gears whose teeth stand in the middle of their backlash."""
    play = (mesh.normal_backlash - mesh.nominal_backlash * np.cos(mesh.alpha_wt)) / 2
    return contact_points(planet, other, GRID, {1: play, -1: play})


def placed_gear(gear: Any, geometry: Any, centre: np.ndarray, angle: float, scale: float) -> Placed:
    """A gear of a stage file where it stands; scale : factor on its element counts."""
    counts = gear.body.mesh
    sector = gear_sector(geometry, gear.face_width, counts.model_copy(update={"scale": counts.scale * scale}))
    return Placed(sector, geometry, centre, angle)


def placed_ring(spec: Any, meshes: Meshes) -> Placed:
    """The ring of the set's file, space 0 on +x, where the planet of bolt 0 has its tooth 0."""
    return placed_gear(spec.ring, set_geometry(spec).ring_mesh.ring, np.zeros(2), 0.0, meshes.ring)


def gear(name: str, placed: Placed, material: hex20.Material, flank: sp.csr_array | None = None) -> Solid:
    """A gear with its bore as averaging node and, where it touches another, rows of its contact points."""
    mesh = placed.sector.full()
    nodes = rotated(mesh.nodes, placed.angle)
    elements = Elements(nodes, mesh.elements, *hex20.assemble(nodes, mesh.elements, material))
    bore = Coupling("bore", "averaging", mesh.sets["bore"], np.zeros(3))
    full = full_order(name, elements, [bore], ("bore",), placed.geometry.r)
    return Solid(full if flank is None else with_flank(full, flank))


def with_flank(body: FullOrder, flank: sp.csr_array) -> FullOrder:
    """The body with rows (c, 3N) of its contact points."""
    labels = tuple(f"n{k}" for k in range(flank.shape[0]))
    return replace(body, interfaces=(*body.interfaces, Interface("flank", flank, labels, np.zeros(3), "strip")))


def _supports(spec: Any, solids: dict[str, Solid]) -> Joints:
    """Pin of the planet on bolt 0, which stands where there is no carrier, bearings of carrier and sun on the ground:
    stiffness as in the stage file."""
    ends = (
        (spec.planet.bearing, (("planet", "bore", 1.0), ("carrier", "bolt0", -1.0))),
        (spec.carrier.bearing, (("carrier", "bore", 1.0),)),
        (spec.sun.bearing, (("sun", "bore", 1.0),)),
    )
    stiffness: list[float] = []
    entries = []
    for bearing, sides in ends:
        there = [side for side in sides if side[0] in solids]
        five = (bearing.stiffness, bearing.stiffness, bearing.axial, bearing.tilt, bearing.tilt)
        for component, k in zip(FIVE, five if there else (), strict=bool(there)):
            entries += [(len(stiffness), name, solids[name].index(at, component), sign) for name, at, sign in there]
            stiffness.append(k)
    count = len(stiffness)
    return Joints(joint_rows(solids, entries, count), np.array(stiffness), np.zeros(count), np.zeros(count, bool))


def joint_rows(
    solids: dict[str, Solid], entries: list[tuple[int, str, int, float]], count: int
) -> tuple[sp.csr_array, ...]:
    """Joint rows of every solid: entries are (joint, solid, row of its interfaces, sign)."""
    result = []
    for name, solid in solids.items():
        own = np.array([(joint, row, sign) for joint, owner, row, sign in entries if owner == name]).reshape(-1, 3)
        at = (own[:, 0].astype(int), own[:, 1].astype(int))
        result.append(sp.csr_array((own[:, 2], at), shape=(count, solid.full.rows().shape[0])))
    return tuple(result)


def touching(joints: Joints, solids: dict[str, Solid], points: Points, penalty: float) -> Joints:
    """The joints and, after them, a contact at every point, penalty (N/m³) times its area stiff."""
    count = len(points.gap)
    touching_ones = [(name, solid) for name, solid in solids.items() if solid.full.interfaces[-1].name == "flank"]
    at = {name: solid.index("flank", "n0") for name, solid in touching_ones}
    entries = [(k, name, first + k, 1.0) for name, first in at.items() for k in range(count)]
    contacts = joint_rows(solids, entries, count)
    rows = tuple(sp.csr_array(sp.vstack(both)) for both in zip(joints.rows, contacts, strict=True))
    return Joints(
        rows,
        np.concatenate([joints.stiffness, penalty * points.area]),
        np.concatenate([joints.gap, points.gap]),
        np.concatenate([joints.unilateral, np.ones(count, bool)]),
    )


def foundation(spec: Any, radius: float) -> float:
    """N/m³, 3π E*/(8 b): an elastic foundation with Hertz's half-width b under TORQUE (theory, eq. 8j), for a relative
    radius of curvature (m)."""
    a, b = spec.sun.material, spec.planet.material
    modulus = contact_modulus((a.youngs_modulus, b.youngs_modulus), (a.poisson_ratio, b.poisson_ratio))
    force = TORQUE / (1 + spec.ring.teeth / spec.sun.teeth) / set_geometry(spec).sun_mesh.gears[0].r_b
    return 3 * np.pi * modulus / (8 * half_width(force / spec.planet.face_width, radius, modulus))
