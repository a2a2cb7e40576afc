"""The bench of planetary sets: the shipped set with pins out of their places, and variants of it. Equal planets on
ideal pins hide the modes of sun and carrier: no scene has them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from evidence.stability.bench import Bench, at
from evidence.stability.checks import CLEARANCE
from evidence.stability.motion import Step, Turn
from evidence.stability.record import Inputs, Record, Watched
from gearfmu.body import Body, load_bodies
from gearfmu.body.toothed import reduced_gear
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec, RingSpec
from gearfmu.stagefile.tables.connections import PortSpec

SET = "planetary54"
PLANETS, SHAFTS = 4, ("carrier", "sun")
NAMES = tuple(f"planet{k + 1}" for k in range(PLANETS))
CENTRALS = ("sun", "ring")
MESHES = {central: tuple(f"{central}_{planet}" for planet in NAMES) for central in CENTRALS}
ALL_MESHES = MESHES["sun"] + MESHES["ring"]
PLACES = tuple(
    f"{body}.{axis}" for body in ("sun.gear", "ring.gear", *(f"pin.{planet}" for planet in NAMES)) for axis in "xy"
)
LEANS = tuple(f"bearing.carrier.{axis}" for axis in ("x", "y", "rx", "ry"))
SPEED, RATIO = 85.0, 4.0  # rad/s of the carrier (ICSV22 2015); sun over carrier
Pins = tuple[tuple[int, tuple[float, float]], ...]
UNEQUAL: Pins = ((0, (0.0, 12e-6)), (1, (6e-6, 0.0)), (2, (0.0, -8e-6)))  # number of the pin, (radial, tangential), m
DRIVEN = PortSpec(kind="spring", k=50e3, c=10.0)  # of the carrier: 0.3 of critical for the whole set
TORQUE = PortSpec(kind="torque")
# m/N: overlap of the flanks at rest, where it is largest (one planet on a pin 50 µm off); of the thin ring
SOFTNESS, THIN = {"sun": 8.6e-9, "ring": 23.4e-9}, 44.4e-9
MARGIN = 1.5  # of that: inertia of planets between mesh and pin, softer flanks near their tips


@dataclass(frozen=True)
class PlanetSet(Bench):
    """The shipped set with changes. pins: deviations of single pins, number and (radial, tangential), m. sun, pin,
    carrier: stiffness of these bearings, N/m, None for the set's. relief: with tip relief. thin: with the ring of
    `thin_ring`. ports: of carrier and sun. ring: a port that holds the ring; without one it stands."""

    pins: Pins = UNEQUAL
    sun: float | None = None
    pin: float | None = None
    carrier: float | None = None
    relief: bool = True
    thin: bool = False
    ports: tuple[PortSpec, PortSpec] = (DRIVEN, TORQUE)
    ring: PortSpec | None = None

    kind = "set"
    step, nominal, settled, limit = 2e-5, 600.0, (0.022, 0.012), 0.02
    energy = 5e-4  # not 1e-4: pairs of the ring begin and end with its flanks, and their force with them: 0.1 to 3e-4

    @property
    def watched(self) -> Watched:  # type: ignore[override]
        """All meshes, places of central gears and planets, and how the carrier leans."""
        ports = SHAFTS if self.ring is None else (*SHAFTS, "ring")
        return Watched(ALL_MESHES, ports, more=(*PLACES, *LEANS, "carrier.gear.phi", "sun.gear.w"))

    @property
    def model(self) -> StageModel:
        """Sun, planets, ring and carrier, assembled: some 100 MB."""
        return _model(self)

    def turning(self, motion: Turn, loads: Sequence[Step]) -> Inputs:
        """The outer end of the carrier's spring turns, loads of the carrier weigh on the sun."""

        def inputs(time: float) -> Mapping[str, float]:
            return _ends(motion, time, -at(loads, time)(time).phi / RATIO)

        return inputs

    def dragged(self, motion: Turn, drag: float) -> tuple[PlanetSet, Inputs]:
        """The sun is loose as it is."""
        return self, lambda time: _ends(motion, time, -drag)

    def start(self, inputs: Inputs) -> dict[str, float]:
        """The sun starts with the speed that the carrier asks."""
        turned = RATIO * inputs(0.0).get("carrier.w", 0.0)
        return {"sun.w_start": turned} if self.ports[1].kind == "torque" else {}

    def carried(self, record: Record, since: float, until: float) -> dict[str, float]:
        """Moment of all sun meshes, on the carrier."""
        return {"the sun's meshes": RATIO * sun_torque(record.between(0.0, until), since)}

    def impulse(self, record: Record, drag: float, since: float) -> float:
        """Moment of all meshes on the sun over the run, less the change of its spin."""
        steps, first = np.diff(record.time), 1
        force = np.sum([record[f"{mesh}.force_mean"][1:] for mesh in MESHES["sun"]], axis=0)
        meshes = -base_radius() * float((force[first:] * steps[first:]).sum())
        spin = set_bodies()[0].inertia[2, 2] * (record["sun.gear.w"][-1] - record["sun.gear.w"][first])
        return float((meshes - spin) / (drag * steps[first:].sum()))

    def depths(self, record: Record, backlash: float | None) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Overlap of the undeformed involutes of every planet with sun and ring."""
        for central, meshes in MESHES.items():
            largest = max(record[f"{mesh}.force_max"].max() for mesh in meshes)
            softness = THIN if self.thin and central == "ring" else SOFTNESS[central]
            pressed = np.full(record.time.size, CLEARANCE + MARGIN * softness * largest)
            for number, mesh in enumerate(meshes):
                yield f"flanks of {mesh}", set_overlap(self, record, central, number, backlash), pressed


def _ends(motion: Turn, time: float, load: float) -> dict[str, float]:
    turn = motion(time)
    return {"carrier.phi": turn.phi, "carrier.w": turn.w, "carrier.a": turn.a, "sun.tau": load}


@lru_cache(maxsize=1)
def set_bodies() -> list[Any]:
    """Sun, planet, ring and carrier, as shipped."""
    return load_bodies(load_stage(SET))


@lru_cache(maxsize=1)
def thin_ring() -> tuple[RingSpec, Body]:
    """A ring with 3.4 mm of rim instead of 9 behind its teeth, oval at 0.4 kHz where the shipped one is at 1.6, and its
    body: reduced here in a few seconds, on a coarse mesh."""
    spec = load_stage(SET)
    mesh = MeshSpec(flank=6, thickness=2, root=3, rim=1, width=2)
    body = spec.written.ring.body.model_copy(update={"mesh": mesh, "modes": 160, "roll_points": 12})
    ring = spec.written.ring.model_copy(update={"rim_diameter": 148e-3, "body": body})
    return ring, reduced_gear(rewritten(spec, ring=ring).by_file["ring"])


@lru_cache(maxsize=2)
def _model(variant: PlanetSet) -> StageModel:
    sun, planet, ring, carrier = set_bodies()
    return assemble(set_spec(variant), [sun, planet, thin_ring()[1] if variant.thin else ring, carrier])


def set_spec(variant: PlanetSet) -> Stage:
    """The shipped set with the changes of a variant."""
    spec = load_stage(SET)
    parts: dict[str, tuple[Any, float | None]] = {
        "sun": (spec.written.sun, variant.sun),
        "planet": (spec.written.planet, variant.pin),
        "carrier": (spec.written.carrier, variant.carrier),
    }
    changed: dict[str, Any] = {}
    for name, (part, stiffness) in parts.items():
        update = {} if stiffness is None else {"bearing": part.bearing.model_copy(update={"stiffness": stiffness})}
        if not variant.relief and name != "carrier":
            update["tip_relief"] = None
        changed[name] = part.model_copy(update=update)
    if variant.thin:
        changed["ring"] = thin_ring()[0]
    ports = dict(zip(SHAFTS, variant.ports, strict=True)) | ({} if variant.ring is None else {"ring": variant.ring})
    displaced = spec.written.set.model_copy(update={"pin_errors": dict(variant.pins)})
    return rewritten(spec, **changed, set=displaced, ports=ports)


@lru_cache(maxsize=1)
def base_radius() -> float:
    """Base radius of the sun, m."""
    spec = load_stage(SET)
    return gear_shape(spec.by_file["sun"]).r_b


def sun_torque(record: Record, since: float) -> float:
    """Mean torque (N·m) of all sun meshes on the sun from `since` (s) on; positive where a turning carrier drives."""
    late = record.time[1:] > since
    force = sum(record[f"{mesh}.force_mean"][1:][late].mean() for mesh in MESHES["sun"])
    return -base_radius() * float(force)


def shares(record: Record, since: float, central: str = "sun") -> np.ndarray:
    """(N,) mean force of each planet's mesh over the mean of all, from `since` (s) on."""
    late = record.time > since
    force = np.array([record[f"{mesh}.force_mean"][late].mean() for mesh in MESHES[central]])
    return np.asarray(force / force.mean())


