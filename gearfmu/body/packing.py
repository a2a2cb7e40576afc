"""How the datasets of a body lie in its file: the numbers of `layout.Entry` packed and unpacked.

A model holds singles, and a picture shows a hundredth of a displacement: the lower bits of the finite elements' doubles
are noise, which nothing compresses. So numbers are rounded to whole multiples of a power of two, and packing what was
unpacked gives the same bytes. Along the roll points, Chebyshev points of the first kind, rows and tables are smooth:
their cosine transform, the coefficients of their Chebyshev polynomials, falls off, and what lies below a step costs
nothing.
"""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
from scipy.fft import dctn, idctn

from gearfmu.body.layout import Entry
from gearfmu.errors import BodyError

SMALL = 16  # numbers: not worth compressing
FILTERS = {"compression": "gzip", "compression_opts": 9, "shuffle": True, "fletcher32": True}
STEP = "step"  # attribute of a dataset in steps


def write_entry(file: h5py.File, entry: Entry, value: np.ndarray) -> None:
    """Write the dataset of an entry, in one piece, with its unit and meaning."""
    if entry.bits:
        value, step = packed(value, entry)
    filters = FILTERS | {"chunks": value.shape} if value.size > SMALL else {}
    dataset = file.create_dataset(entry.path, data=value, **filters)
    dataset.attrs["unit"], dataset.attrs["meaning"] = entry.unit, entry.meaning
    if entry.bits:
        dataset.attrs[STEP] = step


def read_entry(file: h5py.File, entry: Entry, path: str | None = None) -> Any:
    """The numbers of an entry from its dataset, or from the one at `path`. Raises BodyError where it is missing."""
    dataset = file.get(path or entry.path)
    if not isinstance(dataset, h5py.Dataset):
        raise BodyError(f"dataset {path or entry.path} is missing")
    value = unpacked(dataset[()], dataset.attrs[STEP], entry) if entry.bits else dataset[()]
    return value.item() if not entry.shape and np.ndim(value) == 0 else np.ascontiguousarray(value)


def packed(value: np.ndarray, entry: Entry) -> tuple[np.ndarray, Any]:
    """Integers of the shape of `value` in the smallest type that holds them, and the step or steps (float32)."""
    step = _steps(value, entry)
    along = _roll_axes(entry)
    numbers = dctn(value, axes=along, norm="ortho") if along else value
    whole = np.rint(numbers / _spread(step, value.ndim))
    most = int(np.abs(whole).max(initial=0))
    kind = next(kind for kind in ("i1", "i2", "i4", "i8") if most <= np.iinfo(kind).max)
    return whole.astype(kind), step


def unpacked(whole: np.ndarray, step: Any, entry: Entry) -> np.ndarray:
    """What `packed` took, rounded."""
    numbers = whole * _spread(np.asarray(step, float), whole.ndim)
    along = _roll_axes(entry)
    return (idctn(numbers, axes=along, norm="ortho") if along else numbers).astype(entry.kind)


def _roll_axes(entry: Entry) -> list[int]:
    return [axis for axis, size in enumerate(entry.shape) if size == "R"]


def _steps(value: np.ndarray, entry: Entry) -> np.ndarray:
    """The smallest power of two of which the largest number has fewer than 2^bits: (), or one a first index."""
    others = tuple(range(1, value.ndim)) if entry.each else None
    most = np.abs(value).max(axis=others, initial=0.0).astype(float)
    share = np.where(most > 0, most, 1.0) / (2**entry.bits - 0.5)
    return (2.0 ** np.ceil(np.log2(share))).astype("f4")


def _spread(step: np.ndarray, dimensions: int) -> np.ndarray:
    """A step a first index, beside the numbers of all."""
    return step.reshape(-1, *(dimensions - 1) * [1]) if step.ndim else step
