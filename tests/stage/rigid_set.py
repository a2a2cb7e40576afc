"""Planetary sets of rigid bodies made without finite elements: given masses and inertias, every tooth yields alike.

The spec is that of planetary54 with other teeth, places, springs and planets; what `assemble` reads of a reduced body
is written by hand. A flank yields by half of 1/k at every roll, on its own tooth alone, and its material is so hard
that the local law adds 1e-9 of that: a mesh is a linear spring k for every pair of teeth in contact. A helical tooth
in more slices than width functions needs flanks of steel: without local compliance forces are not unique.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from handmade import mass_matrix, toothed

from gearfmu.body.body import Body, How, Node
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import GROUND
from gearfmu.kernel.linear import SPIN as TURNS
from gearfmu.modes.linear import Linearised
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.assemble import mount_sets
from gearfmu.stage.assembly.groups import SPIN, Group
from gearfmu.stage.assembly.layout import stage_layout
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import set_geometries
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import PortSpec

HARD = 5e19  # Pa: the local compliance stays above the least that a model may have
TORQUE = PortSpec(kind="torque")
WIDTH, EDGE = 2.0, 1e-6  # m
SPRINGS = {"level": 0.0, "slices": 1.0, "effect.hertz": 0.0, "effect.tip_contact": 0.0}
WEAK = 1e-200  # kg^-½: its square is 0
OUT_OF_PLANE = 1e8  # N/m and N·m/rad: nothing excites it


@dataclass(frozen=True)
class Rigid:
    """One body. mass (kg), inertia over the square of its radius (kg), radial stiffness of its bearing or pin (N/m)."""

    mass: float
    inertia: float
    bearing: float


@dataclass(frozen=True)
class RigidSet:
    """teeth of sun and planet; contact_ratio of both meshes; mesh (N/m): of one pair of teeth; ring_twist (N/m):
    stiffness against turning of the ring over the square of its base radius; torque (N·m) on the carrier: the static
    load is small beside what the teeth would need to leave their places; youngs_modulus (Pa): of the flanks."""

    planets: int
    teeth: tuple[int, int] = (26, 34)
    contact_ratio: float = 1.02
    module: float = 3.3e-3
    pressure_angle: float = math.radians(24.6)
    mesh: float = 5e8
    ring_twist: float = 1e9
    sun: Rigid = Rigid(0.4, 0.39, 1e8)
    ring: Rigid = Rigid(2.35, 3.0, 1e8)
    carrier: Rigid = Rigid(5.43, 6.29, 1e8)
    planet: Rigid = Rigid(0.66, 0.61, 1e8)
    pins: dict[int, tuple[float, float]] = field(default_factory=dict)
    positions: tuple[int, ...] | None = None
    damping_ratio: float = 0.0
    contact_damping: float = 0.0
    ports: Mapping[str, PortSpec] = field(default_factory=dict)
    helix_angle: float = 0.0
    width: float = WIDTH
    slices: int = 1
    functions: int = 1
    youngs_modulus: float = HARD

    @property
    def transverse(self) -> tuple[float, float]:
        """Module (m) and pressure angle (rad) of the transverse section; `module` and `pressure_angle` are normal."""
        cosine = math.cos(self.helix_angle)
        return self.module / cosine, math.atan(math.tan(self.pressure_angle) / cosine)

    @property
    def ring_teeth(self) -> int:
        return self.teeth[0] + 2 * self.teeth[1]

    @property
    def distance(self) -> float:
        return self.transverse[0] * sum(self.teeth) / 2

    @property
    def ratio(self) -> float:
        """Speed of the sun over that of the carrier."""
        return 1 + self.ring_teeth / self.teeth[0]

    def base(self, name: str) -> float:
        """Radius (m) of u = r θ."""
        if name == "carrier":
            return self.distance
        teeth = {"sun": self.teeth[0], "planet": self.teeth[1], "ring": self.ring_teeth}[name]
        module, angle = self.transverse
        return module * teeth / 2 * math.cos(angle)

    def angles(self) -> np.ndarray:
        """(N,) rad: places of the planets."""
        steps = self.teeth[0] + self.ring_teeth
        places = self.positions or [steps * k / self.planets for k in range(self.planets)]
        return 2 * np.pi * np.asarray(places) / steps

    def spec(self) -> Stage:
        """The set in the terms of a stage file: hard gears without relief, sharp tips that give the contact ratio."""
        shipped = load_stage("planetary54")
        own, radius = shipped.written, math.sqrt(self.ring_twist / self.ring.bearing) * self.base("ring")
        update = {
            "normal_module": self.module,
            "pressure_angle": self.pressure_angle,
            "planets": self.planets,
            "center_distance": self.distance,
            "backlash": 60e-6,
            "pin_errors": self.pins,
            "load_sharing": 4.0,
            "helix_angle": self.helix_angle,
        }
        springs = {"points": 1, "stiffness": self.ring.bearing, "damping_ratio": self.damping_ratio}
        gears = {}
        for name, teeth in zip(("sun", "planet", "ring"), (*self.teeth, self.ring_teeth), strict=True):
            gear = getattr(own, name)
            hard = gear.material.model_copy(update={"youngs_modulus": self.youngs_modulus})
            of_gear = {"teeth": teeth, "face_width": self.width, "material": hard}
            of_gear |= {"tip_edge_radius": EDGE, "tip_diameter": self._tip(name)}
            if name == "ring":
                of_gear |= {"rim_diameter": 2 * radius, "mounts": own.ring.mounts.model_copy(update=springs)}
            else:
                of_gear |= {"tip_relief": None, "bearing": self._bearing(getattr(self, name))}
            gears[name] = gear.model_copy(update=of_gear)
        contact = {"slices": self.slices, "damping": self.contact_damping / self.width}
        return rewritten(
            shipped,
            name="rigid_set",
            set=own.set.model_copy(update=update | ({"positions": self.positions} if self.positions else {})),
            carrier=own.carrier.model_copy(update={"bearing": self._bearing(self.carrier)}),
            ports={"carrier": TORQUE, "sun": TORQUE} | dict(self.ports),
            contact=own.contact.model_copy(update=contact),
            **gears,
        )

    def _tip(self, name: str) -> float:
        """Tip diameter (m): the flank ends half the length of contact beyond the pitch point."""
        module, angle = self.transverse
        half = self.contact_ratio / 2 * math.pi * module * math.cos(angle)
        r_b = self.base(name)
        roll = r_b * math.tan(angle) + (-half if name == "ring" else half)
        return 2 * (math.hypot(roll + EDGE, r_b) + (-EDGE if name == "ring" else EDGE))

    def _bearing(self, body: Rigid) -> Any:
        shipped = load_stage("planetary54").written.sun.bearing
        springs = {"stiffness": body.bearing, "axial": OUT_OF_PLANE, "tilt": OUT_OF_PLANE}
        return shipped.model_copy(update=springs | {"damping_ratio": self.damping_ratio})

    def bodies(self) -> list[Any]:
        """Sun, planet, ring and carrier as `assemble` reads them."""
        spec = self.spec()
        gears = [
            _gear(self, gear, shape)
            for gear, shape in zip(spec.written.gears, set_geometries(spec.written), strict=True)
        ]
        return [*gears, _carrier(self)]

    def model(self) -> StageModel:
        return assemble(self.spec(), self.bodies(), rolls=4)


def kernel_of(model: StageModel, **parameters: float) -> Kernel:
    """Prepared: nothing but springs of the meshes, one slice."""
    kernel = Kernel(model.blob, SPRINGS | parameters)
    kernel.prepare()
    return kernel


def _gear(rigid: RigidSet, gear: Any, shape: Any) -> Body:
    """One invented mode far above everything, so weak that its products underflow: tables are not empty."""
    body: Rigid = getattr(rigid, gear.name)
    rolls, z, a = 4, gear.teeth, rigid.functions
    middle, half = (shape.s_form + shape.s_tip) / 2, abs(shape.s_tip - shape.s_form) / 2
    static = np.zeros((2, 2, z, rolls, rolls, a, a))
    for flank in (0, 1):
        for degree in range(a):  # a foundation: every place across the width yields by itself
            static[flank, flank, 0, ..., degree, degree] = 0.5 / rigid.mesh / (2 * degree + 1)
    polar = body.inertia * shape.r_b**2
    flank = {
        "teeth": z,
        "r_b": shape.r_b,
        "face_width": gear.face_width,
        "strip_half_width": gear.body.strip_half_width,
        "roll": middle - half * np.cos((2 * np.arange(rolls) + 1) * np.pi / (2 * rolls)),
        "diameter": np.zeros(1, int),
        "part": np.zeros(1, int),
        "parity": np.zeros(1, int),
        "rows": np.full((2, rolls, a, 1), WEAK),
        "static": static,
        "node": np.zeros((2, rolls, a, 6)),
    }
    return toothed(
        gear.name,
        flank,
        mass_matrix(body.mass, np.diag([polar / 2, polar / 2, polar])),
        frequency=np.array([1e7]),
        damping_ratio=np.zeros(1),
        rows=np.full((6, 1), WEAK),
        static=np.zeros((6, 6)),
    )


def _carrier(rigid: RigidSet) -> Body:
    """Its centre of mass, bore and bolts in the plane of the planets."""
    polar = rigid.carrier.inertia * rigid.distance**2
    angles = rigid.angles()
    point = np.vstack([np.zeros(3), np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1) * rigid.distance])
    names = ["bore", *(f"bolt{k}" for k in range(rigid.planets))]
    m = 6 * len(point)
    return Body(
        name="carrier",
        how=How("0" * 64, "rigid"),
        mass=np.diag([rigid.carrier.mass] * 3 + [polar / 2, polar / 2, polar]),
        frequency=np.zeros(0),
        damping_ratio=np.zeros(0),
        nodes=tuple(Node(name, "rigid", COMPONENTS, place) for name, place in zip(names, point, strict=True)),
        rows=np.zeros((m, 0)),
        static=np.zeros((m, m)),
    )


@dataclass(frozen=True)
class Motion:
    """What the coordinates of a kernel's linear model move: x, y and u = r θ of carrier, ring, sun, then of every
    planet along radius and tangent, as in lin_parker.py."""

    rigid: RigidSet
    model: StageModel

    def group(self) -> Group:
        stage, bodies = self.model.stage, self.model.stage.by_name(self.rigid.bodies())
        gears = [bodies[gear.name] for gear in stage.gears]
        return mount_sets(stage_layout(stage, gears, carriers={"carrier": bodies["carrier"]}))[0]

    def plane_modes(self, system: Linearised) -> tuple[np.ndarray, np.ndarray]:
        """Natural frequencies (k,) Hz, ascending, of the motions in the plane, and their shapes (9 + 3N, k)."""
        scale = 1 / np.sqrt(system.linear.mass)
        squared, shapes = np.linalg.eigh(scale[:, None] * system.stiffness * scale)
        moved = self.rows(system) @ (scale[:, None] * shapes)
        inside = np.abs(moved).max(axis=0) > 1e-6
        return np.sqrt(np.clip(squared[inside], 0, None)) / (2 * math.pi), moved[:, inside]

    def rows(self, system: Linearised) -> np.ndarray:
        """(9 + 3N, n)."""
        linear, group, stage = system.linear, self.group(), self.model.stage
        names = [body.name for body in group.layout.bodies]
        turning = [name for name, rotor in stage.rotors.items() if not rotor.stands]
        planets = [f"planet{k + 1}" for k in range(self.rigid.planets)]
        rows = []
        for name in ("carrier", "ring", "sun", *planets):
            body = names.index(name)
            own = np.zeros((3, linear.mass.size))
            ground = linear.group == GROUND
            own[:, ground] = group.rigid(body)[[0, 1, SPIN]][:, linear.number[ground]]
            if name in turning:
                own[2, np.flatnonzero(linear.group == TURNS)[turning.index(name)]] += 1.0
            if name in planets:
                angle = self.rigid.angles()[planets.index(name)]
                carrier = np.flatnonzero(linear.group == TURNS)[turning.index("carrier")]
                own[:2, carrier] += self.rigid.distance * np.array([-math.sin(angle), math.cos(angle)])
                c, s = math.cos(angle), math.sin(angle)
                own[:2] = np.array([[c, s], [-s, c]]) @ own[:2]
            own[2] *= self.rigid.base("planet" if name in planets else name)
            rows.append(own)
        return np.vstack(rows)
