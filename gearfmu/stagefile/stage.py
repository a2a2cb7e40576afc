"""stage.toml → Stage, read and checked with the geometry."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from gearfmu.errors import Problem, SpecError, UnitError
from gearfmu.geometry.mesh import HANDS
from gearfmu.stagefile.checks.forms import form_problems, judged
from gearfmu.stagefile.checks.gears import shown
from gearfmu.stagefile.checks.meshes import Meshed, mesh_problems
from gearfmu.stagefile.checks.stage import stage_problems
from gearfmu.stagefile.forms.expand import expand, laid_out, pair_gears
from gearfmu.stagefile.forms.general import Form, Stage
from gearfmu.stagefile.forms.pair import StageSpec, in_order
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.forms.shapes import gear_shape, with_relief_rolls, with_rolls
from gearfmu.stagefile.reading.base import Spec, validate
from gearfmu.stagefile.reading.files import Changes, Layers, changed_tables, find_stage, read_layers
from gearfmu.stagefile.reading.judge import as_meant
from gearfmu.stagefile.tables.gear import GearSpec, PairSpec
from gearfmu.stagefile.tables.imported import missing_files
from gearfmu.stagefile.tables.topography import read_topography
from gearfmu.units import to_si

Table = TypeVar("Table", bound=Spec)


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
    problems += missing_files(layers)
    if form is None or problems:
        raise SpecError(layers.attributed(problem) for problem in problems)
    found = expand(_with_rolls(_with_paths(form, layers)))
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
    raw, file = layers.tables, str(layers.path)
    named = {key: raw[key] | {"name": key} for key in ("sun", "planet", "ring") if isinstance(raw.get(key), dict)}
    tables = raw | (named if kind is PlanetarySpec else {}) | {"source": layers.path}
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
    mesh = Meshed((first, second), pair.center_distance, pair.backlash, torque)
    names = {"distance": "pair.center_distance", "backlash": "pair.backlash"}
    return [
        Problem(file, names.get(field, field.replace("bodies.", "gears.", 1)), shown(value), remedy)
        for field, value, remedy in mesh_problems(mesh)
    ]


def _with_paths(form: Form | Stage, layers: Layers) -> Form | Stage:
    """The same with the files of its bodies named as seen from here."""
    if isinstance(form, StageSpec):
        return form.model_copy(update={"gears": tuple(_located(g, layers, f"gears.{g.name}") for g in form.gears)})
    bodies = {name: _located(body, layers, f"bodies.{name}") for name, body in form.bodies.items()}
    parts: dict[str, Any] = {"bodies": bodies}
    if isinstance(form, PlanetarySpec):
        parts |= {name: _located(part, layers, name) for name, part in form if name in (*HANDS, "carrier")}
    return form.model_copy(update=parts)


def _located(part: Table, layers: Layers, place: str) -> Table:
    """A body with its files as seen from here. place: its table, "gears.pinion"."""
    found: dict[str, Any] = {}
    for field, value in part:
        if field in ("imported", "reduced") and value is not None:
            found[field] = value.located(layers, f"{place}.{'import' if field == 'imported' else field}")
        elif field == "topography" and value is not None:
            found[field] = str(layers.holder(f"{place}.{field}").parent / value)
    return part.model_copy(update=found) if found else part


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
