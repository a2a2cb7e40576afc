"""The HDF5 file of a reduced body (docs/file-formats.md)."""

from __future__ import annotations

import json
import os
from dataclasses import fields
from typing import Any

import h5py
import numpy as np

from gearfmu.body.layout import FORMAT, FORMAT_VERSION, GROUPS, TEXTS, Entry, entries_of
from gearfmu.body.packing import read_entry, write_entry
from gearfmu.body.reduced import ReducedBody, Sensors, Tangent, value_of
from gearfmu.errors import BodyError
from gearfmu.hdf5 import Format, reading, writing
from gearfmu.reduction.cyclic.frf import FrfError
from gearfmu.reduction.cyclic.spin import Spin
from gearfmu.reduction.display import Display, Shapes, whole_surface

REMEDY = "make it again with 'gearfmu reduce STAGE'"
FORM = "v110"  # HDF5 1.10: a dataset in one piece needs no index, which takes 2 kB in older forms
FILE = Format(FORMAT, FORMAT_VERSION, "body", BodyError, REMEDY, FORM)


def save_body(body: ReducedBody, path: str | os.PathLike[str]) -> None:
    """Write a body under a temporary name, then rename it to `path`."""
    with writing(path, FILE) as file:
        file.attrs["algorithm_version"] = body.algorithm_version
        file.attrs["name"] = body.name
        file.attrs["input_hash"] = body.input_hash
        for text in TEXTS:
            file.attrs[text] = json.dumps(getattr(body, text), sort_keys=True)
        for entry in entries_of(body.groups):
            value = np.asarray(value_of(body, entry.field), dtype=entry.kind)
            if entry.field == "static_ff":
                value = value[:, :, : value.shape[2] // 2 + 1]
            write_entry(file, entry, value)


def load_body(path: str | os.PathLike[str]) -> ReducedBody:
    """Read and check a body file. Raises BodyError: missing, damaged, of another kind or version, or not sound."""
    with reading(path, FILE) as file:
        values = {entry.field: _read(file, entry) for entry in entries_of([name for name in GROUPS if name in file])}
        heads = {name: str(file.attrs[name]) for name in ("name", "input_hash")}
        texts = {name: json.loads(file.attrs[name]) for name in TEXTS}
        versions = {name: int(file.attrs[name]) for name in ("format_version", "algorithm_version")}
        return _body(values, {**heads, **texts, **versions})


def _read(file: h5py.File, entry: Entry) -> Any:
    if not isinstance(file.get(entry.path), h5py.Dataset):
        raise BodyError(f"dataset {entry.path} is missing")
    value = read_entry(file[entry.path], entry)
    if not entry.shape and np.ndim(value) == 0:
        return value.item()
    value = value[None] if np.ndim(value) < len(entry.shape) else value  # the one sensor of an older ring
    return np.ascontiguousarray(value)


def _all_offsets(half: np.ndarray, teeth: int) -> np.ndarray:
    """Compliance for every tooth offset from that of 0 … z/2, or for −K … K from 0 … K: C[f, g, m, i, j, a, b] =
    C[g, f, −m, j, i, b, a] (reciprocity)."""
    if half.ndim != 7 or not 0 < half.shape[2] <= teeth // 2 + 1:
        raise BodyError(f"static/c_ff has shape {half.shape}, expected offsets 0 … {teeth // 2} in its third place")
    single = half.shape[2] == teeth // 2 + 1 and teeth % 2 == 0  # the offset z/2 is its own mirror image
    mirrored = half[:, :, 1 : half.shape[2] - single].transpose(1, 0, 2, 4, 3, 6, 5)
    return np.concatenate([half, mirrored[:, :, ::-1]], axis=2)


def _whole_surface(values: dict[str, Any]) -> dict[str, np.ndarray]:
    """Surface of all sectors from that of sector 0."""
    sector = Shapes(**{f.name: values[f"shapes.{f.name}"] for f in fields(Shapes)})
    points, quads = whole_surface(sector, values["teeth"])
    return {"display.points": points.astype("f4"), "display.quads": quads}


def _body(values: dict[str, Any], heads: dict[str, Any]) -> ReducedBody:
    values["static_ff"] = _all_offsets(values["static_ff"], values["teeth"])
    if "shapes.points" in values:
        values |= _whole_surface(values)
    parts: dict[str, Any] = {}
    for group, kind in (
        ("frf", FrfError),
        ("display", Display),
        ("sensors", Sensors),
        ("tangent", Tangent),
        ("shapes", Shapes),
        ("spin", Spin),
    ):
        if any(name.startswith(f"{group}.") for name in values):
            parts[group] = kind(**{f.name: values.pop(f"{group}.{f.name}") for f in fields(kind)})
    return ReducedBody(**values, **parts, **heads)
