"""The part of a trace in which a shaft gathers or loses speed steadily, and the signals whose orders it shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import make_lsq_spline

from gearfmu.body import Body
from gearfmu.errors import SimulationError
from gearfmu.modes.linear import stage_modes
from gearfmu.report import metrics
from gearfmu.report.campbell import loud
from gearfmu.report.kinds import ACCELERATIONS, FORCES, SENSOR, Kind, averaging, loudest_sensors
from gearfmu.report.signals import GEAR_SPEED, PlanetSet, bearings, on_mounts, recorded
from gearfmu.stage import assemble
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.touching import GEAR_PHI
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import Meshing

LEAST_RANGE = 0.3  # of the mean speed, that the shaft gathers in a run-up
BACKWARD = 0.02  # of it: largest loss on the way, wobble of the drive below one swing per revolution
LEAST_SAMPLES = 5  # between two knots of the spline that follows the angle
SLOWEST = 0.02  # of it: slower than that there are no orders
WHOLE = 0.01  # a mesh frequency over the carrier's that is so near a whole number is that
SET_ORDERS, PAIR_ORDERS, TRAIN_ORDERS = 3, 6, 4  # mesh orders shown
TRAIN_BEARINGS = 2  # directions of bearings shown
LEAST_LOAD = 0.01  # of torque_max: below it flanks may part, and there is neither a cycle nor a linear stage
MODES = 30  # of the linearised stage, the lowest


@dataclass(frozen=True)
class Signal:
    """values (n,), of a kind; averaged: s, over which every sample is a mean; sides: for every mesh order the orders
    beside it, of the carrier, that the signal has by the passing of the planets."""

    values: np.ndarray
    kind: Kind
    averaged: float
    sides: Mapping[int, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Turning:
    """Rotation of a shaft without its vibration: angle (n,) rad, growing where the shaft turns in its own sense, and
    speed (n,) rad/s, positive likewise."""

    angle: np.ndarray
    speed: np.ndarray

    @staticmethod
    def of(time: np.ndarray, angle: np.ndarray) -> Turning:
        """Rotation in the recorded angle (n,) rad at time (n,) s.

        A cubic spline with one knot per revolution is fitted to the angle by least squares. It follows swings that
        take two revolutions or more; those of one revolution and less, which teeth excite, stay out.
        """
        angle = angle if angle[-1] > angle[0] else -angle
        path = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(angle)))))
        knots = _apart(np.searchsorted(path, np.arange(2 * np.pi, path[-1], 2 * np.pi)), time.size)
        if time.size <= LEAST_SAMPLES:
            return Turning(angle, np.gradient(angle, time))
        ends = np.repeat(time[[0, -1]], 4)
        fitted = make_lsq_spline(time, angle, np.concatenate((ends[:4], time[knots], ends[4:])))
        return Turning(fitted(time), fitted(time, 1))

    @property
    def steady(self) -> bool:
        """Does the shaft gather speed, or lose it, steadily and without standing still?"""
        speed = self.speed
        gained, most = speed[-1] - speed[0], max(float(speed.mean()), 1e-9)
        against = speed - np.maximum.accumulate(speed) if gained > 0 else np.minimum.accumulate(speed) - speed
        return bool(
            abs(gained) >= LEAST_RANGE * most and against.min() >= -BACKWARD * most and speed.min() >= SLOWEST * most
        )


def _apart(places: np.ndarray, count: int) -> list[int]:
    """Those of ascending `places` that have LEAST_SAMPLES of `count` samples from each to the next and to the ends."""
    kept = [0]
    for place in places.tolist():
        if place - kept[-1] >= LEAST_SAMPLES and count - place > LEAST_SAMPLES:
            kept.append(place)
    return kept[1:]


@dataclass(frozen=True)
class RunUp:
    """Part of a trace in which a shaft gathers speed (or loses it) steadily, and the shaft's rotation in it.

    families: mesh frequency over the shaft's of every mesh, one of a pair or set; signals by name; resonances: natural
    frequencies of the linearised stage that its transmission error drives, Hz; others: speeds of other shafts over
    this one's, by name.
    """

    part: Trace
    shaft: str
    turning: Turning
    families: Mapping[str, float]
    signals: Mapping[str, Signal]
    resonances: tuple[float, ...] = ()
    orders_shown: int = SET_ORDERS
    others: Mapping[str, float] = field(default_factory=dict)

    @property
    def each(self) -> float:
        """Mesh frequency over the shaft's, of several meshes that of the fastest."""
        return max(self.families.values())

    @property
    def highest(self) -> float:
        """The highest order shown."""
        return (self.orders_shown + 0.3) * self.each

    @property
    def mesh_orders(self) -> list[tuple[str, int, float]]:
        """(mesh, its order k, order of the shaft) of all that are shown."""
        shown = range(1, self.orders_shown + 1)
        return [(mesh, k, k * each) for mesh, each in self.families.items() for k in shown]

    @cached_property
    def orders(self) -> dict[str, metrics.OrderMap]:
        """The order map of every signal."""
        time, angle = self.part.time, self.turning.angle
        return {
            name: metrics.order_map(time, own.values, angle, self.highest, averaged=own.averaged)
            for name, own in self.signals.items()
        }


