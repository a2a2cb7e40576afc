"""Can this planetary set be made, assembled and carry the torque? Every problem names a field and what to write there.

Sun and planet are checked as an external pair, then the ring, the planet in the ring, the assembly and the carrier.
Formulas: ISO 21771; tip interference: Colbourne (1987). Nothing here stops at the first problem.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gearfmu.errors import Problem
from gearfmu.geometry import involute
from gearfmu.geometry.gear import GearGeometry
from gearfmu.geometry.hertz import common_width, contact_modulus, half_width
from gearfmu.geometry.internal import InternalGearGeometry
from gearfmu.geometry.planetary import RingMesh, least_apart, set_ratio
from gearfmu.ranges import range_of
from gearfmu.stagefile.forms.flank_checks import flank_problems
from gearfmu.stagefile.forms.pair_checks import (
    STRIP_PER_HERTZ,
    Found,
    at_most,
    gear_problems,
    geometry_problems,
    import_problems,
    millimetres,
    rounded_down,
    rounded_up,
)
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.forms.shapes import (
    carrier_geometry,
    gear_geometry,
    planet_angles,
    ring_geometry,
    set_carrier,
    set_geometries,
)
from gearfmu.stagefile.tables.gear import PairSpec

_THINNEST_RIM = 0.5  # of the tooth height: thinner rims are outside the rim thickness factor of ISO 6336-3
_LARGEST_ALLOWANCE = 0.1  # of the module
_LARGEST_THICKENING = 0.005  # of the module


def set_problems(file: str, spec: PlanetarySpec) -> list[Problem]:
    """Everything that is wrong with a set whose single fields can be read."""
    _, planet, ring = set_geometries(spec)
    problems = _sun_mesh(file, spec)
    alone = list(_ring(spec, ring))
    found = [*alone, *_assembly(spec, planet), *_carrier(spec), *_mounts(spec)]
    base = ring.r_b - planet.r_b
    if spec.set.center_distance <= base or base <= 0:
        remedy = f"smaller than the difference of the base radii, {millimetres(base)}: check teeth and module"
        found.append(("set.center_distance", spec.set.center_distance, remedy))
    elif not any(field in ("ring.tip_diameter", "ring.fillet_radius") for field, *_ in alone):
        mesh = RingMesh(planet, ring, spec.set.center_distance, spec.set.backlash)
        found += [*_ring_mesh(spec, mesh), *_ring_strips(spec, mesh, ring_half_width(spec, mesh))]
    shown = ((field, value if isinstance(value, str) else millimetres(value), text) for field, value, text in found)
    return problems + [Problem(file, *entry) for entry in shown]


@dataclass(frozen=True)
class RingPair:
    """A pinion in a ring, by the names of a set. set: what they share (PairSpec); torque (N·m) on the pinion."""

    set: PairSpec
    planet: Any
    ring: Any
    torque: float


def ring_pair_problems(file: str, pair: RingPair) -> list[Problem]:
    """Everything that is wrong with a pinion in a ring, fields "gears.<name>.…" and "pair.…" as in a pair."""
    pinion, ring = gear_geometry(pair.planet, pair.set, 1), ring_geometry(pair.ring, pair.set, 1)
    names = {"planet": f"gears.{pair.planet.name}", "ring": f"gears.{pair.ring.name}", "set": "pair"}
    found = [(f"planet.{field}", value, remedy) for field, value, remedy in gear_problems(pair.planet, pinion)]
    found += _ring(pair, ring)
    distance, base = pair.set.center_distance, ring.r_b - pinion.r_b
    if distance <= base or base <= 0:
        remedy = f"smaller than the difference of the base radii, {millimetres(base)}: check teeth and module"
        found.append(("set.center_distance", distance, remedy))
    elif not found:
        mesh = RingMesh(pinion, ring, distance, pair.set.backlash)
        half_width = internal_half_width((pair.planet, pair.ring), mesh, pair.torque / pinion.r_b)
        found += [*_ring_mesh(pair, mesh), *_ring_strips(pair, mesh, half_width)]
    problems = []
    for field, value, text in found:
        part, _, rest = field.partition(".")
        shown = value if isinstance(value, str) else millimetres(value)
        problems.append(Problem(file, f"{names[part]}.{rest}", shown, text.replace("planet", "pinion")))
    return problems


def mesh_torque(spec: PlanetarySpec) -> float:
    """Torque (N·m) on the sun in its mesh with the most loaded planet at torque_max, K_γ T_s/N."""
    sun = spec.torque_max / set_ratio(spec.sun.teeth, spec.ring.teeth)
    return spec.set.load_sharing * sun / spec.set.planets


def _sun_mesh(file: str, spec: PlanetarySpec) -> list[Problem]:
    """Sun and planet by themselves and as a pair; fields under their names in a set."""
    s = spec.set
    pair = PairSpec.model_construct(
        center_distance=s.center_distance, normal_module=s.normal_module, pressure_angle=s.pressure_angle,
        helix_angle=s.helix_angle, backlash=s.backlash,
    )  # fmt: skip
    gears: tuple[Any, Any] = (spec.sun, spec.planet)  # they have the fields of a GearSpec that are checked
    found = geometry_problems(file, pair, gears, mesh_torque(spec))
    renamed = {"gears.": "", "pair.": "set."}
    for old, new in renamed.items():
        found = [
            replace(p, field=new + p.field.removeprefix(old)) if p.field.startswith(old) else p for p in found
        ]  # fmt: skip
    return found


def _ring(spec: PlanetarySpec | RingPair, shape: InternalGearGeometry) -> Found:
    """The ring by itself, from the root inwards."""
    for field, value, remedy in import_problems(spec.ring, shape):
        yield f"ring.{field}", value, remedy
    fillet, tip = "ring.fillet_radius", "ring.tip_diameter"
    if shape.fillet_centre[1] <= 0:
        yield fillet, f"{spec.ring.fillet_radius:g}", "the two fillets of a space overlap: make it smaller"
    least = 2 * (shape.r_b + 1e-3 * shape.m)
    if shape.s_tip <= 0:
        remedy = f"the tip reaches inside the base circle, where there is no involute: above {millimetres(least)}"
        yield tip, spec.ring.tip_diameter, remedy
    elif shape.s_form <= shape.s_tip:
        yield tip, spec.ring.tip_diameter, "no involute is left between tip and fillet: make it smaller"
    elif shape.tip_half_angle <= 0:
        yield tip, spec.ring.tip_diameter, "the tooth is pointed (tip thickness ≤ 0): make it larger"
    elif shape.tip_land_half_angle < 0:
        land = millimetres(2 * shape.r_a * shape.tip_half_angle)
        yield "ring.tip_edge_radius", spec.ring.tip_edge_radius, f"the two roundings overlap on a tip of {land}"
    else:
        for field, value, remedy in flank_problems(spec.ring, shape):
            yield f"ring.{field}", value, remedy
    height = shape.r_f - shape.r_a
    if shape.r_rim < shape.r_f + _THINNEST_RIM * height:
        least = 2 * (shape.r_f + _THINNEST_RIM * height)
        remedy = f"leaves a rim thinner than half the tooth height: at least {millimetres(rounded_up(least))}"
        yield "ring.rim_diameter", spec.ring.rim_diameter, remedy


def _ring_mesh(spec: PlanetarySpec | RingPair, mesh: RingMesh) -> Found:
    """Form circles, tips, contact ratio and backlash of the planet in the ring."""
    if mesh.ring.r_a < mesh.least_tip_radius:
        least = rounded_up(2 * mesh.least_tip_radius, 5)
        remedy = (
            f"interference: the tip meets the planet below its form circle; at least {millimetres(least)} "
            f"(tip radius {millimetres(least / 2)})"
        )
        yield "ring.tip_diameter", spec.ring.tip_diameter, remedy
    if mesh.a + mesh.planet.r_a >= mesh.ring.r_f:
        largest = millimetres(rounded_down(2 * (mesh.ring.r_f - mesh.a), 5))
        yield "planet.tip_diameter", spec.planet.tip_diameter, f"touches the ring's root: less than {largest}"
    elif mesh.planet.r_a > mesh.largest_planet_tip_radius:
        largest = at_most(2 * mesh.largest_planet_tip_radius, 5)
        remedy = f"interference: the tip meets the ring in its root fillet; {largest}"
        yield "planet.tip_diameter", spec.planet.tip_diameter, remedy
    if mesh.tip_clearance_angle < 0:
        remedy = "planet and ring collide with their tips outside the line of action: make it larger, or more teeth"
        yield "ring.tip_diameter", spec.ring.tip_diameter, remedy
    if mesh.contact_ratio < 1:
        remedy = f"the contact ratio of planet and ring is {mesh.contact_ratio:.3f}, below 1: make it smaller"
        yield "ring.tip_diameter", spec.ring.tip_diameter, remedy
    allowance = spec.set.backlash - mesh.nominal_backlash
    if not -_LARGEST_THICKENING * mesh.planet.m <= allowance <= _LARGEST_ALLOWANCE * mesh.planet.m:
        remedy = (
            f"profile shifts and centre distance give j_wt = {millimetres(mesh.nominal_backlash)} of planet and ring, "
            f"not the declared {millimetres(spec.set.backlash)}: correct it"
        )
        yield "ring.profile_shift", f"{spec.ring.profile_shift:g}", remedy


def _ring_strips(spec: PlanetarySpec | RingPair, mesh: RingMesh, half_width: float) -> Found:
    """Load strips; half_width (m): largest Hertz half-width."""
    least = STRIP_PER_HERTZ * half_width
    for part, gear, shape in (("planet", spec.planet, mesh.planet), ("ring", spec.ring, mesh.ring)):
        field, width = f"{part}.body.strip_half_width", gear.body.strip_half_width
        flank = abs(float(involute.arc_length(shape.s_tip, shape.r_b) - involute.arc_length(shape.s_form, shape.r_b)))
        if width < least:
            remedy = f"too narrow for the ring's contact at torque_max: at least {millimetres(rounded_up(least, 3))}"
            yield field, width, remedy
        elif gear is spec.ring and 2 * width > flank:
            yield field, width, f"the load patch is longer than the flank: {at_most(flank / 2)}"


def ring_half_width(spec: PlanetarySpec, mesh: RingMesh) -> float:
    """Largest Hertz half-width b (m) of planet and ring, one tooth pair carrying the most loaded planet's force."""
    force = mesh_torque(spec) / set_geometries(spec)[0].r_b
    return internal_half_width((spec.planet, spec.ring), mesh, force)


