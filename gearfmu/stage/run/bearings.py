"""Rolling bearings of a stage under a torque, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.bearing.law import Balls, Law, Rolling
from gearfmu.bearing.rest import NoRestError, pass_orders, pass_swing
from gearfmu.body import Body
from gearfmu.stage.assembly.assemble import settled
from gearfmu.stage.assembly.rolling import BALL_NUMBERS, ROLLER_NUMBERS, filled
from gearfmu.stage.assembly.shown import Card, Shown
from gearfmu.stagefile.forms.general import Stage

AXES = ("x", "y", "z", "rx", "ry")


@dataclass(frozen=True)
class BearingState:
    """A rolling bearing under its load, directions (x, y, z, θx, θy).

    support, bearing: names in the stage file; proposed: names of numbers that were proposed; numbers: those of the
    rolling elements, SI; load: (5,) N, N·m, of the shaft on the bearing, preload included; displacement: (5,) m, rad,
    of the inner ring by the torque; loaded: rolling elements that carry, of `elements`; largest_load: N, of a rolling
    element; pressure: Pa, largest contact pressure; stiffness: (5, 5) N/m, N/rad, N·m/rad, of the model; orders: passes
    of the outer and of the inner ring in one revolution of the shaft; swing: (5,) m, rad, peak to peak while rolling
    elements pass under the constant load, NaN where the bearing is no single row.
    """

    support: str
    bearing: str
    proposed: tuple[str, ...]
    numbers: dict[str, float]
    load: np.ndarray
    displacement: np.ndarray
    elements: int
    loaded: int
    largest_load: float
    pressure: float
    stiffness: np.ndarray
    orders: tuple[float, float]
    swing: np.ndarray


@dataclass(frozen=True, repr=False)
class Bearings(Shown):
    """Rolling bearings of a stage. torque: N·m on the input; iterations: of load and stiffness; states: in the order of
    the supports."""

    name: str
    torque: float
    iterations: int
    states: tuple[BearingState, ...]

    def __getitem__(self, support: str) -> BearingState:
        """The bearing of a support. KeyError where there is none."""
        return {state.support: state for state in self.states}[support]

    @property
    def card(self) -> Card:
        """How a session shows it."""
        rows = [(state.support, _in_words(state)) for state in self.states]
        return Card(f"{len(rows)} rolling bearings of {self.name} at {self.torque:g} N·m on the input", rows, 2)

    def columns(self) -> dict[str, list[str | float]]:
        """A table, one row a bearing: loads N and N·m, displacements µm and mrad, stiffnesses on the diagonal."""
        found: dict[str, list[str | float]] = {
            "support": [s.support for s in self.states],
            "bearing": [s.bearing for s in self.states],
        }
        shown = np.array([1e6, 1e6, 1e6, 1e3, 1e3])

        def put(name: str, values: Sequence[np.ndarray]) -> None:
            found.update({f"{name}_{axis}": [float(v[i]) for v in values] for i, axis in enumerate(AXES)})

        put("load", [s.load for s in self.states])
        put("displacement", [s.displacement * shown for s in self.states])
        found["loaded"] = [float(s.loaded) for s in self.states]
        found["largest_load_N"] = [s.largest_load for s in self.states]
        found["pressure_MPa"] = [1e-6 * s.pressure for s in self.states]
        put("stiffness", [np.diag(s.stiffness) for s in self.states])
        for i, ring in enumerate(("outer", "inner")):
            found[f"pass_order_{ring}"] = [s.orders[i] for s in self.states]
        put("swing", [s.swing * shown for s in self.states])
        return found


def stage_bearings(stage: Stage, bodies: Sequence[Body], torque: float | None = None) -> Bearings:
    """The rolling bearings of a stage under a torque on its input, N·m; that of the file when None. ModelError where it
    has none, and where one cannot carry its load."""
    found = settled(stage, bodies, torque)
    states = []
    for support in stage.supports:
        if support.bearing is None:
            continue
        bearing, rest = found.bearings[support.name], found.rests[support.name]
        known = filled(stage.bearings[support.bearing])
        stiffness = np.zeros((5, 5))
        stiffness[np.ix_(bearing.directions, bearing.directions)] = found.tangents[support.name]
        states.append(
            BearingState(
                support=support.name,
                bearing=support.bearing,
                proposed=known.proposed,
                numbers=_numbers(known.law),
                load=rest.load,
                displacement=rest.displacement,
                elements=known.law.count * len(bearing.rows),
                loaded=rest.loaded,
                largest_load=float(rest.loads.max()),
                pressure=rest.pressure,
                stiffness=stiffness,
                orders=pass_orders(known.law),
                swing=_swing(bearing, rest.load),
            )
        )
    return Bearings(stage.name, found.torque, found.iterations, tuple(states))


def _numbers(law: Law) -> dict[str, float]:
    """Of the rolling elements, by their names in a stage file."""
    if isinstance(law, Balls):
        return dict(zip(BALL_NUMBERS, (law.count, law.diameter, law.pitch_diameter, *law.grooves), strict=True))
    return dict(zip(ROLLER_NUMBERS, (law.count, law.diameter, law.length, law.pitch_diameter), strict=True))


def _swing(bearing: Rolling, load: np.ndarray) -> np.ndarray:
    """See `BearingState`. Rolling elements of two rows pass in no fixed order; some loads hold at the mean only."""
    if len(bearing.rows) > 1:
        return np.full(5, np.nan)
    try:
        return pass_swing(bearing, load)
    except NoRestError:
        return np.full(5, np.nan)


def _in_words(state: BearingState) -> str:
    radial = float(np.hypot(*state.load[:2]))
    k = 1e-6 * np.diag(state.stiffness)
    return (
        f"{state.bearing}, radial {radial:.0f} N, axial {state.load[2]:.0f} N; {state.loaded} of {state.elements} "
        f"carry, {state.largest_load:.0f} N and {1e-6 * state.pressure:.0f} MPa at most; "
        f"{k[0]:.0f}, {k[1]:.0f} and {k[2]:.1f} N/µm along x, y and z"
    )