def run_up_of_set(part: Trace, own: PlanetSet) -> RunUp | None:
    """The run-up of a set in a part of its trace; None where its carrier does not gather speed (or lose it)
    steadily."""
    names = own.meshing.rotor, own.carrier
    if any(f"{name}{GEAR_SPEED}" not in part for name in names) or f"{own.carrier}{GEAR_PHI}" not in part:
        return None
    speeds = {name: part[f"{name}{GEAR_SPEED}"] for name in names}
    turning = Turning.of(part.time, part[f"{own.carrier}{GEAR_PHI}"])
    if not turning.steady:
        return None
    carrier = float(np.mean(np.abs(speeds[own.carrier])))
    each = float(np.mean(np.abs(own.meshing.relative(speeds)))) / carrier * own.meshing.teeth
    each = round(each) if abs(each - round(each)) < WHOLE else each
    signals = _signals(part, own, each)
    return RunUp(part, own.carrier, turning, {"": each}, signals) if signals else None


def run_up_of_meshes(part: Trace, known: Mapping[str, Meshing]) -> RunUp | None:
    """The run-up of a pair or a train in a part of its trace, by gear A of its first engagement; None where that does
    not gather speed (or lose it) steadily, or where gears ride on a carrier."""
    rotors = [meshing.rotor for meshing in known.values()]
    carried = any(meshing.carrier is not None for meshing in known.values())
    if carried or any(f"{gear}{GEAR_PHI}" not in part for gear in rotors):
        return None
    first = rotors[0]
    turning = Turning.of(part.time, part[f"{first}{GEAR_PHI}"])
    if not turning.steady:
        return None
    angles = [name for name in part.channels if name.endswith(GEAR_PHI)]
    turned = {name.removesuffix(GEAR_PHI): float(np.ptp(part[name][[0, -1]])) for name in angles}
    families = {mesh: own.teeth * turned[own.rotor] / turned[first] for mesh, own in known.items()}
    if len(known) == 1:
        families, others = {"": float(next(iter(known.values())).teeth)}, {}
        names, shown = [f"bearing.{name}.fy" for name in bearings(part)], PAIR_ORDERS
    else:
        others, shown = {gear: turn / turned[first] for gear, turn in turned.items() if gear != first}, TRAIN_ORDERS
        names = _loudest_bearings(part)
    names += [*(f"{mesh}.force" for mesh in known), *loudest_sensors(part)]
    signals = {name: _force(part, name) for name in names if name in part or f"{name}_mean" in part}
    return RunUp(part, first, turning, families, signals, orders_shown=shown, others=others) if signals else None


def _loudest_bearings(part: Trace) -> list[str]:
    """Of the radial forces of the bearings those that vary most, TRAIN_BEARINGS of them, in the trace's order."""
    found = [f"bearing.{name}.{axis}" for name in bearings(part) for axis in ("fx", "fy")]
    found = [name for name in found if name in part]
    loud = sorted(found, key=lambda name: -float(np.std(np.diff(part[name]))))[:TRAIN_BEARINGS]
    return [name for name in found if name in loud]


def resonances(run: RunUp, mesh: str, stage: Stage, bodies: Sequence[Body]) -> tuple[float, ...]:
    """Natural frequencies (Hz) of a pair or train linearised under the run's mean mesh force, those modes that a
    transmission error drives; none where the stage finds no equilibrium with its flanks in contact."""
    model = assemble(stage, bodies)
    place = place_of(model, mesh)
    torque = float(np.mean(run.signals[f"{mesh}.force"].values)) * place.lever
    if abs(torque) < LEAST_LOAD * place.most:
        return ()
    try:
        found = stage_modes(model, bodies, torque, MODES, positions=3)
    except SimulationError:
        return ()
    strong = np.any(loud(found), axis=1)
    return tuple(float(f) for f in found.frequency.mean(axis=0)[strong])


def _force(part: Trace, name: str) -> Signal:
    """A force, its mean over the step where that was recorded, or a sensor's acceleration, which is such a mean."""
    kind, used = ACCELERATIONS if name.startswith(SENSOR) else FORCES, recorded(part, name)
    return Signal(part[used], kind, averaging(part, used))


def _signals(part: Trace, own: PlanetSet, each: float) -> dict[str, Signal]:
    """Force of the ring on its mounts, whose direction goes round with the carrier, and a mesh of every central
    gear."""
    around = {k: (k * each - 1.0, k * each + 1.0) for k in range(1, SET_ORDERS + 1)}
    found = {name: replace(_force(part, name), sides=around) for name in on_mounts(part) if name.endswith("x")}
    meshes = [next(iter(meshes.values())) for meshes in own.meshes.values()]
    return found | {f"{mesh}.force": _force(part, f"{mesh}.force") for mesh in meshes if f"{mesh}.force" in part}
