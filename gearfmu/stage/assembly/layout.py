"""Stage and reduced gears → the layout of its ground group: free bodies, rotors, springs between nodes."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from weakref import WeakKeyDictionary

import numpy as np

from gearfmu.body import Body
from gearfmu.body.beam import Section, Shaft, Steel, distinct, reduce_shaft
from gearfmu.errors import ModelError
from gearfmu.stage.assembly.ground_part import GroundPart, Reading, ground_part
from gearfmu.stage.assembly.groups import Layout, Support
from gearfmu.stage.assembly.housed import housing_part, meetings
from gearfmu.stage.assembly.teeth import MOST_FUNCTIONS, ROLLS, excited_modes, resampling
from gearfmu.stagefile.forms.general import Stage, ToothedBody
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.tables.bodies import ShaftBody
from gearfmu.stagefile.tables.connections import DIRECTIONS, SupportSpec
from gearfmu.stagefile.tables.housing import HousingBody

ROLLING = {4: (0, 1, 3, 4), 5: (0, 1, 2, 3, 4)}  # directions of a rolling bearing by their number
_KEPT = 4  # ways to read a body that are remembered
_READ: WeakKeyDictionary[Body, dict[Hashable, GroundPart]] = WeakKeyDictionary()


@dataclass(frozen=True)
class Nodes:
    """Where bodies are held and driven. numbers: name of a body → its number, gears first in the order of the stage,
    then shafts, carriers, the housing; places: name of a shaft → places (K,) m of its nodes in the stage, ascending;
    names: of a carrier → names of its nodes, of a housing → the supports that meet it."""

    numbers: dict[str, int]
    places: dict[str, list[float]]
    names: dict[str, list[str]]

    def find(self, stage: Stage, body: str, at: float | None, node: str | None = None) -> tuple[int, int]:
        """(body, node) at a place; a gear has one node, its bore or its rim, a carrier those that have names."""
        if body in self.names:
            return self.numbers[body], self.names[body].index(node or "bore")
        if body not in self.places:
            return self.numbers[body], 0
        wanted = stage.place(body, at)
        return self.numbers[body], int(np.argmin(np.abs(np.array(self.places[body]) - wanted)))


def stage_nodes(stage: Stage, carriers: Mapping[str, Body] = MappingProxyType({})) -> Nodes:
    """The nodes of all bodies: those that supports and ports name. carriers: reduced, by name, the housing too."""
    shafts = [body for body in stage.bodies.values() if isinstance(body, ShaftBody)]
    ordered = [body.name for body in (*stage.gears, *shafts, *stage.carriers, *stage.housings)]
    places: dict[str, list[float]] = {}
    for shaft in shafts:
        wanted = [place_of(stage, s) for s in stage.supports if shaft.name in (s.body, s.to)]
        wanted += [stage.place(shaft.name, port.at) for port in stage.ports.values() if port.body == shaft.name]
        places[shaft.name] = distinct(np.array(wanted)).tolist()
    names = {own.name: [node.name for node in carriers[own.name].nodes] for own in stage.carriers}
    for housing in stage.housings:
        names[housing.name] = [s.name for s in stage.supports if housing.name in (s.body, s.to)]
    return Nodes({name: i for i, name in enumerate(ordered)}, places, names)


def place_of(stage: Stage, support: SupportSpec) -> float:
    """Place of a support along the axis: as said, or where its gear lies."""
    if support.at is not None:
        return support.at
    names = [name for name in (support.body, support.to) if name]
    gears = [name for name in names if isinstance(stage.bodies[name], ToothedBody)]
    return stage.place((gears or names)[0], None)


def width_degrees(stage: Stage, bodies: Sequence[Body]) -> np.ndarray:
    """Degrees of the width functions that the stage excites: even ones where all is symmetric about mid-width.
    ModelError where bodies have more of them than the kernel takes."""
    count = min(body.toothed.width_functions for body in bodies)
    degrees = np.arange(0, count, 2 if stage.even else 1)
    if degrees.size > MOST_FUNCTIONS:
        most = 2 * MOST_FUNCTIONS if stage.even else MOST_FUNCTIONS
        raise ModelError(
            f"bodies with {count} width functions: this stage takes at most {most}: set width_functions = {most} in "
            "the body of one of its gears, and make that body again with `gearfmu reduce`"
        )
    return degrees


def stage_layout(
    stage: Stage,
    bodies: Sequence[Body],
    carriers: Mapping[str, Body] = MappingProxyType({}),
    points: Sequence[np.ndarray] | None = None,
    tangents: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> Layout:
    """The layout of a stage: reduced gears `bodies` in the order of stage.gears, then its shafts and its reduced
    `carriers` and housing. points: of every gear the weights (P, R) of the body's rolls at those where flanks are read;
    the even grid of ROLLS where None; tangents: (d, d) stiffness of rolling bearings by the names of their supports."""
    nodes, degrees = stage_nodes(stage, carriers), width_degrees(stage, bodies)
    points = even_grids(stage, bodies, ROLLS) if points is None else points
    free = [
        replace(_gear(stage, body, degrees, own), name=gear.name)  # a body's file may come from another stage
        for gear, body, own in zip(stage.gears, bodies, points, strict=True)
    ]
    shafts = [body for body in stage.bodies.values() if isinstance(body, ShaftBody)]
    free += [_shaft(stage, shaft, nodes.places[shaft.name]) for shaft in shafts]
    free += [replace(ground_part(carriers[carrier.name]), name=carrier.name) for carrier in stage.carriers]
    for own in stage.housings:
        body = carriers[own.name]
        free.append(replace(housing_part(body, meetings(stage, own, body), own.dynamic_to), name=own.name))
    names = list(stage.rotors)
    bare = Layout(
        free,
        [tuple(nodes.numbers[name] for name in rotor.bodies) for rotor in stage.rotors.values()],
        [],
        stage.planar,
        frozenset(r for r, rotor in enumerate(stage.rotors.values()) if rotor.stands),
        {
            r: (names.index(rotor.carried_by), *rotor.axis)
            for r, rotor in enumerate(stage.rotors.values())
            if rotor.carried_by is not None
        },
    )
    # feet last: without its housing a stage has the supports that it would have if there were none
    supports = sorted(stage.supports, key=lambda support: _is_foot(stage, support))
    return replace(bare, supports=[_support(stage, nodes, bare, s, tangents.get(s.name)) for s in supports])


def even_grids(stage: Stage, bodies: Sequence[Body], rolls: int) -> list[np.ndarray]:
    """(rolls, R) of every gear: weights of its body's rolls on the even grid."""
    shapes = [gear_shape(gear) for gear in stage.gears]
    return [resampling(body.toothed.roll, s.s_form, s.s_tip, rolls) for s, body in zip(shapes, bodies, strict=True)]


