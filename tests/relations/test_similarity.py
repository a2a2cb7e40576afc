"""Similarity: with all lengths × c, forces × c² and times × c a stage of the same material is the same stage. Transmission
error grows with c, forces with c², frequencies fall with 1/c; bodies are reduced anew.

A number of a stage is scaled by the dimension of its unit, which its range gives (`Quantity`), so that no field can be
forgotten. c is a power of 4, so that even c^(−3/2), by which mass-normalised rows are scaled, is exact in binary
numbers: what remains is rounding, and constants with a unit that nobody wrote down.

Where it does not hold: drawn deviations follow the tolerances of ISO 1328-1, which are made for millimetres and
micrometres; measured profiles are files; the law of Benedict and Kelley takes the logarithm of a number with a unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, get_args

import numpy as np
import pint
import pytest
from kinds import COARSE, KINDS, Kind, assembled, channels, differences

from gearfmu.body import reduce_body
from gearfmu.spec.forms.expand import as_general, spread
from gearfmu.spec.forms.members import body_names
from gearfmu.spec.reading.base import Quantity, Spec
from gearfmu.spec.stage import load_stage
from gearfmu.spec.forms.planetary import CarrierMeshSpec, CarrierSpec
from gearfmu.spec.tables.gear import BodySpec
from gearfmu.stage import StageModel, loaded_te

EXPONENTS = {"[length]": 1, "[mass]": 3, "[time]": 1}  # of c: force = mass · length/time² is 2, density 0
UNITS = pint.UnitRegistry(cache_folder=None)


@cache
def exponent(unit: str) -> int:
    """Power of c by which numbers of this SI unit are scaled."""
    text = unit.replace(".", "*").replace("s2", "s^2").replace("m2", "m^2").replace("m3", "m^3")
    dimension = UNITS.parse_units(text).dimensionality if text else {}
    return int(sum(EXPONENTS[name] * power for name, power in dimension.items()))


def quantities(annotation: Any) -> list[Quantity]:
    """All that a type says of its numbers, however deep."""
    own = [item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, Quantity)]
    return own + [found for part in get_args(annotation) for found in quantities(part)]


def scaled(spec: Any, c: float) -> Any:
    """A spec with every number of it scaled."""
    update = {}
    for name, field in type(spec).model_fields.items():
        known = [q for q in field.metadata if isinstance(q, Quantity)] + quantities(field.annotation)
        powers = {exponent(q.unit) for q in known}
        update[name] = _scaled(getattr(spec, name), c, powers, f"{type(spec).__name__}.{name}")
    return spec.model_copy(update=update)


def _scaled(value: Any, c: float, powers: set[int], place: str) -> Any:
    if isinstance(value, Spec):
        return scaled(value, c)
    if isinstance(value, Mapping):
        return {key: _scaled(item, c, powers, place) for key, item in value.items()}
    if isinstance(value, tuple):
        return tuple(_scaled(item, c, powers, place) for item in value)
    if not isinstance(value, float):
        return value
    assert len(powers) == 1, f"{place}: a number without a quantity, or with two of them"
    return value * c ** next(iter(powers))


def file_of(kind: Kind) -> Any:
    """The stage as its file is written, with coarse bodies."""
    if kind.file == "internal":
        return _coarse(kind.stage)
    return _coarse(load_stage(kind.file))


def _coarse(value: Any) -> Any:
    if isinstance(value, BodySpec):
        return COARSE.model_copy(update={"strip_half_width": value.strip_half_width})
    if isinstance(value, CarrierMeshSpec):
        return value.model_copy(update={"scale": 0.5})
    if isinstance(value, Spec):
        update = {name: _coarse(getattr(value, name)) for name in type(value).model_fields}
        return value.model_copy(update=update | ({"modes": 24} if isinstance(value, CarrierSpec) else {}))
    if isinstance(value, Mapping):
        return {key: _coarse(item) for key, item in value.items()}
    return tuple(map(_coarse, value)) if isinstance(value, tuple) else value


@cache
def bodies_at(name: str, c: float) -> dict[str, Any]:
    """Bodies of a kind, scaled and reduced anew, by the names of its general form."""
    spec = scaled(file_of(KINDS[name]), c)
    return spread(spec, [reduce_body(spec, body) for body in body_names(spec)])


def model_at(kind: Kind, c: float) -> StageModel:
    return assembled(as_general(scaled(file_of(kind), c)), bodies_at(kind.name, c))


def load_at(kind: Kind, c: float) -> Kind:
    """The kind under its load, scaled."""
    return replace(
        kind, torque=kind.torque * c**3, speed=kind.speed / c, step=kind.step * c, duration=kind.duration * c
    )


def misfits(kind: Kind, c: float, parameters: Mapping[str, tuple[float, str]], duration: float) -> dict[str, float]:
    """Largest difference of every channel of a run between a stage and the scaled one, over the largest of its
    family. parameters: number and unit, by name."""
    found = []
    for factor in (1.0, c):
        own = load_at(replace(kind, duration=duration), factor)
        trace = own.run(model_at(kind, factor), {n: v * factor ** exponent(u) for n, (v, u) in parameters.items()})
        found.append({n: v / factor ** exponent(trace.channels[n].unit) for n, v in channels(trace).items()})
    return differences(*found)
