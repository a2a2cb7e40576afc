"""The HDF5 file of a body (docs/file-formats.md)."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any

import h5py
import numpy as np

from gearfmu.body.body import PARTS, Body, How, Node, Shapes, whole_surface
from gearfmu.body.former import FORMATS, former_values
from gearfmu.body.layout import (
    FORMAT,
    FORMAT_VERSION,
    POINTS,
    SURFACE,
    entries_of,
    read_entry,
    value_of,
    write_entry,
)
from gearfmu.errors import BodyError
from gearfmu.files import Entry, Format, entries, reading, writing

REMEDY = "make it again with 'gearfmu reduce STAGE'"
FORM = "v110"  # HDF5 1.10: a dataset in one piece needs no index, which takes 2 kB in older forms
HOW = ("method", "material", "mesh", "provenance")
TEXTS = ("nodes", "sensors", "ground", *HOW)
FILE = Format(FORMAT, FORMAT_VERSION, "body", BodyError, REMEDY, FORM, FORMATS)


def save_body(body: Body, path: str | os.PathLike[str]) -> None:
    """Write a body under a temporary name, then rename it to `path`. A beam is made anew and has no file."""
    assert body.exact is None, "a beam has no file"
    with writing(path, FILE) as file:
        file.attrs["name"], file.attrs["input_hash"] = body.name, body.how.hash
        file.attrs["algorithm_version"] = body.how.algorithm
        for name, text in _texts(body).items():
            file.attrs[name] = json.dumps(text, sort_keys=True)
        for entry in entries_of(body):
            value = np.asarray(value_of(body, entry.field), dtype=entry.kind)
            if entry.field == "flank.static":
                value = value[:, :, : value.shape[2] // 2 + 1]
            write_entry(file, entry, value)


def load_body(path: str | os.PathLike[str]) -> Body:
    """Read and check a body file of this version or a former one. Raises BodyError: missing, damaged, of another kind
    or version, or not sound."""
    with reading(path, FILE) as file:
        if int(file.attrs["format_version"]) == FORMAT_VERSION:
            values = {entry.field: read_entry(file, entry) for entry in _entries_in(file)}
            texts = {
                name: json.loads(file.attrs[name])
                for name in ("nodes", "sensors", "ground", *HOW)
                if name in file.attrs
            }
        else:
            values, texts = former_values(file)
        how = {name: texts.pop(name) for name in HOW}
        version = int(file.attrs.get("algorithm_version", 1))  # the first carriers do not say it
        made = How(str(file.attrs["input_hash"]), **how, algorithm=version)
        return _body(str(file.attrs["name"]), made, values, texts)


def _entries_in(file: h5py.File) -> Iterator[Entry]:
    """The datasets of a file, and those that are missing in a part of which it has some."""
    yield from (POINTS, *entries(Body))
    for path, kind in PARTS.items():
        own = [e for e in entries(kind, f"{path}.") if e.field not in SURFACE or "picture/shapes" not in file]
        if any(entry.path in file for entry in own):
            yield from (entry for entry in own if entry.path in file or not entry.optional)


def _texts(body: Body) -> dict[str, Any]:
    nodes = [
        {"name": n.name, "kind": n.kind, "components": list(n.components)} | ({"span": list(n.span)} if n.span else {})
        for n in body.nodes
    ]
    names = {"sensors": list(body.sensors.names)} if body.sensors is not None else {}
    how = {name: getattr(body.how, name) for name in HOW}
    return {"nodes": nodes, "ground": list(body.error.ground) if body.error is not None else []} | how | names


def _body(name: str, how: How, values: dict[str, Any], texts: Mapping[str, Any]) -> Body:
    """The body of numbers by their fields; texts: nodes, sensors, ground."""
    points = values.pop("points")
    nodes = []
    for text, point in zip(texts["nodes"], points, strict=True):
        span = tuple(text["span"]) if "span" in text else None
        nodes.append(Node(text["name"], text["kind"], tuple(text["components"]), point, span))
    if "flank.static" in values:
        values["flank.static"] = _all_offsets(values["flank.static"], values["flank.teeth"])
        values["flank.internal"] = bool(values["flank.internal"])
    if "picture.shapes.points" in values:
        shapes = Shapes(*(values[f"picture.shapes.{name}"] for name in ("points", "quads", "ahead", "modes")))
        surface, quads = whole_surface(shapes, values["flank.teeth"])
        values |= {"picture.points": surface.astype("f4"), "picture.quads": quads}
    extra = {"sensors.names": tuple(texts.get("sensors", ())), "error.ground": tuple(texts.get("ground", ()))}
    values |= {field: text for field, text in extra.items() if any(f.startswith(field.split(".")[0]) for f in values)}
    for part, kind in PARTS.items():
        own = [field for field in values if field.rpartition(".")[0] == part]
        if own:
            values[part] = kind(**{field.rpartition(".")[2]: values.pop(field) for field in own})
    return Body(name=name, how=how, nodes=tuple(nodes), **values)


def _all_offsets(half: np.ndarray, teeth: int) -> np.ndarray:
    """Compliance for every tooth offset from that of 0 … z/2, or for −K … K from 0 … K: C[f, g, m, i, j, a, b] =
    C[g, f, −m, j, i, b, a] (reciprocity)."""
    if half.ndim != 7 or not 0 < half.shape[2] <= teeth // 2 + 1:
        raise BodyError(f"flank/static has shape {half.shape}, expected offsets 0 … {teeth // 2} in its third place")
    single = half.shape[2] == teeth // 2 + 1 and teeth % 2 == 0  # the offset z/2 is its own mirror image
    mirrored = half[:, :, 1 : half.shape[2] - single].transpose(1, 0, 2, 4, 3, 6, 5)
    return np.concatenate([half, mirrored[:, :, ::-1]], axis=2)
