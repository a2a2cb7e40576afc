"""The model blob: named constant arrays in one checked block of bytes, read in place by the kernel (layout:
docs/file-formats.md, "Model blob").

The rules of the bytes are checked in gearfmu/kernel/src/base/gk_blob.c; one content has exactly one sequence of bytes.
Which arrays a model holds says the table gearfmu/kernel/src/model/gk_fields.inc: it is read here, gives their
order, and finds those that are missing or of a wrong shape."""

from __future__ import annotations

import hashlib
import json
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.errors import ModelError

MAGIC = b"GFMB"
FORMAT = 2
HEADER = struct.Struct("<4sI32sQI12x")
ENTRY = struct.Struct("<24sIIQQ")
ALIGNMENT = 64
HASHED_FROM = 40
MOST_SECTIONS = 1024
LONGEST_NAME = 23
REPEATED_FROM = 4096  # bytes: a section at least as long that is there already is stored once
F64, I32, TEXT, F32 = 1, 2, 3, 4
DTYPE: dict[int, np.dtype] = {F64: np.dtype("<f8"), I32: np.dtype("<i4"), TEXT: np.dtype("u1"), F32: np.dtype("<f4")}

OF_FMU = ("port_kinds", "start_reference", "start_value")  # in which two FMUs of one model may differ

Sections = Mapping[str, "np.ndarray | str"]


def write_blob(sections: Sections) -> bytes:
    """Bytes of a blob with `sections` in the order given.

    Values: arrays of floats (float32 stored as f32, others as f64, any shape, C order, all finite),
    arrays of integers or booleans (stored as i32), or text without NUL.
    What equal bodies have in common, the tables of equal planets, is stored once.
    Raises ModelError that lists every section that cannot be stored.
    """
    problems: list[str] = []
    if len(sections) > MOST_SECTIONS:
        problems.append(f"{len(sections)} sections, at most {MOST_SECTIONS} fit")
    encoded = [(name, *_encode(name, value, problems)) for name, value in sections.items()]
    if problems:
        raise ModelError("model blob cannot be written: " + "; ".join(problems))
    table, contents = bytearray(), bytearray()
    start = HEADER.size + len(encoded) * ENTRY.size
    stored: dict[tuple[int, int, bytes], tuple[int, int]] = {}  # what → number of its section, offset
    for i, (name, kind, values) in enumerate(encoded):
        what = (kind, values.size, hashlib.sha256(values.tobytes()).digest())
        if values.nbytes >= REPEATED_FROM and what in stored:
            first, offset = stored[what]
            table += ENTRY.pack(name.encode(), kind, 1 + first, values.size, offset)
            continue
        _pad(contents, start)
        stored[what] = (i, start + len(contents))
        table += ENTRY.pack(name.encode(), kind, 0, values.size, start + len(contents))
        contents += values.tobytes()
    _pad(contents, start)
    return seal(bytes(HEADER.pack(MAGIC, FORMAT, bytes(32), start + len(contents), len(encoded)) + table + contents))


def seal(blob: bytes) -> bytes:
    """`blob` with its SHA-256 computed anew."""
    return blob[:8] + hashlib.sha256(blob[HASHED_FROM:]).digest() + blob[HASHED_FROM:]


def blob_hash(blob: bytes) -> str:
    """The SHA-256 (64 hex digits) a blob carries: the model's identity."""
    return blob[8:HASHED_FROM].hex()


def with_guid(sections: Sections) -> dict[str, np.ndarray | str]:
    """The sections with the GUID that follows from "made_of", the kinds of the ports and the starts."""
    parts = [np.asarray(sections.get(name, ())).tolist() for name in OF_FMU]
    return {**sections, "guid": origin(sections["made_of"], *parts)} if "made_of" in sections else dict(sections)


def origin(*what: object) -> str:
    """SHA-256 (64 hex digits) of tables of text, integers and floats, which a model was made from: the same on every
    machine, where the model's own numbers differ by the rounding of its linear algebra."""
    return hashlib.sha256(json.dumps(what, allow_nan=False).encode()).hexdigest()


def read_blob(blob: bytes) -> dict[str, np.ndarray | str]:
    """Sections of a blob that `write_blob` made or the kernel has opened, which checks the bytes: one-dimensional
    read-only arrays (float64, float32, int32) and text, in stored order."""
    sections: dict[str, np.ndarray | str] = {}
    for i in range(HEADER.unpack_from(blob)[4]):
        name, kind, _, size, offset = ENTRY.unpack_from(blob, HEADER.size + i * ENTRY.size)
        values = np.frombuffer(blob, DTYPE[kind], size, offset)
        sections[name.rstrip(b"\0").decode()] = values.tobytes()[:-1].decode() if kind == TEXT else values
    return sections