def _gear(stage: Stage, body: Body, degrees: np.ndarray, weights: np.ndarray) -> GroundPart:
    """Remembered: only its body, the form of its flank and the levels decide it."""
    chosen = excited_modes(body, degrees, stage.even)
    key = (chosen.tobytes(), degrees.tobytes(), weights.tobytes(), stage.levels)
    known = _READ.setdefault(body, {})
    if key not in known:
        while len(known) >= _KEPT:
            known.pop(next(iter(known)))
        known[key] = ground_part(body, Reading(chosen, degrees, weights, stage.levels))
    return known[key]


def _shaft(stage: Stage, shaft: ShaftBody, places: Sequence[float]) -> GroundPart:
    m, origin = shaft.material, stage.place(shaft.name, None)
    sections = [Section(s.length, s.outer_diameter, s.bore_diameter) for s in shaft.sections]
    steel = Steel(m.youngs_modulus, m.poisson_ratio, m.density)
    whole = Shaft(sections, steel, [place - origin for place in places])
    return ground_part(reduce_shaft(whole, shaft.stored_to, None, shaft.name, shaft.modal_damping))


def _springs(
    layout: Layout, body: int, support: SupportSpec, tangent: np.ndarray | None
) -> tuple[tuple[int, ...], np.ndarray, np.ndarray]:
    """The last fields of a `Support`: the springs that a stage file gives, or the tangent (d, d) of a rolling bearing,
    whose dashpots follow its diagonal."""
    if tangent is not None:
        held = ROLLING[len(tangent)]
        masses = np.array([layout.mass(body, direction) for direction in held])
        return held, _inverse(tangent), 2 * support.damping_ratio * np.sqrt(np.diag(tangent) * masses)
    assert support.bearing is None, f"{support.name}: a rolling bearing has a stiffness at a load only"
    directions, compliance, damping = [], [], []
    for field, own in DIRECTIONS.items():
        stiffness = getattr(support, field)
        if stiffness is None:
            continue
        rigid = stiffness == "rigid"
        for direction in own:
            mass = layout.mass(body, direction)
            directions.append(direction)
            compliance.append(0.0 if rigid else 1 / stiffness)
            damping.append(0.0 if rigid else 2 * support.damping_ratio * math.sqrt(stiffness * mass))
    return tuple(directions), np.diag(compliance), np.array(damping)


def _inverse(stiffness: np.ndarray) -> np.ndarray:
    """Symmetric; scaled to a unit diagonal first."""
    scale = 1 / np.sqrt(np.diag(stiffness))
    inverse = np.linalg.inv(stiffness * np.outer(scale, scale)) * np.outer(scale, scale)
    return np.asarray(0.5 * (inverse + inverse.T))


def _support(stage: Stage, nodes: Nodes, layout: Layout, support: SupportSpec, tangent: np.ndarray | None) -> Support:
    at = None if _is_foot(stage, support) else place_of(stage, support)

    def end(body: str, node: str | None) -> tuple[int, int]:
        housed = isinstance(stage.bodies[body], HousingBody)
        return nodes.find(stage, body, at, support.name if housed else node)

    name = f"{_kind(stage, support)}.{support.name}"
    first = end(support.body, support.node if support.to is None else None)
    second = None if support.to is None else end(support.to, support.node)
    return Support(name, first, second, *_springs(layout, first[0], support, tangent))


def _is_foot(stage: Stage, support: SupportSpec) -> bool:
    return isinstance(stage.bodies[support.body], HousingBody)


def _kind(stage: Stage, support: SupportSpec) -> str:
    """What a support is called: a foot of a housing is a mount; on the ground or a housing it is a bearing, between a
    carrier and what it carries a pin, else a seat."""
    if _is_foot(stage, support):
        return "mount"
    if support.to is None or isinstance(stage.bodies[support.to], HousingBody):
        return "bearing"
    return "pin" if stage.rotor_of(support.body) != stage.rotor_of(support.to) else "seat"