def internal_half_width(gears: tuple[Any, Any], mesh: RingMesh, force: float) -> float:
    """Largest Hertz half-width b (m) of a pinion in a ring, one tooth pair carrying `force` (N, transverse;
    `largest_half_width` for helical flanks)."""
    load = force / common_width(gears)
    materials = [gear.material for gear in gears]
    e_star = contact_modulus(
        (materials[0].youngs_modulus, materials[1].youngs_modulus),
        (materials[0].poisson_ratio, materials[1].poisson_ratio),
    )
    return half_width(load, mesh.largest_relative_radius() / math.cos(mesh.planet.beta_b), e_star)


def _assembly(spec: PlanetarySpec, planet: GearGeometry) -> Found:
    teeth, planets, positions = spec.sun.teeth + spec.ring.teeth, spec.set.planets, spec.set.positions
    if positions is None and teeth % planets:
        most = int(range_of("planets").high)
        fitting = [n for n in range(2, most + 1) if teeth % n == 0]
        nearest = ", ".join(str(round(k * teeth / planets)) for k in range(planets))
        remedy = (
            f"the set cannot be assembled with equally spaced planets: (z_sun + z_ring)/planets = {teeth}/{planets} is "
            f"no integer; possible are {', '.join(map(str, fitting)) or 'none'}, or other tooth numbers, or planets "
            f"that are not equally spaced: write positions = [{nearest}]"
        )
        yield "set.planets", str(planets), remedy
    if positions is not None and not _are_places(positions, planets, teeth):
        shown = f"[{', '.join(map(str, positions))}]"
        remedy = f"one for each of the {planets} planets, ascending from 0 and below z_sun + z_ring = {teeth}"
        yield "set.positions", shown, remedy
        return
    room = 2 * spec.set.center_distance * math.sin(least_apart(planet_angles(spec)) / 2)
    if room <= 2 * planet.r_a:
        remedy = f"neighbouring planets touch: their axes are {millimetres(room)} apart, the tip diameter is "
        yield "set.planets", str(planets), f"{remedy}{millimetres(2 * planet.r_a)}; fewer or smaller planets"
    for field in ("pin_errors", "planet_eccentricity"):
        for pin in getattr(spec.set, field):
            if pin >= planets:
                yield f"set.{field}.{pin}", str(pin), f"no such pin: the {planets} are 0 to {planets - 1}"


