"""Can a general stage be put together? Names that must exist, places on shafts, axes, and every mesh as a pair. Nothing
here stops at the first problem."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from gearfmu.errors import Problem
from gearfmu.ranges import kernel_limits
from gearfmu.stagefile.forms.bearing_checks import unused_problems, use_problems, uses_of_supports
from gearfmu.stagefile.forms.flank_checks import with_rolls
from gearfmu.stagefile.forms.general import EngagementSpec, RingBody, Stage, ToothedBody
from gearfmu.stagefile.forms.housing_checks import housing_problems
from gearfmu.stagefile.forms.pair_checks import geometry_problems, millimetres
from gearfmu.stagefile.forms.planetary_checks import RingPair, ring_pair_problems
from gearfmu.stagefile.forms.shapes import centre_distance, mesh_shape, toothed
from gearfmu.stagefile.tables.bearings import BallBearing, RollerBearing
from gearfmu.stagefile.tables.gear import PairSpec
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.shaft import ShaftBody

Found = Iterator[tuple[str, str, str]]
_SAME_RACK = ("normal_module", "pressure_angle")


def general_problems(file: str, stage: Stage) -> list[Problem]:
    """Everything that is wrong with a stage whose single fields can be read."""
    rolling = (
        *use_problems(uses_of_supports(stage.supports), stage.bearings, stage.operating),
        *unused_problems(stage.supports),
    )
    problems = [Problem(file, *entry) for entry in (*_counts(stage), *_rotors(stage), *_names(stage), *rolling)]
    problems += [Problem(file, *entry) for entry in housing_problems(stage)]
    known = _what_can_be_judged(stage)
    problems += [Problem(file, *entry) for entry in (*_places(known), *_held(known))]
    for engagement in known.engagements:
        problems += _mesh(file, known, engagement)
    return list(dict.fromkeys(problems))


def _what_can_be_judged(stage: Stage) -> Stage:
    """The stage without what names a body that there is not, or one that has no rotor of its own."""
    counts = Counter(name for rotor in stage.rotors.values() for name in rotor.bodies)
    standing = {housing.name for housing in stage.housings}
    good = {name for name in stage.bodies if counts[name] == 1} | standing
    gears = {gear.name for gear in stage.gears} & good
    rotors = {
        name: rotor.model_copy(
            update={"bodies": {body: z for body, z in rotor.bodies.items() if body in good - standing}}
        )
        for name, rotor in stage.rotors.items()
    }
    kept = {
        "rotors": {name: rotor for name, rotor in rotors.items() if rotor.bodies},
        "engagements": tuple(mesh for mesh in stage.engagements if set(mesh.gears) <= gears),
        "supports": tuple(s for s in stage.supports if {s.body, s.to} - {None} <= good),
        "ports": {name: port for name, port in stage.ports.items() if port.body in good - standing},
    }
    return stage.model_copy(update=kept)


def _counts(stage: Stage) -> Found:
    """Numbers of things that the kernel has room for."""
    directions = {"radial": 2, "axial": 1, "tilt": 2, "torsion": 1}
    held = sum(n for s in stage.supports for field, n in directions.items() if getattr(s, field) is not None)
    held += sum(_directions(stage.bearings.get(s.bearing)) for s in stage.supports if s.bearing is not None)
    counts = {
        "rotors": (len(stage.rotors), "ROTORS", "rotors"),
        "bodies": (len(stage.gears), "GEARS", "toothed bodies"),
        "engagements": (len(stage.engagements), "ENGAGEMENTS", "meshes"),
        "ports": (len(stage.ports), "PORTS", "ports"),
        "supports": (held, "SUPPORTS", "directions that are held (radial and tilt are two each)"),
    }
    for field, (count, row, what) in counts.items():
        most = int(kernel_limits()[row][1])
        if count > most:
            yield field, str(count), f"out of range: the kernel holds at most {most} {what}; leave some away"


def _directions(bearing: BallBearing | RollerBearing | None) -> int:
    """Directions in which a rolling bearing holds; those of balls where it is not known."""
    return 4 if isinstance(bearing, RollerBearing) and bearing.contact_angle == 0 else 5


def _rotors(stage: Stage) -> Found:
    """Every body in exactly one rotor, and bodies that exist; carriers only where builders write them."""
    for carrier in stage.carriers:
        yield f"bodies.{carrier.name}.kind", "carrier", "a carrier belongs to a set: write a file of kind planetary_set"
    for name, rotor in stage.rotors.items():
        if rotor.carried_by is not None:
            yield f"rotors.{name}.carried_by", rotor.carried_by, "write a file of kind planetary_set"
    counts = Counter(name for rotor in stage.rotors.values() for name in rotor.bodies)
    for name, rotor in stage.rotors.items():
        for body in rotor.bodies:
            if body not in stage.bodies:
                yield f"rotors.{name}.bodies.{body}", body, _unknown_body(stage)
    for own in stage.bodies:
        if counts[own] != 1 and not isinstance(stage.bodies[own], HousingBody):
            remedy = "a body belongs to one rotor: name it in the bodies of one [rotors.…]"
            yield f"bodies.{own}", f"in {counts[own]} rotors", remedy


def _names(stage: Stage) -> Found:
    """What engagements, supports and ports name."""
    gears = {gear.name for gear in stage.gears}
    for mesh in stage.engagements:
        for gear in mesh.gears:
            if gear not in gears:
                yield f"engagements.{mesh.name}.gears", gear, f"no such gear: one of {', '.join(sorted(gears))}"
    for support in stage.supports:
        for field, body in (("body", support.body), ("to", support.to)):
            if body is not None and body not in stage.bodies:
                yield f"supports.{support.name}.{field}", body, _unknown_body(stage)
    for name, port in stage.ports.items():
        if port.body not in stage.bodies:
            yield f"ports.{name}.body", port.body, _unknown_body(stage)
    for group, items, longest in (
        ("engagements", stage.engagements, 31),
        ("supports", stage.supports, 20),
    ):
        for item in items:
            if len(item.name) > longest:
                yield f"{group}.{item.name}.name", item.name, f"at most {longest} characters: shorten it"
    for name in (name for name in stage.rotors if len(name) > 31):
        yield f"rotors.{name}", name, "at most 31 characters: shorten it"
    for group, items in (("engagements", stage.engagements), ("supports", stage.supports)):
        for name, count in Counter(item.name for item in items).items():
            if count > 1:
                yield f"{group}.{name}.name", name, "used twice: give every one its own name"


def _places(stage: Stage) -> Found:
    """Nodes lie on their bodies: at a gear's mid-width, on a shaft's length. Those of a housing its mesh has."""
    nodes = [(f"supports.{s.name}.at", body, s.at) for s in stage.supports for body in (s.body, s.to) if body]
    nodes += [(f"ports.{name}.at", port.body, port.at) for name, port in stage.ports.items()]
    for field, name, at in nodes:
        if isinstance(stage.bodies[name], HousingBody):
            continue
        body, origin = stage.bodies[name], stage.place(name, None)
        if isinstance(body, ShaftBody):
            at = _on_shaft(stage, field, at)
            if at is None:
                yield field, "", f"{name} is a shaft: say where along it, {_range(origin, origin + body.length)}"
            elif not origin - 1e-9 <= at <= origin + body.length + 1e-9:
                yield field, millimetres(at), f"not on the shaft {name}: {_range(origin, origin + body.length)}"
        elif at is not None and not math.isclose(at, origin, abs_tol=1e-9):
            yield (
                field,
                millimetres(at),
                f"{name} is a gear and held at its mid-width, {millimetres(origin)}: leave it away",
            )


def _on_shaft(stage: Stage, field: str, at: float | None) -> float | None:
    """Place of a node on a shaft; where a gear sits on one, the gear's place counts."""
    if at is not None or not field.startswith("supports."):
        return at
    support = next(s for s in stage.supports if field == f"supports.{s.name}.at")
    gears = [name for name in (support.body, support.to) if name and isinstance(stage.bodies[name], ToothedBody)]
    return stage.place(gears[0], None) if gears else None