def set_overlap(
    variant: PlanetSet, record: Record, central: str, number: int, backlash: float | None = None
) -> np.ndarray:
    """(n,) overlap of the undeformed involutes of a planet and the sun or the ring, m, on the drive or the coast side,
    whichever is larger: transmission error of the engagement and, along the line of action, places of the planet and of
    the central gear in the axes of the carrier. What bolts, plate and rim of the ring give is left in it."""
    spec = set_spec(variant)
    alpha = spec.written.set.pressure_angle
    play = (spec.written.set.backlash if backlash is None else backlash) * math.cos(alpha)
    radial, tangential = spec.written.set.pin_errors.get(number, (0.0, 0.0))
    arm = 0.5 * (spec.written.carrier.thickness + spec.written.planet.face_width) + spec.written.carrier.gap
    x = record["bearing.carrier.x"] + arm * record["bearing.carrier.ry"] - record[f"{central}.gear.x"]
    y = record["bearing.carrier.y"] - arm * record["bearing.carrier.rx"] - record[f"{central}.gear.y"]
    place = 2 * math.pi * np.arange(PLANETS) / PLANETS
    given = [
        _in_polar(place[k], *(record[f"pin.{NAMES[k]}.{axis}"] for axis in "xy")) for k in range(PLANETS)
    ]  # in the axes of the carrier; x and y are in those of the ground
    away, forward = _in_polar(place[number] + record["carrier.gear.phi"], x, y)
    outward = radial + away + given[number][0]
    ahead = tangential + forward + given[number][1] - _planets_of_carrier(spec) * np.sum([t for _, t in given], axis=0)
    outer = -1.0 if central == "sun" else 1.0  # a planet that moves outward leaves the sun and meets the ring
    te = record[f"{central}_{NAMES[number]}.te"] + outer * ahead * math.cos(alpha)
    return np.maximum(te, -te - play) + outer * outward * math.sin(alpha)


def _in_polar(gamma: float | np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outward and ahead at the angle gamma (rad), of what points along x and y."""
    return x * np.cos(gamma) + y * np.sin(gamma), y * np.cos(gamma) - x * np.sin(gamma)


@lru_cache(maxsize=2)
def _share_of_planet(distance: float) -> float:
    _, planet, _, carrier = set_bodies()
    own = planet.total_mass * distance**2
    return float(own / (carrier.inertia[2, 2] + PLANETS * own))


def _planets_of_carrier(spec: Stage) -> float:
    """The axes of the carrier turn as carrier and planets do in the mean (theory, 17d): where the planets give way on
    their pins, the carrier's own body and its bolts turn on by this part of what each of them gives."""
    return _share_of_planet(spec.written.set.center_distance)