def _encode(name: str, value: np.ndarray | str, problems: list[str]) -> tuple[int, np.ndarray]:
    """Type and stored values of a section; what is wrong with it is added to `problems`."""
    if not _name_is_good(name):
        problems.append(f"section name {name!r}: use 1 to {LONGEST_NAME} printable ASCII characters without space")
    if isinstance(value, str):
        return TEXT, _encode_text(name, value, problems)
    array = np.asarray(value)
    if array.dtype.kind == "f":
        if not np.all(np.isfinite(array)):
            wrong = np.count_nonzero(~np.isfinite(array))
            problems.append(f"section '{name}': {wrong} of {array.size} values are not finite")
        kind = F32 if array.dtype.itemsize == DTYPE[F32].itemsize else F64
        return kind, np.ascontiguousarray(array, DTYPE[kind])
    if array.dtype.kind in "iub":
        limits = np.iinfo(np.int32)
        if array.size and (array.min() < limits.min or array.max() > limits.max):
            problems.append(f"section '{name}': integers beyond 32 bits")
            return I32, np.zeros(0, DTYPE[I32])
        return I32, np.ascontiguousarray(array, DTYPE[I32])
    problems.append(f"section '{name}': {array.dtype} is neither float, integer nor text")
    return I32, np.zeros(0, DTYPE[I32])


def _encode_text(name: str, value: str, problems: list[str]) -> np.ndarray:
    try:
        data = value.encode()
    except UnicodeEncodeError:
        problems.append(f"section '{name}': text is not valid Unicode")
        data = b""
    if b"\0" in data:
        problems.append(f"section '{name}': text contains NUL")
    return np.frombuffer(data + b"\0", DTYPE[TEXT])


def _name_is_good(name: str) -> bool:
    return 0 < len(name) <= LONGEST_NAME and all(" " < c <= "~" for c in name)


def _pad(contents: bytearray, start: int) -> None:
    """Fill with zeros up to the next aligned position; `contents` begin at byte `start` of the blob."""
    contents += bytes(-(start + len(contents)) % ALIGNMENT)


TABLE = Path(__file__).parents[2] / "kernel" / "src" / "model" / "gk_fields.inc"
COUNTS = ("version", "slices", "rotors", "gears", "engagements", "ports", "supports", "functions", "rolls", "sets")
SIZES = ("rotor", "z", "modes", "reads", "both_flanks", "points", "low", "mirrored")
FLANK_SIZES = ("flank_teeth", "flank_places", "flank_rolls")
GEAR_NUMBERS = tuple(
    "r_b s_form s_tip psi_b phase face_width local strip_half_width relief relief_start tip_edge corner_radius "
    "corner_angle z_mid helix".split()
)
_LINE = re.compile(r'^GK_FIELD\((\w+), (\w+), (\w+), "([^"]*)", "[^"]*", "[^"]*"\)$', re.MULTILINE)
_KINDS = {"I32": "iub", "F64": "f", "F32": "f", "TEXT": "U"}


@dataclass(frozen=True)
class Field:
    """One array of the blob. scope: MODEL, GEAR, SET or GEAR_SET; kind: I32, F64, F32 or TEXT; dimensions: numbers and
    symbols."""

    scope: str
    name: str
    kind: str
    dimensions: tuple[str, ...]
    optional: bool


def gear_numbers(values: Mapping[str, float]) -> np.ndarray:
    """The section "gear" of GEAR_NUMBERS by name."""
    assert set(values) == set(GEAR_NUMBERS), set(values) ^ set(GEAR_NUMBERS)
    return np.array([float(values[name]) for name in GEAR_NUMBERS])


@cache
def fields() -> tuple[Field, ...]:
    """All arrays in the order of the table."""
    found = _LINE.findall(TABLE.read_text(encoding="utf-8"))
    return tuple(
        Field(scope, name, kind, tuple(sizes.lstrip("?").split()), sizes.startswith("?"))
        for scope, name, kind, sizes in found
    )


def order_sections(sections: Mapping[str, Any]) -> dict[str, Any]:
    """`sections` in the order of the table, floats in the precision in which they are stored. AssertionError that lists
    every section that is missing, unknown, or of another type or shape: the writer's mistake, not the user's."""
    ordered, problems, scopes = {}, [], _scopes(sections)
    for field in fields():
        for number, sizes in scopes[field.scope].items():
            name = field.name + number
            if name in sections:
                ordered[name] = np.asarray(sections[name], np.float32) if field.kind == "F32" else sections[name]
                problems += _problems(field, name, sections[name], sizes)
            elif not field.optional:
                problems.append(f"{name} is missing")
    problems += [f"{name} is unknown" for name in sections if name not in ordered]
    assert not problems, "; ".join(problems)
    return ordered


def _scopes(sections: Mapping[str, Any]) -> dict[str, dict[str, dict[str, int]]]:
    """Of every scope the numbers that its sections have in their names, with the sizes known there."""
    known = dict(zip(COUNTS, map(int, sections["counts"]), strict=True))
    found = {"carried": "carried", "whirls": "whirl", "starts": "start_reference", "sensors": "sensed"}
    known |= {word: len(sections.get(name, ())) for word, name in found.items()}
    gears = {
        f"{g}": known
        | _with_places(dict(zip(SIZES, map(int, sections[f"size{g}"]), strict=True)), known["functions"])
        | {"own": len(sections.get(f"own_number{g}", ()))}
        | dict(zip(FLANK_SIZES, map(int, sections.get(f"flank_size{g}", (0, 0, 0))), strict=True))
        for g in range(known["gears"])
    }
    sets = {f"{s}": known | {"ground": len(sections[f"omega_ground{s}"])} for s in range(known["sets"])}
    both = {
        f"{g}_{s}": of_gear | of_set | {"reads": len(sections[f"ground_list{g}_{s}"])}
        for g, of_gear in gears.items()
        for s, of_set in sets.items()
    }
    return {"MODEL": {"": known}, "GEAR": gears, "SET": sets, "GEAR_SET": both}


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
