"""stage.toml → Stage, read and checked with the geometry."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from typing import Any, TypeAlias

from gearfmu.errors import Problem, SpecError, UnitError
from gearfmu.stagefile.forms.bearing_checks import use_problems, uses_of_gears
from gearfmu.stagefile.forms.expand import expand
from gearfmu.stagefile.forms.flank_checks import located, topography_problems, with_rolls
from gearfmu.stagefile.forms.general import Form, Stage
from gearfmu.stagefile.forms.general_checks import general_problems, with_relief_rolls
from gearfmu.stagefile.forms.housing_checks import housing_problems
from gearfmu.stagefile.forms.pair import StageSpec, in_order
from gearfmu.stagefile.forms.pair_checks import geometry_problems
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.forms.planetary_checks import set_problems
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.reading.base import validate
from gearfmu.stagefile.reading.files import Changes, Layers, changed_tables, find_stage, read_layers
from gearfmu.stagefile.reading.judge import read_and_judge
from gearfmu.stagefile.tables.gear import GearSpec, PairSpec
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.imported import missing_files
from gearfmu.units import to_si


def load_stage(stage: str | os.PathLike[str], changes: Changes | None = None) -> Stage:
    """The stage of a file, a folder (its stage.toml) or a shipped name ("fzg_c", "fzg_c/stage_relief", "planetary54").

    changes : fields that are to be other than in the file (`files.py`), {"gears.pinion.tip_relief.amount": "20 um"};
    the file itself stays. SpecError lists everything that is wrong: unreadable or unknown fields, and geometry that
    cannot run or carry `torque_max`.
    """
    layers = read_layers(find_stage(stage))
    kind = stage_class(layers.tables)
    layers = layers.changed(changed_tables(kind, changes or {}))
    load = {PlanetarySpec: _load_set, Stage: _load_general}.get(kind, _load_pair)
    found, problems = load(layers)
    problems += missing_files(layers)
    if found is None or problems:
        raise SpecError(layers.attributed(problem) for problem in problems)
    spec = expand(found)
    problems = [Problem(str(layers.path), *entry) for entry in housing_problems(spec)]
    if problems := problems + _topography_problems(spec, layers):
        raise SpecError(layers.attributed(problem) for problem in problems)
    return spec


def stage_class(tables: Mapping[str, Any]) -> type[Form | Stage]:
    """StageSpec, PlanetarySpec or Stage: what the tables of a stage file are read as."""
    kinds: dict[Any, type[Form | Stage]] = {"planetary_set": PlanetarySpec, "general": Stage}
    return kinds.get(tables.get("kind"), StageSpec)


ROLLING = "by its rolling bearing"


Read: TypeAlias = "tuple[Form | Stage | None, list[Problem]]"  # with files as seen from here, and all that is wrong


def _load_pair(layers: Layers) -> Read:
    path, raw = layers.path, layers.tables
    problems = [_unknown("source", raw)] if "source" in raw else []
    spec, found = read_and_judge(StageSpec, raw | {"source": path}, str(path), _pair_problems)
    if spec is None and not found.judged:
        problems += _geometry_of_what_can_be_read(layers)
    problems += found.problems
    return (None if spec is None or problems else _with_relief_rolls(_with_paths(spec, layers))), problems


def _pair_problems(spec: StageSpec) -> list[Problem]:
    file = str(spec.source)
    rolling = use_problems(uses_of_gears(spec.gears), spec.bearings, spec.operating)
    found = [*_bearing_problems(file, spec), *(Problem(file, *entry) for entry in rolling)]
    return geometry_problems(file, spec.pair, spec.gears, spec.torque_max) + found


def _bearing_problems(file: str, spec: StageSpec) -> list[Problem]:
    """Gears that move along their axes and tilt are held there; both gears of a pair move alike."""
    names = [(gear, field) for gear in spec.gears for field in ("axial", "tilt")]
    given = [(gear, field) for gear, field in names if dict(gear.bearing).get(field, ROLLING) is not None]
    if not given and spec.pair.helix_angle == 0:
        return []
    why = "a helical gear" if spec.pair.helix_angle else "a gear whose mate or other direction is held so"
    example = {"axial": '"1e8 N/m"', "tilt": '"5e4 N*m/rad"'}
    return [
        Problem(
            file, f"gears.{gear.name}.bearing.{field}", "missing", f"{why} needs it: write {field} = {example[field]}"
        )
        for gear, field in names
        if (gear, field) not in given
    ]


def _load_set(layers: Layers) -> Read:
    path, raw = layers.path, layers.tables
    problems = [_unknown("source", raw)] if "source" in raw else []
    named = {key: raw[key] | {"name": key} for key in ("sun", "planet", "ring") if isinstance(raw.get(key), dict)}
    judge = partial(set_problems, str(path))
    spec, found = read_and_judge(PlanetarySpec, raw | named | {"source": path}, str(path), judge)
    return spec and _set_with_paths(spec, layers), problems + found.problems


def _load_general(layers: Layers) -> Read:
    path, raw = layers.path, layers.tables
    problems = [_unknown("source", raw)] if "source" in raw else []
    spec, found = read_and_judge(Stage, raw | {"source": path}, str(path), partial(general_problems, str(path)))
    problems += found.problems
    if spec is None or problems:
        return None, problems
    bodies = {gear.name: located(gear, layers, f"bodies.{gear.name}") for gear in spec.gears}
    bodies |= {own.name: _housing_with_paths(own, layers) for own in spec.housings}
    return with_relief_rolls(spec.model_copy(update={"bodies": spec.bodies | bodies})), []


def _housing_with_paths(housing: HousingBody, layers: Layers) -> HousingBody:
    field = "imported" if housing.imported else "reduced"
    located = housing.made_of.located(layers, f"bodies.{housing.name}.{housing.table}")
    return housing.model_copy(update={field: located})


def _topography_problems(stage: Stage, layers: Layers) -> list[Problem]:
    """What is wrong with the topographies of all gears."""
    found = (topography_problems(g, gear_shape(g), layers, stage.table_of(g.name)) for g in stage.gears)
    return list(dict.fromkeys(problem for problems in found for problem in problems))  # planets share a table


def _unknown(key: str, raw: dict[str, Any]) -> Problem:
    return Problem("", key, str(raw[key]), "unknown key: remove it")


def _geometry_of_what_can_be_read(layers: Layers) -> list[Problem]:
    """Geometry problems of a file that has other problems too, when pair and gears are readable."""
    raw, file = layers.tables, str(layers.path)
    tables = raw.get("gears")
    if (
        not isinstance(tables, dict)
        or len(tables) != 2
        or not all(isinstance(table, dict) for table in tables.values())
    ):
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
    return geometry_problems(file, pair, gears, torque)


def _with_paths(spec: StageSpec, layers: Layers) -> StageSpec:
    """The same stage with the files of its gears named as seen from here."""
    return spec.model_copy(update={"gears": tuple(located(g, layers, f"gears.{g.name}") for g in spec.gears)})


def _set_with_paths(spec: PlanetarySpec, layers: Layers) -> PlanetarySpec:
    """The same set with the files of its bodies named as seen from here."""
    parts: dict[str, Any] = {gear.name: located(gear, layers, gear.name) for gear in spec.gears}
    if spec.carrier.imported is not None:
        imported = spec.carrier.imported.located(layers, "carrier.import")
        parts["carrier"] = spec.carrier.model_copy(update={"imported": imported})
    parts["bodies"] = {name: _housing_with_paths(own, layers) for name, own in spec.bodies.items()}
    return spec.model_copy(update=parts)


def _with_relief_rolls(spec: StageSpec) -> StageSpec:
    """The same stage with points of single contact turned into rolls."""
    pair = spec.geometry
    return spec.model_copy(update={"gears": tuple(with_rolls(gear, pair, i) for i, gear in enumerate(spec.gears))})
