"""The table of the model blob's arrays (gearfmu/kernel/src/model/gk_fields.inc), read for the writer: what a model must
hold, and what is wrong with one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

TABLE = Path(__file__).parents[2] / "kernel" / "src" / "model" / "gk_fields.inc"
COUNTS = (
    "version",
    "slices",
    "rotors",
    "gears",
    "engagements",
    "ports",
    "supports",
    "functions",
    "rolls",
    "sets",
)
SIZES = ("rotor", "z", "modes", "reads", "both_flanks", "points", "low", "mirrored")
FLANK_SIZES = ("flank_teeth", "flank_places", "flank_rolls")
GEAR_NUMBERS = (
    "r_b",
    "s_form",
    "s_tip",
    "psi_b",
    "phase",
    "face_width",
    "local",
    "strip_half_width",
    "relief",
    "relief_start",
    "tip_edge",
    "corner_radius",
    "corner_angle",
    "z_mid",
    "helix",
)
ENGAGEMENT_NUMBERS = (
    "x_a",
    "y_a",
    "x_b",
    "y_b",
    "backlash",
    "nominal_backlash",
    "damping",
    "force_max",
    "tilt_x",
    "tilt_y",
)
_LINE = re.compile(r'^GK_FIELD\((\w+), (\w+), (\w+), "([^"]*)", "([^"]*)", "([^"]*)"\)$', re.MULTILINE)
_KINDS = {"I32": "iub", "F64": "f", "F32": "f", "TEXT": "U"}


@dataclass(frozen=True)
class Field:
    """One array of the blob. scope: MODEL, GEAR, SET or GEAR_SET; kind: I32, F64, F32 or TEXT; dimensions: numbers and
    symbols."""

    scope: str
    name: str
    kind: str
    dimensions: tuple[str, ...]
    unit: str
    description: str
    optional: bool


def gear_numbers(values: Mapping[str, float]) -> np.ndarray:
    """The section "gear" of GEAR_NUMBERS by name."""
    assert set(values) == set(GEAR_NUMBERS), set(values) ^ set(GEAR_NUMBERS)
    return np.array([float(values[name]) for name in GEAR_NUMBERS])


def change_gear(section: np.ndarray, **values: float) -> np.ndarray:
    """The section "gear" with some of GEAR_NUMBERS changed."""
    return gear_numbers(dict(zip(GEAR_NUMBERS, section, strict=True)) | values)


@cache
def fields() -> tuple[Field, ...]:
    """All arrays in the order of the table."""
    found = _LINE.findall(TABLE.read_text(encoding="utf-8"))
    return tuple(
        Field(scope, name, kind, tuple(sizes.lstrip("?").split()), unit, text, sizes.startswith("?"))
        for scope, name, kind, sizes, unit, text in found
    )


def order_sections(sections: Mapping[str, Any]) -> dict[str, Any]:
    """`sections` in the order of the table, floats in the precision in which they are stored. AssertionError that lists
    every section that is missing, unknown, or of another type or shape: the writer's mistake, not the user's."""
    sizes = dict(zip(COUNTS, map(int, sections["counts"]), strict=True))
    found = {"carried": "carried", "whirls": "whirl", "starts": "start_reference", "sensors": "sensed"}
    sizes |= {word: len(sections.get(name, ())) for word, name in found.items()}
    ordered, problems = {}, []
    for field, name, known in _instances(sections, sizes):
        if name not in sections:
            problems += [] if field.optional else [f"{name} is missing"]
            continue
        ordered[name] = np.asarray(sections[name], np.float32) if field.kind == "F32" else sections[name]
        problems += _problems(field, name, sections[name], known)
    problems += [f"{name} is unknown" for name in sections if name not in ordered]
    assert not problems, "; ".join(problems)
    return ordered


def _instances(sections: Mapping[str, Any], sizes: dict[str, int]) -> Iterator[tuple[Field, str, dict[str, int]]]:
    """Every field once per scope number: field, name of the section, sizes known there."""
    of_gear = {
        g: sizes
        | _with_places(dict(zip(SIZES, map(int, sections[f"size{g}"]), strict=True)), sizes["functions"])
        | {"own": len(sections.get(f"own_number{g}", ()))}
        | dict(zip(FLANK_SIZES, map(int, sections.get(f"flank_size{g}", (0, 0, 0))), strict=True))
        for g in range(sizes["gears"])
    }
    of_set = {s: sizes | {"ground": len(sections[f"omega_ground{s}"])} for s in range(sizes["sets"])}
    for field in fields():
        if field.scope == "MODEL":
            yield field, field.name, sizes
        elif field.scope == "GEAR":
            yield from ((field, f"{field.name}{g}", known) for g, known in of_gear.items())
        elif field.scope == "SET":
            yield from ((field, f"{field.name}{s}", known) for s, known in of_set.items())
        else:
            yield from (
                (field, f"{field.name}{g}_{s}", known | of_set[s] | {"reads": len(sections[f"ground_list{g}_{s}"])})
                for g, known in of_gear.items()
                for s in of_set
            )


def _with_places(size: dict[str, int], functions: int) -> dict[str, int]:
    """Sizes of a gear and what they come to: flanks with tables of their own, places of a flank, their pairs."""
    places = size["points"] * functions
    square, half = places**2, places * (places + 1) // 2
    of_image = {"flanks": 2 - size["mirrored"], "across": half if size["mirrored"] else square}
    return size | of_image | {"places": places, "half": half}


def _problems(field: Field, name: str, value: object, sizes: Mapping[str, int]) -> list[str]:
    array = np.asarray(value)
    if array.dtype.kind not in _KINDS[field.kind]:
        return [f"{name} holds {array.dtype}, expected {field.kind}"]
    if field.kind == "TEXT":
        return []
    shape = tuple(int(d) if d.isdigit() else sizes[d] for d in field.dimensions)
    return [] if array.shape == shape else [f"{name} has shape {array.shape}, expected {shape}"]
