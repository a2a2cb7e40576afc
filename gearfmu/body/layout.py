"""The layout of a body's file: from the stored fields of its classes it is written, packed, read and checked.

A model holds singles, and a picture shows a hundredth of a displacement: the lower bits of the finite elements' doubles
are noise, which nothing compresses. So numbers are rounded to whole multiples of a power of two, and packing numbers
that were unpacked gives the same bytes. Rows and tables are smooth along the roll points, Chebyshev points of the first
kind. Their cosine transform, the coefficients of Chebyshev polynomials, falls off: numbers below a step cost nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from scipy.fft import dctn, idctn

from gearfmu.errors import BodyError
from gearfmu.files import ENTRY, Entry

if TYPE_CHECKING:
    from gearfmu.body.body import Body, Flank

FORMAT = "gearfmu-body"
FORMAT_VERSION = 4
_KINDS = {"f8": "floating-point", "f4": "floating-point", "i8": "integer"}


POINTS = Entry(("K", 3), "m", "where each node lies", field="points")
SURFACE = ("picture.points", "picture.quads")  # not stored beside the shapes of a sector


def value_of(body: Any, field: str) -> Any:
    """Attribute by path, None where a part of it is not there: "flank.rows"."""
    for part in field.split("."):
        body = None if body is None else getattr(body, part)
    return body


def entries_of(body: Body) -> tuple[Entry, ...]:
    """The arrays that a body has; the surface of a gear that is stored by a sector is not among them."""
    left_out = () if value_of(body, "picture.shapes") is None else SURFACE
    return (POINTS, *(entry for entry in _there(body) if entry.field not in left_out))


def _there(part: Any, path: str = "") -> Iterator[Entry]:
    """The stored fields that are not None of a part of a body, which stands at `path`, and of the parts of that."""
    for own in fields(part):
        value = getattr(part, own.name)
        if value is not None and ENTRY in own.metadata:
            yield replace(own.metadata[ENTRY], field=f"{path}{own.name}")
        elif is_dataclass(value):
            yield from _there(value, f"{path}{own.name}.")


def body_problems(body: Body) -> list[str]:
    """Everything that is wrong with shapes, numbers and order of a body; empty when it is sound."""
    sizes = {"K": len(body.nodes), "m": sum(len(node.components) for node in body.nodes), "6+n": 6 + body.modes}
    if body.flank is not None:
        sizes["z"] = body.flank.teeth
    problems: list[str] = []
    for entry in entries_of(body):
        problems += _array_problems(entry, np.asarray(value_of(body, entry.field)), sizes)
    if problems:
        return problems
    checks = _body_checks(body) | (_flank_checks(body.flank) if body.flank is not None else {})
    return [text for text, holds in checks.items() if not holds]


def _array_problems(entry: Entry, value: np.ndarray, sizes: dict[str, int]) -> list[str]:
    value = value.astype("i8") if value.dtype == bool else value
    if value.dtype.kind != entry.kind[0]:
        return [f"{entry.path} holds {value.dtype}, expected {_KINDS[entry.kind]} numbers"]
    if value.ndim != len(entry.shape):
        return [f"{entry.path} has shape {value.shape}, expected {len(entry.shape)} dimensions"]
    for length, wanted in zip(value.shape, entry.shape, strict=True):
        expected = wanted if isinstance(wanted, int) else sizes.setdefault(wanted, length)
        if length != expected:
            return [
                f"{entry.path} has shape {value.shape}, which does not fit {entry.shape} with {wanted} = {expected}"
            ]
    if not np.all(np.isfinite(value)):
        return [f"{entry.path} holds a number that is not finite"]
    return []


def _body_checks(body: Body) -> dict[str, bool]:
    picture, shapes = body.picture, body.picture.shapes if body.picture is not None else None
    return {
        "hash is not 64 hex digits": len(body.how.hash) == 64 and set(body.how.hash) <= set("0123456789abcdef"),
        "mass must be above 0": body.total_mass > 0,
        "frequency must be above 0 and ascending": body.modes == 0
        or (body.frequency[0] > 0 and bool(np.all(np.diff(body.frequency) >= 0))),
        "damping_ratio must lie between 0 and 1": bool(np.all((body.damping_ratio >= 0) & (body.damping_ratio < 1))),
        "sensors/names does not fit the points": body.sensors is None
        or len(body.sensors.names) == len(body.sensors.points) == len(body.sensors.rows) / 3,
        "skin/faces names a point that is not there": body.skin is None or _inside(body.skin.faces, body.skin.points),
        "picture/shapes/quads names a point that is not there": shapes is None or _inside(shapes.quads, shapes.points),
        "picture/loads does not fit the surface": picture is None or picture.loads.shape[1] == len(picture.points),
        "picture/quads names a point that is not there": picture is None or _inside(picture.quads, picture.points),
    }


def _inside(quads: np.ndarray, points: np.ndarray) -> bool:
    return bool(np.all((quads >= 0) & (quads < len(points))))


def _flank_checks(flank: Flank) -> dict[str, bool]:
    offsets = flank.static.shape[2]
    return {
        "flank/teeth must be 3 or more": flank.teeth >= 3,
        "flank/r_b, face_width and strip_half_width must be above 0": min(
            flank.r_b, flank.face_width, flank.strip_half_width
        )
        > 0,
        "flank/static must hold the tooth offsets −K … K, K at least 3, or all": offsets == flank.teeth
        or (7 <= offsets < flank.teeth and offsets % 2 == 1),
        "flank/beta_b must lie between −π/4 and π/4": abs(flank.beta_b) < np.pi / 4,
        "there must be a mode, a roll point and a width function": min(flank.rows.shape) > 0,
        "flank/part: the two modes of a pair must follow each other": _pairs_sound(flank),
        "flank/diameter must lie between 0 and z/2": bool(
            np.all((flank.diameter >= 0) & (2 * flank.diameter <= flank.teeth))
        ),
        "flank/parity must be −1, 0 or +1": bool(np.all(np.abs(flank.parity) <= 1)),
        "flank/roll must ascend inside flank/roll_range": bool(
            np.all(np.diff(np.concatenate([flank.roll_range[:1], flank.roll, flank.roll_range[1:]])) > 0)
        ),
    }


def _pairs_sound(flank: Flank) -> bool:
    first, second = flank.part == 1, flank.part == 2
    follows = np.concatenate([[False], first[:-1]])
    same = np.concatenate([[True], np.diff(flank.diameter) == 0])
    return bool(np.all((flank.part >= 0) & (flank.part <= 2))) and bool(
        np.all(second == follows) and np.all(same[second])
    )


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
