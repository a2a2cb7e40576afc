"""The housing in the ground group: a free body that belongs to no rotor and stands, with a node for every support that
meets it and one for every sensor.

A seat's node lies where the mesh has it. The bearing acts where its shaft has it, on the rotor's axis at the support's
place: rows and compliances are moved there as with a rigid arm, so that the spring pulls both bodies along one line.
Oscillators beyond `dynamic_to` join the residual. Sensors are nodes that nothing loads: their columns are compliance by
the other nodes alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearfmu.body.body import Body, Node, Sensors, rigid_rows
from gearfmu.errors import ModelError
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.stage.assembly.ground_part import GroundPart, ground_part
from gearfmu.stage.assembly.groups import Group
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import SupportSpec
from gearfmu.stagefile.tables.housing import HousingBody

AXES = "xyz"
OFF_AXIS = 1e-3  # of the housing's size: how far a seat may lie from its shaft's axis
ALONG = 0.05  # the same along the axis, for the seat of a superelement, whose surface is not known


@dataclass(frozen=True)
class Meeting:
    """A support that meets a housing: its name, the node of the housing, and the point (3,) m where it acts."""

    support: str
    node: str
    point: np.ndarray


def meetings(stage: Stage, housing: HousingBody, body: Body) -> list[Meeting]:
    """Every support of a stage that meets its reduced housing, in order. ModelError that lists seats that do not lie
    where their bearings are."""
    found, problems = [], []
    nodes = {node.name: node for node in body.nodes}
    for support in stage.supports:
        if housing.name not in (support.body, support.to):
            continue
        node = nodes[str(support.node)]
        point = node.point
        if support.to == housing.name:
            problems += _misplaced(stage, support, body, node)
            point = _acts_at(stage, support)
        found.append(Meeting(support.name, str(support.node), np.asarray(point, float)))
    if problems:
        frame = f"model {housing.name} in the stage's axes, z along the shafts"
        raise ModelError("; ".join(problems) + f": {frame}, or move the supports")
    return found


def _acts_at(stage: Stage, support: SupportSpec) -> np.ndarray:
    axis = stage.rotors[stage.rotor_of(support.body)].axis
    return np.array([*axis, stage.place(support.body, None) if support.at is None else support.at])


def _misplaced(stage: Stage, support: SupportSpec, body: Body, seat: Node) -> list[str]:
    """What is wrong with the place of a seat: its master point, and from where to where it reaches along z."""
    assert body.error is not None
    point, far = seat.point, OFF_AXIS * body.error.length
    reach = ALONG * body.error.length
    low, high = seat.span or (point[2] - reach, point[2] + reach)
    wanted = _acts_at(stage, support)
    whose = f"seat {support.node} of {body.name} and the bearing {support.name}"
    if np.linalg.norm(point[:2] - wanted[:2]) > far:
        where = " and ".join(f"({1e3 * x:.4g}, {1e3 * y:.4g})" for x, y in (point[:2], wanted[:2]))
        return [f"the axes of {whose} lie apart, at x, y = {where} mm"]
    if not low - far <= wanted[2] <= high + far:
        span = f"{1e3 * low:.4g} … {1e3 * high:.4g} mm"
        return [f"{whose} lie apart along z: at {span} and {1e3 * wanted[2]:.4g} mm"]
    return []


def housing_part(body: Body, found: list[Meeting], dynamic_to: float) -> GroundPart:
    """The GroundPart of a reduced housing: nodes of the supports, then of the sensors. dynamic_to: Hz."""
    names, arms = [node.name for node in body.nodes], np.zeros((6 * len(found), len(body.rows)))
    for k, meeting in enumerate(found):
        own = names.index(meeting.node)
        arms[6 * k : 6 * k + 6, 6 * own : 6 * own + 6] = rigid_rows(meeting.point - body.nodes[own].point)
    n = int(np.searchsorted(body.frequency, dynamic_to, "right"))
    moved = replace(
        body,
        nodes=tuple(Node(meeting.support, "rigid", COMPONENTS, meeting.point) for meeting in found),
        frequency=body.frequency[:n],
        damping_ratio=body.damping_ratio[:n],
        rows=arms @ body.rows[:, :n],
        static=arms @ body.static @ arms.T,
        sensors=None,
        skin=None,
    )
    part = ground_part(moved)
    return part if body.sensors is None else _with_sensors(part, body.sensors, arms)


def _with_sensors(part: GroundPart, sensors: Sensors, arms: np.ndarray) -> GroundPart:
    """The part with sensors behind its nodes, without rotation: their residual is that by the nodes alone."""
    assert sensors.static is not None
    own, size = sensors.rows[:, : part.omega.size], len(part.residual)
    felt = sensors.static @ arms.T - (own / part.omega**2) @ part.rows.reshape(size, -1).T
    moves = (6 * np.arange(len(sensors.names))[:, None] + np.arange(3)).ravel()
    rows, residual = np.zeros((6 * len(sensors.names), own.shape[1])), np.zeros((6 * len(sensors.names), size))
    rows[moves], residual[moves] = own, felt
    seen = zip(sensors.names, sensors.points, strict=True)
    return replace(
        part,
        nodes=(*part.nodes, *(Node(name, "nodes", COMPONENTS, point) for name, point in seen)),
        rows=np.concatenate([part.rows, rows.reshape(len(sensors.names), 6, own.shape[1])]),
        residual=np.block([[part.residual, residual.T], [residual, np.zeros((len(rows), len(rows)))]]),
    )


def sensor_sections(sensors: Sensors | None, group: Group) -> dict[str, object]:
    """Sections of the blob that make outputs of the sensors of a housing, the last body of the first set of ground
    oscillators, whose last nodes they are."""
    if sensors is None:
        return {}
    housing = len(group.layout.bodies) - 1
    first = len(group.layout.bodies[housing].nodes) - len(sensors.names)
    own = [(first + k, d) for k in range(len(sensors.names)) for d in range(3)]
    return {
        "sensed": np.array([d for _, d in own], np.int32),
        "sensor_names": "|".join(f"sensor.{name}.a{axis}" for name in sensors.names for axis in AXES),
        "sensor_rows0": np.array([group.node_rows(housing, node, d) for node, d in own]),
    }


def widened(sections: dict[str, np.ndarray], number: int, supports: int) -> dict[str, np.ndarray]:
    """Sections of a set without the housing, with the supports of its feet behind the others: they carry nothing."""
    found = dict(sections)
    for name in ("damper_rows", "damper", "support_rows", "support_compliance", "kappa", "support_coupling"):
        if (key := f"{name}{number}") in found:
            more = supports - len(found[key])
            square = name in ("kappa", "support_coupling")
            found[key] = np.pad(found[key], [(0, more), (0, more if square else 0)][: found[key].ndim])
    return found
