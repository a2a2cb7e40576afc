"""The HDF5 file of a reduced body (docs/file-formats.md)."""

from __future__ import annotations

import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gearfmu.body.layout import ENTRIES, FORMAT, FORMAT_VERSION, TEXTS, Entry
from gearfmu.body.reduced import ReducedBody, value_of
from gearfmu.errors import BodyError
from gearfmu.files import written_whole
from gearfmu.reduction.display import Display
from gearfmu.reduction.frf import FrfError

_REMEDY = "make it again with 'gearfmu reduce STAGE'"
_PACKED = {"compression": "gzip", "compression_opts": 6, "shuffle": True, "fletcher32": True}


def save_body(body: ReducedBody, path: str | os.PathLike[str]) -> None:
    """Write a body under a temporary name, then rename it to `path`."""
    with written_whole(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = body.format_version
        file.attrs["algorithm_version"] = body.algorithm_version
        file.attrs["name"] = body.name
        file.attrs["input_hash"] = body.input_hash
        for text in TEXTS:
            file.attrs[text] = json.dumps(getattr(body, text), sort_keys=True)
        for entry in ENTRIES:
            value = np.asarray(value_of(body, entry.field), dtype=entry.kind)
            if entry.field == "static_ff":
                value = value[:, :, : body.teeth // 2 + 1]
            dataset = file.create_dataset(entry.path, data=value, **(_PACKED if value.size > 16 else {}))
            dataset.attrs["unit"] = entry.unit
            dataset.attrs["meaning"] = entry.meaning


def load_body(path: str | os.PathLike[str]) -> ReducedBody:
    """Read and check a body file. Raises BodyError: missing, damaged, of another kind or version, or not sound."""
    source = Path(path)
    if not source.is_file():
        raise BodyError(f"{source}: no such body file; {_REMEDY}")
    try:
        with h5py.File(source, "r") as file:
            _check_version(file)
            values = {entry.field: _read(file, entry) for entry in ENTRIES}
            heads = {name: str(file.attrs[name]) for name in ("name", "input_hash")}
            texts = {name: json.loads(file.attrs[name]) for name in TEXTS}
            versions = {name: int(file.attrs[name]) for name in ("format_version", "algorithm_version")}
        return _body(values, {**heads, **texts, **versions})
    except BodyError as error:
        raise BodyError(f"{source}: {error}; {_REMEDY}") from None
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError) as error:
        raise BodyError(f"{source}: damaged or no body file ({error}); {_REMEDY}") from error


def _check_version(file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT:
        raise BodyError("this HDF5 file is not a gearfmu body; 'gearfmu inspect' says what it is")
    version = int(file.attrs["format_version"])
    if version != FORMAT_VERSION:
        raise BodyError(f"body format {version}, this gearfmu reads {FORMAT_VERSION}")


def _read(file: h5py.File, entry: Entry) -> Any:
    if not isinstance(file.get(entry.path), h5py.Dataset):
        raise BodyError(f"dataset {entry.path} is missing")
    value = file[entry.path][()]
    if not entry.shape and np.ndim(value) == 0:
        return value.item()
    return np.ascontiguousarray(value)


def _all_offsets(half: np.ndarray, teeth: int) -> np.ndarray:
    """Compliance for every tooth offset from that of 0 … z/2: C[f, g, m, i, j, a, b] = C[g, f, −m, j, i, b, a]
    (reciprocity)."""
    if half.ndim != 7 or half.shape[2] != teeth // 2 + 1:
        raise BodyError(f"static/c_ff has shape {half.shape}, expected offsets 0 … {teeth // 2} in its third place")
    mirrored = half[:, :, 1 : (teeth + 1) // 2].transpose(1, 0, 2, 4, 3, 6, 5)
    return np.concatenate([half, mirrored[:, :, ::-1]], axis=2)


def _body(values: dict[str, Any], heads: dict[str, Any]) -> ReducedBody:
    values["static_ff"] = _all_offsets(values["static_ff"], values["teeth"])
    parts: dict[str, Any] = {}
    for group, kind in (("frf", FrfError), ("display", Display)):
        parts[group] = kind(**{f.name: values.pop(f"{group}.{f.name}") for f in fields(kind)})
    return ReducedBody(**values, **parts, **heads)