def _held(stage: Stage) -> Found:
    """What is held to what: bodies of one rotor with torsion, bodies of two without."""
    standing = {housing.name for housing in stage.housings}
    for support in stage.supports:
        if support.body in standing or support.to in standing:
            continue
        if support.to is None:
            if support.torsion is not None and not stage.rotors[stage.rotor_of(support.body)].stands:
                remedy = "a support on the ground cannot hold a spin: take torsion away, write a port, or stands = true"
                yield f"supports.{support.name}.torsion", f"{support.torsion}", remedy
            continue
        same = stage.rotor_of(support.body) == stage.rotor_of(support.to)
        if not same:
            remedy = "a spring between bodies of two rotors is not built yet: hold them on the ground, or in one rotor"
            yield f"supports.{support.name}.to", support.to, remedy
    for name, rotor in stage.rotors.items():
        if len(rotor.bodies) > 1:
            joined = _joined(stage, list(rotor.bodies))
            for body in sorted(set(rotor.bodies) - joined):
                remedy = f"turns loosely in the rotor {name}: give a support between it and the others with torsion"
                yield f"rotors.{name}.bodies.{body}", body, remedy


def _joined(stage: Stage, bodies: list[str]) -> set[str]:
    """Those of `bodies` that springs against twist connect to the first."""
    joints = [(s.body, s.to) for s in stage.supports if s.to is not None and s.torsion is not None]
    joined, size = {bodies[0]}, 0
    while size != len(joined):
        size = len(joined)
        joined |= {b for a, b in (*joints, *((b, a) for a, b in joints)) if a in joined and b in bodies}
    return joined


