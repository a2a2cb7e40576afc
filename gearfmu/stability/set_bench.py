"""The set the scenes run on: the shipped planetary set with pins out of their places, variants of it, how a run of it is
driven, recorded and judged. A set of equal planets on ideal pins hides the modes of sun and carrier: no scene has one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from gearfmu.body import ReducedBody, load_bodies
from gearfmu.geometry.gear import GearGeometry
from gearfmu.kernel import Kernel
from gearfmu.spec.planetary import PlanetarySpec
from gearfmu.spec.ports import PortSpec
from gearfmu.spec.stage import load_stage
from gearfmu.stability.bench import kernel
from gearfmu.stability.case import Case, Finding
from gearfmu.stability.checks import CLEARANCE, ENERGY, deep, judged, near
from gearfmu.stability.motion import Motion, Step
from gearfmu.stability.record import Inputs, Record, Stopped, Watched, run
from gearfmu.stage import StageModel, assemble

SET = "planetary54"
PLANETS, SHAFTS = 4, ("carrier", "sun")
NAMES = tuple(f"planet{k + 1}" for k in range(PLANETS))
CENTRALS = ("sun", "ring")
MESHES = {central: tuple(f"{central}_{planet}" for planet in NAMES) for central in CENTRALS}
ALL_MESHES = MESHES["sun"] + MESHES["ring"]
PLACES = tuple(
    f"{body}.{axis}" for body in ("sun.gear", "ring.gear", *(f"pin.{planet}" for planet in NAMES)) for axis in "xy"
)
WATCHED = Watched(ALL_MESHES, SHAFTS, more=(*PLACES, "planet1.gear.w"))
H = 2e-5  # s, communication step
NOMINAL, SPEED, RATIO = 600.0, 85.0, 4.0  # N·m and rad/s of the carrier (ICSV22 2015); sun over carrier
Pins = tuple[tuple[int, tuple[float, float]], ...]
UNEQUAL: Pins = ((0, (0.0, 12e-6)), (1, (6e-6, 0.0)), (2, (0.0, -8e-6)))  # number of the pin, (radial, tangential), m
DRIVEN = PortSpec(kind="spring", k=50e3, c=10.0)  # of the carrier: 0.3 of critical for the whole set
TORQUE = PortSpec(kind="torque")
SOFTNESS = {"sun": 11.4e-9, "ring": 17.4e-9}  # m/N: overlap of the flanks at rest under 1774 N a mesh
MARGIN = 1.5  # of that: inertia of planets between mesh and pin, softer flanks near their tips
# thin teeth of the pair's table bend no more than these; what is added for bolts, plate and rim of the ring is in them


@dataclass(frozen=True)
class SetVariant:
    """The shipped set with changes. pins: deviations of single pins, number and (radial, tangential), m. sun, pin,
    carrier: stiffness of these bearings, N/m, None for the set's. relief: with tip relief. ports: of carrier and sun.
    ring: a port that holds the ring; without one it stands."""

    pins: Pins = UNEQUAL
    sun: float | None = None
    pin: float | None = None
    carrier: float | None = None
    relief: bool = True
    ports: tuple[PortSpec, PortSpec] = (DRIVEN, TORQUE)
    ring: PortSpec | None = None

    @property
    def watched(self) -> Watched:
        """What is recorded of it."""
        return replace(WATCHED, ports=SHAFTS if self.ring is None else (*SHAFTS, "ring"))


PLAIN_SET = SetVariant()


@lru_cache(maxsize=1)
def set_bodies() -> list[ReducedBody]:
    """Sun, planet, ring and carrier, as shipped."""
    return load_bodies(load_stage(SET))


@lru_cache(maxsize=2)
def set_model(variant: SetVariant) -> StageModel:
    """The assembled set of a variant (110 MB)."""
    return assemble(set_spec(variant), set_bodies())


def set_spec(variant: SetVariant) -> PlanetarySpec:
    """The shipped set with the changes of a variant."""
    spec = load_stage(SET)
    assert isinstance(spec, PlanetarySpec)
    parts = {"sun": (spec.sun, variant.sun), "planet": (spec.planet, variant.pin), "carrier": (spec.carrier, variant.carrier)}
    changed = {}
    for name, (part, stiffness) in parts.items():
        update = {} if stiffness is None else {"bearing": part.bearing.model_copy(update={"stiffness": stiffness})}
        if not variant.relief and name != "carrier":
            update["tip_relief"] = None
        changed[name] = part.model_copy(update=update)
    ports = dict(zip(SHAFTS, variant.ports, strict=True)) | ({} if variant.ring is None else {"ring": variant.ring})
    displaced = spec.set.model_copy(update={"pin_errors": dict(variant.pins)})
    return spec.model_copy(update={**changed, "set": displaced, "ports": ports})


def set_kernel(variant: SetVariant, case: Case, parameters: Mapping[str, float] | None = None) -> Kernel:
    """A fresh instance at the case's level and step."""
    return kernel(set_model(variant), case, parameters)


