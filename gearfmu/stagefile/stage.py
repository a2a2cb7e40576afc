"""stage.toml → Stage, read and checked with the geometry.

The stage is judged by `checks`, whatever kind of file it is from. Problems of the file alone are found here: in fields
of a pair or of a planetary set that the general stage does not have, and files that are missing."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError, UnitError
from gearfmu.geometry.mesh import HANDS, least_apart
from gearfmu.quantities import range_of, to_si
from gearfmu.stagefile.checks.gears import Meshed, mesh_problems, millimetres, shown
from gearfmu.stagefile.checks.stage import stage_problems
from gearfmu.stagefile.forms.expand import expand, laid_out, pair_gears
from gearfmu.stagefile.forms.general import Form, Stage
from gearfmu.stagefile.forms.pair import StageSpec, in_order
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.forms.shapes import (
    carrier_geometry,
    gear_shape,
    planet_angles,
    set_carrier,
    with_relief_rolls,
    with_rolls,
)
from gearfmu.stagefile.reading.base import validate
from gearfmu.stagefile.reading.files import Changes, Layers, changed_tables, files_of, find_stage, put_at, read_layers
from gearfmu.stagefile.reading.judge import as_meant
from gearfmu.stagefile.tables.bodies import GearSpec, PairSpec
from gearfmu.stagefile.tables.topography import read_topography

Found = Iterator[tuple[str, str, str]]
ROLLING = "by its rolling bearing"


def load_stage(stage: str | os.PathLike[str], changes: Changes | None = None) -> Stage:
    """The stage of a file, a folder (its stage.toml) or a shipped name ("fzg_c", "fzg_c/stage_relief", "planetary54").

    changes : fields that are to be other than in the file (`files.py`), {"gears.pinion.tip_relief.amount": "20 um"};
    the file itself stays. SpecError lists everything that is wrong: unreadable or unknown fields, and geometry that
    cannot run or carry `torque_max`.
    """
    layers = read_layers(find_stage(stage))
    kind = stage_class(layers.tables)
    layers = layers.changed(changed_tables(kind, changes or {}))
    form, problems = _read(kind, layers)
    problems += _missing_files(layers)
    if form is None or problems:
        raise SpecError(layers.attributed(problem) for problem in problems)
    found = expand(_with_rolls(_with_paths(kind, layers)))
    if problems := _topography_problems(found, layers):
        raise SpecError(layers.attributed(problem) for problem in problems)
    return found


def stage_class(tables: Mapping[str, Any]) -> type[Form | Stage]:
    """StageSpec, PlanetarySpec or Stage: what the tables of a stage file are read as."""
    kinds: dict[Any, type[Form | Stage]] = {"planetary_set": PlanetarySpec, "general": Stage}
    return kinds.get(tables.get("kind"), StageSpec)


def _read(kind: type[Form | Stage], layers: Layers) -> tuple[Form | Stage | None, list[Problem]]:
    """What the file says, and all that is wrong with it. What is wrong with the stage that it means stands beside the
    fields that cannot be read, as far as it does not depend on them."""
    raw, file, tables = layers.tables, str(layers.path), _tables(kind, layers)
    form, problems = validate(kind, tables, file)
    if "source" in raw:
        problems = [Problem("", "source", str(raw["source"]), "unknown key: remove it"), *problems]
    meant = form if form is not None else as_meant(kind, tables)
    if meant is not None:
        problems += stage_problems(laid_out(judged(meant)))
        problems += [Problem(file, *entry) for entry in form_problems(meant)]
    elif kind is StageSpec:
        problems += _problems_of_gears(raw, file)
    return form, problems


def _tables(kind: type[Form | Stage], layers: Layers) -> dict[str, Any]:
    """What the file says, with the names that the gears of a set have, and its path."""
    raw = layers.tables
    named = {key: raw[key] | {"name": key} for key in HANDS if isinstance(raw.get(key), dict)}
    return raw | (named if kind is PlanetarySpec else {}) | {"source": layers.path}


def _with_paths(kind: type[Form | Stage], layers: Layers) -> Form | Stage:
    """What a valid file says, with the files of its bodies named as seen from here."""
    paths: dict[str, Any] = {}
    for field, _, path in files_of(layers):
        put_at(paths, field, str(path))
    form, _ = validate(kind, _tables(kind, layers.changed(paths)), str(layers.path))
    assert form is not None, "it was read already"
    return form


def _problems_of_gears(raw: Mapping[str, Any], file: str) -> list[Problem]:
    """What is wrong with the gears of a pair whose other tables cannot be read."""
    tables = raw.get("gears")
    if not isinstance(tables, dict) or len(tables) != 2 or not all(isinstance(t, dict) for t in tables.values()):
        return []
    pair, _ = validate(PairSpec, raw.get("pair"), file)
    read = [validate(GearSpec, table | {"name": name}, file)[0] for name, table in in_order(tables).items()]
    gears = [gear for gear in read if gear is not None]
    if pair is None or len(gears) < len(read):
        return []
    try:
        torque = to_si(raw.get("torque_max"), "N*m")
    except UnitError:
        torque = None
    first, second = pair_gears(pair, gears)
    judged_at = torque if torque is not None and torque > 0.0 else None  # another one is told by its own field
    mesh = Meshed((first, second), pair.center_distance, pair.backlash, judged_at)
    names = {"distance": "pair.center_distance", "backlash": "pair.backlash"}
    return [
        Problem(file, names.get(field, field.replace("bodies.", "gears.", 1)), shown(value), remedy)
        for field, value, remedy in mesh_problems(mesh)
    ]


def _with_rolls(form: Form | Stage) -> Form | Stage:
    """The same with points of single contact as lengths of roll; those of a set are in its stage alone."""
    if isinstance(form, StageSpec):
        gears = tuple(with_rolls(gear, form.geometry, i) for i, gear in enumerate(form.gears))
        return form.model_copy(update={"gears": gears})
    return with_relief_rolls(form) if isinstance(form, Stage) else form


def _topography_problems(stage: Stage, layers: Layers) -> list[Problem]:
    """What is wrong with the topographies of all gears; their files as seen from here."""
    found: list[Problem] = []
    for gear in stage.gears:
        if gear.topography is not None:
            path = Path(gear.topography)
            _, problems = read_topography(path, gear.teeth, gear_shape(gear))
            if problems and not path.is_file():
                field = f"{stage.table_of(gear.name)}.topography"
                problems = [Problem(str(layers.path), field, path.name, problems[0].remedy)]
            found += problems
    return list(dict.fromkeys(found))  # planets share a table


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
    planet, inner, outer = spec.planet.bore_diameter, 2 * (g.a - g.r_bolt), 2 * (g.a + g.r_bolt)
    for field, wrong, why, limit in (
        ("bolt_diameter", 2 * g.r_bolt >= planet, "does not fit the planet's bore: less than", planet),
        ("bore_diameter", g.r_bore >= g.a - g.r_bolt, "cuts into the bolts: less than", inner),
        ("outer_diameter", g.r_o <= g.a + g.r_bolt, "the bolts reach over the edge: more than", outer),
        ("bolt_diameter", 0 < half <= g.r_bolt, "neighbouring bolts touch: less than", 2 * half),
    ):
        if wrong:
            yield f"carrier.{field}", millimetres(getattr(carrier, field)), f"{why} {millimetres(limit)}"
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


def _missing_files(layers: Layers) -> list[Problem]:
    """A problem for every file that a section `import` or `reduced` names and that is not there, whatever else is wrong
    with the stage file."""
    return [
        Problem(str(layers.path), field, name, f"no file {path}: write it relative to the stage file")
        for field, name, path in files_of(layers)
        if not path.is_file() and not field.endswith(".topography")
    ]
