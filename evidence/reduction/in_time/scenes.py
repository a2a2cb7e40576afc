"""The two intermediate models of the paper as assemblies: carrier + one planet, and carrier + planet + sun.

Bodies, pin, bearings and backlash are those of the shipped planetary54; the planet of bolt 0 alone is there. Nothing is
damped. `carrier_planet`: a quarter of the paper's 600 N·m acts on the carrier's bore, growing within 0.1 ms.
`hammering`: carrier and planet turn at 25 rad/s about the axis besides, the sun is at rest, and the teeth are in the
middle of their backlash: they meet, let go and meet again.
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
from gearfmu.geometry.mesh import PlanetaryGeometry, contact_modulus, half_width
from gearfmu.reduction.carrier import carrier_elements, scaled_sector
from gearfmu.reduction.couplings import Coupling, Elements, full_order
from gearfmu.reduction.full_order import FullOrder, Interface
from gearfmu.stagefile.forms.shapes import set_geometry
from gearfmu.stagefile.stage import load_stage

TORQUE, RAMP = 150.0, 0.1e-3  # N·m, s
SPEED = 25.0  # rad/s of carrier and planet where they hammer
GRID = Grid(along=41, across=5, reach=0.12e-3)
FIVE = ("ux", "uy", "uz", "rx", "ry")  # what a bearing holds


@dataclass(frozen=True, eq=False)
class Solid:
    """A body: elements and couplings in axes of the set about `centre` (3,) m, and the whole body as FullOrder.

    elements : None of a body that no deck is written of. inputs : of a ring, `full` with the interfaces alone by which
    it is reduced, without the points of its flanks.
    """

    centre: np.ndarray
    elements: Elements | None
    couplings: tuple[Coupling, ...]
    full: FullOrder
    inputs: FullOrder | None = None

    def index(self, interface: str, component: str) -> int:
        """Number of a row among all rows of the interfaces."""
        labels = [(i.name, c) for i in self.full.interfaces for c in i.components]
        return labels.index((interface, component))


@dataclass(frozen=True, eq=False)
class Scene:
    """solids by name in the order of the assembly's members; kinds (j,) tells pin, bearings and contacts apart."""

    name: str
    solids: dict[str, Solid]
    assembly: Assembly
    kinds: np.ndarray
    material: hex20.Material
    points: Points | None = None


@dataclass(frozen=True)
class Meshes:
    """Factors on the element counts of planetary54's stage file."""

    carrier: float = 0.5
    gear: float = 0.25
    ring: float = 0.25


def carrier_planet(meshes: Meshes) -> Scene:
    """Fig. 3: the carrier is driven, the planet hangs on its pin."""
    spec = load_stage("planetary54")
    solids = {
        "carrier": _carrier(spec, meshes),
        "planet": gear("planet", _planet(spec, meshes), spec.written.planet.material),
    }
    joints, kinds = _supports(spec, solids)
    at_rest = (np.zeros(6), np.zeros(6))
    return Scene("carrier_planet", solids, _driven(solids, joints, at_rest), kinds, _steel(spec))


def hammering(meshes: Meshes) -> Scene:
    """Fig. 4: the planet's teeth meet those of the sun."""
    spec = load_stage("planetary54")
    geometry = set_geometry(spec.written)
    planet, sun = _planet(spec, meshes), _sun(spec, meshes, geometry)
    mesh = geometry.sun_mesh
    play = (mesh.normal_backlash - nominal_play(mesh)) / 2
    points = contact_points(planet, sun, GRID, {1: play, -1: play})
    solids = {
        "carrier": _carrier(spec, meshes),
        "planet": gear("planet", planet, spec.written.planet.material, points.rows[0]),
        "sun": gear("sun", sun, spec.written.sun.material, points.rows[1]),
    }
    joints, kinds = _supports(spec, solids)
    roll = mesh.path["C"]
    penalty = foundation(spec, roll * (mesh.length - roll) / mesh.length)
    joints, kinds = touching(joints, kinds, solids, points, penalty)
    turning, a = SPEED * np.eye(6)[5], spec.written.set.center_distance
    start = (turning, turning + SPEED * a * np.eye(6)[1], np.zeros(6))
    return Scene("hammering", solids, _driven(solids, joints, start), kinds, _steel(spec), points)


def _driven(solids: dict[str, Solid], joints: Joints, start: tuple[np.ndarray, ...]) -> Assembly:
    """All bodies unreduced, TORQUE on the carrier's bore."""
    patterns = {name: np.zeros(solid.full.rows().shape[0]) for name, solid in solids.items()}
    patterns["carrier"][solids["carrier"].index("bore", "rz")] = TORQUE
    members = tuple(Member.whole(solid.full) for solid in solids.values())
    return Assembly(members, joints, tuple(patterns.values()), _ramp, start)


def _steel(spec: Any) -> hex20.Material:
    """The one material of all bodies."""
    assert spec.written.carrier.material == spec.written.planet.material == spec.written.sun.material
    return spec.written.carrier.material


def _ramp(time: float) -> float:
    """Half a cosine from 0 to 1: the 0.1 ms of a tooth contact, from which the paper's 10 kHz come."""
    return 0.5 * (1 - math.cos(math.pi * min(time / RAMP, 1.0)))


def _carrier(spec: Any, meshes: Meshes) -> Solid:
    carrier = spec.by_file["carrier"]
    elements, couplings = carrier_elements(carrier, scaled_sector(carrier, meshes.carrier))
    full = full_order("carrier", elements, couplings, ("bore",), spec.written.set.center_distance)
    return Solid(np.zeros(3), elements, tuple(couplings), full)


