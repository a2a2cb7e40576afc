"""What is wrong with a stage, under the names of its file: names that must exist, places on shafts, axes, bearings, the
housing, and every mesh. Nothing here stops at the first problem."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

from gearfmu.errors import Problem
from gearfmu.quantities import kernel_limits
from gearfmu.stagefile.checks.gears import Meshed, mesh_problems, millimetres, shown
from gearfmu.stagefile.forms.general import EngagementSpec, GearBody, RingBody, Stage, ToothedBody
from gearfmu.stagefile.forms.shapes import centre_distance, toothed
from gearfmu.stagefile.tables.bodies import ShaftBody
from gearfmu.stagefile.tables.connections import DIRECTIONS, BallBearing, RollerBearing, SupportSpec
from gearfmu.stagefile.tables.housing import HousingBody

Found = Iterator[tuple[str, str, str]]  # field of the stage, value, remedy
_SAME_RACK = ("normal_module", "pressure_angle")


def stage_problems(stage: Stage) -> list[Problem]:
    """Everything that is wrong with a stage whose single fields can be read."""
    found = [*_rolling(stage), *_housing(stage)]
    if isinstance(stage.written, Stage):  # the others are built, and have names and places of their own
        found = [*_counts(stage), *_rotors(stage), *_names(stage), *found]
        stage = _what_can_be_judged(stage)
        found += [*_places(stage), *_held(stage)]
    for engagement in stage.engagements:
        found += _mesh(stage, engagement)
    file = str(stage.source)
    return list(dict.fromkeys(Problem(file, stage.in_file(field), value, remedy) for field, value, remedy in found))


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
    springs = [own for s in stage.supports for field, own in DIRECTIONS.items() if getattr(s, field) is not None]
    held = sum(map(len, springs))
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
    for group, items, longest in (("engagements", stage.engagements, 31), ("supports", stage.supports, 20)):
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
            remedy = f"{name} is a gear and held at its mid-width, {millimetres(origin)}: leave it away"
            yield field, millimetres(at), remedy


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


def _rolling(stage: Stage) -> Found:
    """Rolling bearings: known, on the side that they carry, in place of springs between a shaft or gear and ground."""
    for support in stage.supports:
        place = f"supports.{support.name}"
        if support.bearing is None:
            for field, value in support:
                if field in ("span", "carries") and value is not None:
                    remedy = 'it is about a rolling bearing: name one, bearing = "…", or leave it away'
                    yield f"{place}.{field}", f"{value}", remedy
            continue
        if stage.operating is None:
            used = f"{stage.in_file(place)} has a rolling bearing, which is linearised at a load"
            yield "operating.torque", "missing", f'{used}: write torque = "100 N*m"'
        if support.bearing in stage.bearings:
            yield from _sides(support, stage.bearings[support.bearing])
        else:
            known = ", ".join(sorted(stage.bearings)) or "none"
            remedy = f"no such bearing: write [bearings.{support.bearing}]; there are {known}"
            yield f"{place}.bearing", support.bearing, remedy
        for field, value in support:
            if field in DIRECTIONS and value is not None:
                yield f"{place}.{field}", f"{value}", f"{support.bearing} has its own stiffness: leave it away"
        if support.to is not None:
            yield f"{place}.to", support.to, "a rolling bearing rests on the ground: leave it away"


def _sides(support: SupportSpec, bearing: BallBearing | RollerBearing) -> Found:
    """Bearings that carry one axial direction say which."""
    angled = bearing.contact_angle > 0
    sided, field = angled or bearing.preload > 0, f"supports.{support.name}.carries"
    if sided and support.carries is None and support.span is None:
        why = "has a contact angle" if angled else "is preloaded"
        remedy = f'{support.bearing} {why}: say which axial force of the shaft it carries, carries = "+z" or "-z"'
        yield field, "missing", remedy
    if not sided and support.carries is not None:
        yield field, support.carries, f"{support.bearing} has no contact angle and no preload: leave it away"


def _housing(stage: Stage) -> Found:
    """One housing, seats and feet that exist. Where seats lie is known from its mesh (stage/assembly/housed.py); what
    hangs freely is refused by `Stage.require_motion`."""
    for other in stage.housings[1:]:
        yield f"bodies.{other.name}.kind", "housing", f"{stage.housings[0].name} is one already: keep one housing"
    for housing in stage.housings[:1]:
        yield from _on_no_rotor(stage, housing)
        for support in stage.supports:
            if housing.name in (support.body, support.to):
                yield from _on_housing(stage, housing, support)


def _on_no_rotor(stage: Stage, housing: HousingBody) -> Found:
    for name, rotor in stage.rotors.items():
        if housing.name in rotor.bodies:
            yield f"rotors.{name}.bodies.{housing.name}", housing.name, "a housing stands: name it in no rotor"
    for name, port in stage.ports.items():
        if port.body == housing.name:
            yield f"ports.{name}.body", housing.name, "a housing does not turn: name a shaft or a gear"


def _on_housing(stage: Stage, housing: HousingBody, support: SupportSpec) -> Found:
    place, foot = f"supports.{support.name}", support.body == housing.name
    known, what = (housing.made_of.feet, "feet") if foot else (housing.made_of.seats, "seats")
    if foot and support.to is not None:
        yield f"{place}.to", support.to, f"a foot of {housing.name} stands on the ground: leave `to` away"
    if foot and support.bearing is not None:
        yield f"{place}.bearing", support.bearing, "a foot has springs: write radial, axial, tilt and torsion"
    if foot and support.at is not None:
        yield f"{place}.at", f"{support.at:g}", "its node set says where a foot lies: leave it away"
    if support.node not in known:
        remedy = f"no node of {housing.name}: its {what} are {', '.join(known) or f'not named in its {housing.table}'}"
        yield f"{place}.node", support.node or "missing", remedy
    spins = not foot and support.body in stage.bodies and not stage.rotors[stage.rotor_of(support.body)].stands
    if spins and support.torsion is not None:
        yield f"{place}.torsion", f"{support.torsion}", "a bearing on a housing cannot hold a spin: leave it away"


def _mesh(stage: Stage, mesh: EngagementSpec) -> Found:
    """One engagement and its gears."""
    a, b = (toothed(stage, name) for name in mesh.gears)
    field, gears = f"engagements.{mesh.name}", ", ".join(mesh.gears)
    if not isinstance(a, GearBody):
        yield f"{field}.gears", gears, "a ring is gear B of its meshes: name it second"
        return
    if stage.rotor_of(a.name) == stage.rotor_of(b.name):
        yield f"{field}.gears", gears, "two gears of one rotor: name gears of two"
        return
    differ = [key for key in _SAME_RACK if not math.isclose(getattr(a, key), getattr(b, key), abs_tol=1e-12)]
    for key in differ:
        remedy = f"{a.name} and {b.name} differ in it: gears in mesh share the basic rack"
        yield f"bodies.{b.name}.{key}", f"{getattr(b, key):g}", remedy
    hands, same = ("one hand", 1) if isinstance(b, RingBody) else ("opposite hands", -1)
    if not differ and not math.isclose(a.helix_angle, same * b.helix_angle, abs_tol=1e-12):
        what = "a ring and a gear in it have" if isinstance(b, RingBody) else "gears in mesh have"
        remedy = f"{what} {hands}: write {math.degrees(same * a.helix_angle):g} deg, as {a.name} asks"
        yield f"bodies.{b.name}.helix_angle", f"{math.degrees(b.helix_angle):g} deg", remedy
    elif not differ:
        apart = abs(stage.place(a.name, None) - stage.place(b.name, None))
        if apart > 1e-9:
            remedy = f"{a.name} and {b.name} lie {millimetres(apart)} apart along the axis: give both one place"
            yield f"{field}.gears", gears, remedy
        carried = stage.frame_of(mesh) is not None
        meshed = Meshed((a, b), centre_distance(stage, mesh), mesh.backlash, mesh.torque_max, carried)
        names = {"distance": f"rotors.{stage.rotor_of(b.name)}.axis", "backlash": f"{field}.backlash"}
        for key, value, remedy in mesh_problems(meshed):
            yield names.get(key, key), shown(value), remedy


def _unknown_body(stage: Stage) -> str:
    return f"no such body: one of {', '.join(sorted(stage.bodies))}"


def _range(low: float, high: float) -> str:
    return f"from {millimetres(low)} to {millimetres(high)}"