def _are_places(positions: Sequence[int], planets: int, teeth: int) -> bool:
    """Whether they are places of the planets, in steps of 2π/teeth."""
    ascending = all(a < b for a, b in zip(positions, positions[1:], strict=False))
    return len(positions) == planets and positions[0] == 0 and ascending and positions[-1] < teeth


def _mounts(spec: PlanetarySpec) -> Found:
    mounts = spec.ring.mounts
    if mounts is not None and mounts.points > spec.ring.teeth:
        yield "ring.mounts.points", str(mounts.points), f"at most one a tooth space: up to {spec.ring.teeth}"
    if mounts is not None and mounts.to is not None and mounts.to not in spec.bodies:
        known = ", ".join(spec.bodies) or "none: write [bodies.housing]"
        yield "ring.mounts.to", mounts.to, f"no housing of this set: {known}"
    if mounts is not None and mounts.to is not None and "ring" in spec.ports:
        yield "ring.mounts.to", mounts.to, "a ring with a port turns: it stands on no housing; leave the port away"
    for support in spec.supports:
        if support.body not in spec.bodies:
            yield f"supports.{support.name}.body", support.body, "here are feet of a housing alone"


def _carrier(spec: PlanetarySpec) -> Iterator[tuple[str, float | str, str]]:
    g, carrier = carrier_geometry(set_carrier(spec)), spec.carrier
    if 2 * g.r_bolt >= spec.planet.bore_diameter:
        largest = millimetres(spec.planet.bore_diameter)
        yield "carrier.bolt_diameter", carrier.bolt_diameter, f"does not fit the planet's bore: less than {largest}"
    if g.r_bore >= g.a - g.r_bolt:
        largest = millimetres(2 * (g.a - g.r_bolt))
        yield "carrier.bore_diameter", carrier.bore_diameter, f"cuts into the bolts: less than {largest}"
    if g.r_o <= g.a + g.r_bolt:
        least = millimetres(2 * (g.a + g.r_bolt))
        yield "carrier.outer_diameter", carrier.outer_diameter, f"the bolts reach over the edge: more than {least}"
    if 0 < (half := g.a * math.sin(least_apart(g.angles) / 2)) <= g.r_bolt:
        largest = millimetres(2 * half)
        yield "carrier.bolt_diameter", carrier.bolt_diameter, f"neighbouring bolts touch: less than {largest}"
    if carrier.imported is not None and len(set(carrier.imported.bolts)) != g.planets:
        named = ", ".join(carrier.imported.bolts) or "none"
        yield "carrier.import.bolts", named, f"one node set for each of the {g.planets} bolts, each its own"
    known = ["bore", *(f"bolt{k}" for k in range(g.planets))]
    bolts = [name for name in known[1:] if name in carrier.coupling]
    if bolts and len(bolts) < g.planets:
        left = ", ".join(name for name in known[1:] if name not in carrier.coupling)
        yield "carrier.coupling", ", ".join(bolts), f"{left} would be rigid unsaid: name it too, rigid or averaging"
    for name in carrier.coupling:
        if name not in known:
            yield f"carrier.coupling.{name}", carrier.coupling[name], f"no such interface: known are {', '.join(known)}"