@lru_cache(maxsize=1)
def base_radius() -> float:
    """Base radius of the sun, m."""
    spec = load_stage(SET)
    assert isinstance(spec, PlanetarySpec)
    return float(GearGeometry.of(spec.sun, spec.set).r_b)


@dataclass(frozen=True)
class Carried:
    """Inputs: the outer end of the carrier's spring turns as `motion` says, `loads` (steps of carrier torque, N·m, one
    after the other) weigh on the sun."""

    motion: object
    loads: tuple[Step, ...]

    def __call__(self, time: float) -> Mapping[str, float]:
        turn = self.motion(time)  # type: ignore[operator]
        assert isinstance(turn, Motion)
        step = next((step for step in self.loads if time < step.end), self.loads[-1])
        return {
            "carrier.phi": turn.phi,
            "carrier.w": turn.w,
            "carrier.a": turn.a,
            "sun.tau": -step(time).phi / RATIO,
        }


def steady(torque: float) -> tuple[Step, ...]:
    """A carrier torque (N·m) that stays."""
    return (Step(0.0, 1.0, torque, torque),)


def set_run(
    variant: SetVariant,
    case: Case,
    inputs: Inputs,
    duration: float,
    parameters: Mapping[str, float] | None = None,
    step: float = H,
) -> Record:
    """A run, or what there is of it where the kernel gave up. The sun starts with the speed that the carrier asks."""
    start = {"sun.w_start": RATIO * inputs(0.0).get("carrier.w", 0.0)} if variant.ports[1].kind == "torque" else {}
    going = set_kernel(variant, case, start | dict(parameters or {}))
    try:
        return run(going, inputs, duration, step, variant.watched)
    except Stopped as stop:
        return stop.record


def sun_torque(record: Record, since: float) -> float:
    """Mean torque (N·m) of all sun meshes on the sun from `since` (s) on; positive where a turning carrier drives."""
    late = record.time[1:] > since
    force = sum(record[f"{mesh}.force_mean"][1:][late].mean() for mesh in MESHES["sun"])
    return -base_radius() * float(force)


def carries(record: Record, torque: float, since: float, limit: float = 0.02) -> tuple[list[str], dict[str, float]]:
    """Complaints where the sun's meshes do not carry a carrier torque (N·m) from `since` (s) on; and what they do."""
    if record.time[-1] <= since:
        return [], {}
    carried = RATIO * sun_torque(record, since)
    return near("torque on the carrier that its meshes carry", carried, torque, limit), {"carried_Nm": carried}


def shares(record: Record, since: float, central: str = "sun") -> np.ndarray:
    """(N,) mean force of each planet's mesh over the mean of all, from `since` (s) on."""
    late = record.time > since
    force = np.array([record[f"{mesh}.force_mean"][late].mean() for mesh in MESHES[central]])
    return np.asarray(force / force.mean())


def set_finding(
    variant: SetVariant,
    record: Record,
    complaints: Iterable[str] = (),
    facts: Mapping[str, float] | None = None,
    backlash: float | None = None,
    energy: float = ENERGY,
) -> Finding:
    """The finding of a run. backlash: m, where it is not the set's. energy: limit of the residual."""
    deepest, said = 0.0, []
    for central, meshes in MESHES.items():
        largest = max(record[f"{mesh}.force_max"].max() for mesh in meshes)
        pressed = np.full(record.time.size, CLEARANCE + MARGIN * SOFTNESS[central] * largest)
        for number, mesh in enumerate(meshes):
            depth = set_overlap(variant, record, central, number, backlash)
            said += deep(record, depth, pressed, f"flanks of {mesh}")
            deepest = max(deepest, float(depth.max()))
    return judged(record, deepest, [*said, *complaints], facts or {}, energy)


def set_overlap(
    variant: SetVariant, record: Record, central: str, number: int, backlash: float | None = None
) -> np.ndarray:
    """(n,) overlap of the undeformed involutes of a planet and the sun or the ring, m, on the drive or the coast side,
    whichever is larger: transmission error of the engagement and, along the line of action, places of the central gear
    and of the pin in the axes of the carrier. What bolts and plate give is left in it."""
    spec = set_spec(variant).set
    alpha, gamma = spec.pressure_angle, 2 * math.pi * number / PLANETS
    play = (spec.backlash if backlash is None else backlash) * math.cos(alpha)
    radial, tangential = spec.pin_errors.get(number, (0.0, 0.0))
    x, y = (record[f"pin.{NAMES[number]}.{axis}"] - record[f"{central}.gear.{axis}"] for axis in "xy")
    outward = radial + x * math.cos(gamma) + y * math.sin(gamma)
    ahead = tangential - x * math.sin(gamma) + y * math.cos(gamma)
    outer = -1.0 if central == "sun" else 1.0  # a planet that moves outward leaves the sun and meets the ring
    te = record[f"{central}_{NAMES[number]}.te"] + outer * ahead * math.cos(alpha)
    return np.maximum(te, -te - play) + outer * outward * math.sin(alpha)
