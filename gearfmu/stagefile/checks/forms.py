"""What only the file of a pair or of a planetary set can get wrong: fields that the general stage does not have."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from gearfmu.geometry.mesh import least_apart
from gearfmu.ranges import range_of
from gearfmu.stagefile.checks.gears import millimetres
from gearfmu.stagefile.forms.general import Form, Stage
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.forms.shapes import carrier_geometry, planet_angles, set_carrier

Found = Iterator[tuple[str, str, str]]
ROLLING = "by its rolling bearing"


def form_problems(form: Form | Stage) -> Found:
    """(field, value, remedy) of everything that is wrong with a file besides what is wrong with its stage."""
    if isinstance(form, StageSpec):
        yield from _held_along(form)
    elif isinstance(form, PlanetarySpec):
        yield from _assembly(form)
        yield from _carrier(form)
        yield from _mounts(form)


def judged(form: Form | Stage) -> Form | Stage:
    """What is expanded to be judged: a set whose planets have no places that fit, with equally spaced ones."""
    if isinstance(form, PlanetarySpec) and not _positions_fit(form):
        return form.model_copy(update={"set": form.set.model_copy(update={"positions": None})})
    return form


def _held_along(spec: StageSpec) -> Found:
    """Gears that move along their axes and tilt are held there; both gears of a pair move alike."""
    names = [(gear, field) for gear in spec.gears for field in ("axial", "tilt")]
    given = [(gear, field) for gear, field in names if dict(gear.bearing).get(field, ROLLING) is not None]
    if not given and spec.pair.helix_angle == 0:
        return
    why = "a helical gear" if spec.pair.helix_angle else "a gear whose mate or other direction is held so"
    example = {"axial": '"1e8 N/m"', "tilt": '"5e4 N*m/rad"'}
    for gear, field in names:
        if (gear, field) not in given:
            yield f"gears.{gear.name}.bearing.{field}", "missing", f"{why} needs it: write {field} = {example[field]}"


def _assembly(spec: PlanetarySpec) -> Found:
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
    if positions is not None and not _positions_fit(spec):
        shown = f"[{', '.join(map(str, positions))}]"
        remedy = f"one for each of the {planets} planets, ascending from 0 and below z_sun + z_ring = {teeth}"
        yield "set.positions", shown, remedy
        return
    room = 2 * spec.set.center_distance * math.sin(least_apart(planet_angles(spec)) / 2)
    if room <= spec.planet.tip_diameter:
        remedy = f"neighbouring planets touch: their axes are {millimetres(room)} apart, the tip diameter is "
        yield "set.planets", str(planets), f"{remedy}{millimetres(spec.planet.tip_diameter)}; fewer or smaller planets"
    for field in ("pin_errors", "planet_eccentricity"):
        for pin in getattr(spec.set, field):
            if pin >= planets:
                yield f"set.{field}.{pin}", str(pin), f"no such pin: the {planets} are 0 to {planets - 1}"


def _positions_fit(spec: PlanetarySpec) -> bool:
    """Whether `positions` are places of the planets, in steps of 2π/(z_sun + z_ring), or left to equal spacing."""
    positions: Sequence[int] | None = spec.set.positions
    if positions is None:
        return True
    ascending = all(a < b for a, b in zip(positions, positions[1:], strict=False))
    teeth = spec.sun.teeth + spec.ring.teeth
    return len(positions) == spec.set.planets and positions[0] == 0 and ascending and positions[-1] < teeth


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


def _carrier(spec: PlanetarySpec) -> Found:
    g, carrier = carrier_geometry(set_carrier(spec)), spec.carrier
    half = g.a * math.sin(least_apart(g.angles) / 2)
    if 2 * g.r_bolt >= spec.planet.bore_diameter:
        remedy = f"does not fit the planet's bore: less than {millimetres(spec.planet.bore_diameter)}"
        yield "carrier.bolt_diameter", millimetres(carrier.bolt_diameter), remedy
    if g.r_bore >= g.a - g.r_bolt:
        remedy = f"cuts into the bolts: less than {millimetres(2 * (g.a - g.r_bolt))}"
        yield "carrier.bore_diameter", millimetres(carrier.bore_diameter), remedy
    if g.r_o <= g.a + g.r_bolt:
        remedy = f"the bolts reach over the edge: more than {millimetres(2 * (g.a + g.r_bolt))}"
        yield "carrier.outer_diameter", millimetres(carrier.outer_diameter), remedy
    if 0 < half <= g.r_bolt:
        remedy = f"neighbouring bolts touch: less than {millimetres(2 * half)}"
        yield "carrier.bolt_diameter", millimetres(carrier.bolt_diameter), remedy
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