def _mesh(file: str, stage: Stage, mesh: EngagementSpec) -> list[Problem]:
    """One engagement as the pair that it is; fields under their names here."""
    a, b = (stage.bodies[name] for name in mesh.gears)
    assert isinstance(a, ToothedBody) and isinstance(b, ToothedBody)
    field = f"engagements.{mesh.name}"
    if isinstance(a, RingBody):
        return [
            Problem(file, f"{field}.gears", ", ".join(mesh.gears), "a ring is gear B of its meshes: name it second")
        ]
    if stage.rotor_of(a.name) == stage.rotor_of(b.name):
        return [Problem(file, f"{field}.gears", ", ".join(mesh.gears), "two gears of one rotor: name gears of two")]
    differ = [key for key in _SAME_RACK if not math.isclose(getattr(a, key), getattr(b, key), abs_tol=1e-12)]
    if differ:
        remedy = f"{a.name} and {b.name} differ in it: gears in mesh share the basic rack"
        return [Problem(file, f"bodies.{b.name}.{key}", f"{getattr(b, key):g}", remedy) for key in differ]
    hands, same = ("one hand", 1) if isinstance(b, RingBody) else ("opposite hands", -1)
    if not math.isclose(a.helix_angle, same * b.helix_angle, abs_tol=1e-12):
        what = "a ring and a gear in it have" if isinstance(b, RingBody) else "gears in mesh have"
        remedy = f"{what} {hands}: write {math.degrees(same * a.helix_angle):g} deg, as {a.name} asks"
        return [Problem(file, f"bodies.{b.name}.helix_angle", f"{math.degrees(b.helix_angle):g} deg", remedy)]
    places = [stage.place(gear.name, None) for gear in (a, b)]
    found = []
    if abs(places[0] - places[1]) > 1e-9:
        apart = millimetres(abs(places[0] - places[1]))
        remedy = f"{a.name} and {b.name} lie {apart} apart along the axis: give both one place"
        found.append(Problem(file, f"{field}.gears", ", ".join(mesh.gears), remedy))
    pair = PairSpec.model_construct(
        center_distance=centre_distance(stage, mesh), normal_module=a.normal_module, pressure_angle=a.pressure_angle,
        backlash=mesh.backlash, helix_angle=a.helix_angle,
    )  # fmt: skip
    axis = f"rotors.{stage.rotor_of(b.name)}.axis"
    names = {"pair.center_distance": axis, "pair.backlash": f"{field}.backlash"}
    if isinstance(b, RingBody):
        problems = ring_pair_problems(file, RingPair(pair, a, b, mesh.torque_max))
    else:
        problems = geometry_problems(file, pair, (a, b), mesh.torque_max)
    for problem in problems:
        name = names.get(problem.field, problem.field.replace("gears.", "bodies.", 1).replace("pair.", f"{field}.", 1))
        found.append(replace(problem, field=name))
    return found


def with_relief_rolls(stage: Stage) -> Stage:
    """The same stage with points of single contact turned into rolls, those of a gear's first engagement."""
    bodies = dict(stage.bodies)
    for mesh in reversed(stage.engagements):
        for index, name in enumerate(mesh.gears):
            bodies[name] = with_rolls(toothed(stage, name), mesh_shape(stage, mesh), index)
    return stage.model_copy(update={"bodies": bodies})


def _unknown_body(stage: Stage) -> str:
    return f"no such body: one of {', '.join(sorted(stage.bodies))}"


def _range(low: float, high: float) -> str:
    return f"from {millimetres(low)} to {millimetres(high)}"
