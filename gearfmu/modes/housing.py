"""The housing of a stage file as a body on its feet: seats in the order of any run's bearing forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.body import Body
from gearfmu.errors import ModelError
from gearfmu.modes.housed import Housing
from gearfmu.stage.assembly.assemble import layout_of
from gearfmu.stage.assembly.groups import FORCES
from gearfmu.stagefile.forms.general import Stage


@dataclass(frozen=True)
class Placed:
    """A housing, its name, and those of its bearing forces (s,), mount forces (f,) and sensor accelerations (r,)."""

    name: str
    housing: Housing
    seats: tuple[str, ...]
    feet: tuple[str, ...]
    sensors: tuple[str, ...]


def placed_housing(stage: Stage, bodies: Sequence[Body], names: Sequence[str] | None = None) -> Placed:
    """The housing of `stage`, reduced as one of `bodies`. names: of bearing forces, whose order it takes.

    Raises ModelError for a stage without a housing, and for one whose bearings are not those of `names`.
    """
    if not stage.housings:
        raise ModelError(f"stage {stage.name} has no housing: give a stage file with [bodies.NAME] of kind 'housing'")
    layout, name = layout_of(stage, bodies), stage.housings[0].name
    number = [body.name for body in layout.bodies].index(name)
    free = layout.bodies[number]
    seats = {
        f"{s.name}.{FORCES[d]}": (s.second[1], d)
        for s in layout.supports
        if s.second is not None and s.second[0] == number
        for d in s.directions
    }
    if names is not None and set(names) != set(seats):
        strange = ", ".join(sorted(set(names) ^ set(seats)))
        raise ModelError(f"the bearings of the run and of stage {stage.name} are not the same: {strange}")
    held = [s for s in layout.supports if s.second is None and s.first[0] == number]
    feet = {f"{s.name}.{FORCES[d]}": (s.first[1], d) for s in held for d in s.directions}
    body = stage.by_name(bodies)[name]
    of_sensors = () if body.sensors is None else body.sensors.names
    first = len(free.nodes) - len(of_sensors)  # sensors are the last nodes of a body
    sensors = {f"sensor.{own}.a{'xyz'[d]}": (first + k, d) for k, own in enumerate(of_sensors) for d in range(3)}
    order = tuple(seats if names is None else names)
    loaded = [*(seats[own] for own in order), *feet.values()]
    rows, columns = [*loaded, *sensors.values()], [6 * node + d for node, d in loaded]
    moved = np.array([np.concatenate([free.nodes[node].rigid_rows[d], free.rows[node, d]]) for node, d in rows])
    residual = free.residual[np.ix_([6 * node + d for node, d in rows], columns)]
    s, f = len(order), len(feet)
    springs = np.concatenate([np.diag(own.compliance) for own in held]) if held else np.zeros(0)
    housing = Housing(
        mass=free.mass,
        omega=free.omega,
        zeta=free.zeta,
        seats=moved[:s],
        feet=moved[s : s + f],
        sensors=moved[s + f :],
        residual=residual,
        foot=1 / np.maximum(springs, 1e-15),
        foot_loss=np.concatenate([own.damping for own in held]) if held else np.zeros(0),
    )
    return Placed(name, housing, order, tuple(feet), tuple(sensors))