def _planet(spec: Any, meshes: Meshes) -> Placed:
    """The planet of bolt 0, tooth 0 on +x."""
    geometry = set_geometry(spec.written)
    centre = np.array([spec.written.set.center_distance, 0.0])
    return placed_gear(spec.written.planet, geometry.sun_mesh.gears[1], centre, 0.0, meshes.gear)


def _sun(spec: Any, meshes: Meshes, geometry: PlanetaryGeometry) -> Placed:
    """The sun, turned so that the tooth or space that the planet shows it meets a space or tooth."""
    angle = 0.0 if spec.written.planet.teeth % 2 else np.pi / spec.written.sun.teeth
    return placed_gear(spec.written.sun, geometry.sun_mesh.gears[0], np.zeros(2), angle, meshes.gear)


def placed_gear(gear: Any, geometry: Any, centre: np.ndarray, angle: float, scale: float) -> Placed:
    """A gear of a stage file where it stands; scale : factor on its element counts."""
    counts = gear.body.mesh
    sector = gear_sector(geometry, gear.face_width, counts.model_copy(update={"scale": counts.scale * scale}))
    return Placed(sector, geometry, centre, angle)


def gear(name: str, placed: Placed, material: hex20.Material, flank: sp.csr_array | None = None) -> Solid:
    """A gear with its bore as averaging node and, where it touches another, rows of its contact points."""
    mesh = placed.sector.full()
    nodes = rotated(mesh.nodes, placed.angle)
    elements = Elements(nodes, mesh.elements, *hex20.assemble(nodes, mesh.elements, material))
    bore = Coupling("bore", "averaging", mesh.sets["bore"], np.zeros(3))
    full = full_order(name, elements, [bore], ("bore",), placed.geometry.r)
    if flank is not None:
        labels = tuple(f"n{k}" for k in range(flank.shape[0]))
        full = replace(full, interfaces=(*full.interfaces, Interface("flank", flank, labels, np.zeros(3), "strip")))
    return Solid(np.array([*placed.centre, 0.0]), elements, (bore,), full)


def _supports(spec: Any, solids: dict[str, Solid]) -> tuple[Joints, np.ndarray]:
    """Pin of the planet on bolt 0, bearings of carrier and sun on the ground: stiffness as in the stage file."""
    ends = {
        "pin": (spec.written.planet.bearing, (("planet", "bore", 1.0), ("carrier", "bolt0", -1.0))),
        "carrier bearing": (spec.written.carrier.bearing, (("carrier", "bore", 1.0),)),
        "sun bearing": (spec.written.sun.bearing, (("sun", "bore", 1.0),)),
    }
    stiffness, kinds, entries = [], [], []
    for kind, (bearing, sides) in ends.items():
        if sides[0][0] not in solids:
            continue
        for component, k in zip(FIVE, _five(bearing), strict=True):
            entries += [(len(kinds), name, solids[name].index(at, component), sign) for name, at, sign in sides]
            stiffness.append(k)
            kinds.append(kind)
    count = len(kinds)
    joints = Joints(joint_rows(solids, entries, count), np.array(stiffness), np.zeros(count), np.zeros(count, bool))
    return joints, np.array(kinds)


def _five(bearing: Any) -> tuple[float, ...]:
    return (bearing.stiffness, bearing.stiffness, bearing.axial, bearing.tilt, bearing.tilt)


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


def touching(
    joints: Joints, kinds: np.ndarray, solids: dict[str, Solid], points: Points, penalty: float
) -> tuple[Joints, np.ndarray]:
    """The joints and, after them, a contact at every point, penalty (N/m³) times its area stiff."""
    count = len(points.gap)
    touching_ones = [(name, solid) for name, solid in solids.items() if solid.full.interfaces[-1].name == "flank"]
    at = {name: solid.index("flank", "n0") for name, solid in touching_ones}
    entries = [(k, name, first + k, 1.0) for name, first in at.items() for k in range(count)]
    contacts = joint_rows(solids, entries, count)
    rows = tuple(sp.csr_array(sp.vstack(both)) for both in zip(joints.rows, contacts, strict=True))
    return (
        Joints(
            rows,
            np.concatenate([joints.stiffness, penalty * points.area]),
            np.concatenate([joints.gap, points.gap]),
            np.concatenate([joints.unilateral, np.ones(count, bool)]),
        ),
        np.concatenate([kinds, np.full(count, "contact")]),
    )


def nominal_play(mesh: Any) -> float:
    """Gap (m) along the normal of one flank of the nominal teeth while the other one touches."""
    return mesh.nominal_backlash * np.cos(mesh.alpha_wt)


def foundation(spec: Any, radius: float) -> float:
    """N/m³, 3π E*/(8 b): an elastic foundation with Hertz's half-width b under TORQUE (theory, eq. 8j), for a relative
    radius of curvature (m)."""
    a, b = spec.written.sun.material, spec.written.planet.material
    modulus = contact_modulus((a.youngs_modulus, b.youngs_modulus), (a.poisson_ratio, b.poisson_ratio))
    force = (
        TORQUE
        / (1 + spec.written.ring.teeth / spec.written.sun.teeth)
        / set_geometry(spec.written).sun_mesh.gears[0].r_b
    )
    return 3 * np.pi * modulus / (8 * half_width(force / spec.written.planet.face_width, radius, modulus))
