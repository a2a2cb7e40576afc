"""The layout of a body and its file: one table from which it is written, packed, read, checked and documented.

A model holds singles, and a picture shows a hundredth of a displacement: the lower bits of the finite elements' doubles
are noise, which nothing compresses. So numbers are rounded to whole multiples of a power of two, and packing numbers
that were unpacked gives the same bytes. Rows and tables are smooth along the roll points, Chebyshev points of the first
kind. Their cosine transform, the coefficients of Chebyshev polynomials, falls off: numbers below a step cost nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from scipy.fft import dctn, idctn

from gearfmu.errors import BodyError

if TYPE_CHECKING:
    from gearfmu.body.body import Body, Flank

FORMAT = "gearfmu-body"
FORMAT_VERSION = 4
_KINDS = {"f8": "floating-point", "f4": "floating-point", "i8": "integer"}


@dataclass(frozen=True)
class Entry:
    """One array of a body and dataset of its file: attribute path in `body.Body`, shape in symbols or numbers, unit,
    meaning, and how it is stored (`gearfmu/body/store.py`).

    kind: in memory, "f8" doubles, "f4" singles (pictures), "i8" integers. bits: 0, the file holds the numbers
    themselves; else whole multiples of a step, which the largest number has fewer than 2^bits of, and along the roll
    points (R) those of its cosine transform. each: a step for every index of the first axis instead of one for all.
    """

    field: str
    shape: tuple[str | int, ...]
    unit: str
    meaning: str
    kind: str = "f8"
    bits: int = 0
    each: bool = False

    @property
    def path(self) -> str:
        """Name of the dataset."""
        return self.field.replace(".", "/")


TABLE_BITS = 23  # of compliances; what this costs a model: docs/decisions/bodies.md
ROW_BITS = 21  # of rows in modes and of the coupling of modes
PICTURE_BITS = 7
TABLE, COUPLED = (2, 2, "R", "R", "A", "A"), "kg-1/2, m-1.kg-1/2"

BODY = (
    Entry("mass", (6, 6), "kg, kg.m, kg.m2", "mass matrix of rigid motion about the origin"),
    Entry("points", ("K", 3), "m", "where each node lies"),
    Entry("frequency", ("n",), "Hz", "natural frequencies of the free body, ascending, none rigid"),
    Entry("damping_ratio", ("n",), "", "modal damping ratio"),
    Entry("rows", ("m", "n"), COUPLED, "displacement and rotation of the nodes in the modes"),
    Entry("static", ("m", "m"), "m/N, 1/N, 1/(N.m)", "compliance of the nodes; inertia relief, mean-axis gauge"),
)
ERROR = (
    Entry("error.frequency", ("F",), "Hz", "frequency lines"),
    Entry("error.error", ("F",), "", "relative Frobenius error with the ground held (paper eq. 3)"),
    Entry("error.band", (2,), "Hz", "band of max_error"),
    Entry("error.max_error", (), "", "largest error (ground held) in the band"),
    Entry("error.trusted_to", (), "Hz", "the error stays below 1 % up to this frequency"),
    Entry("error.length", (), "m", "length by which rotations are multiplied"),
)
CUT = (
    Entry("error.error_free", ("F",), "", "error of the free body's elastic part, with bore ports"),
    Entry("error.cut", (), "Hz", "modes below this were dynamic in the comparison, the others static"),
    Entry("error.size", (), "", "number of modes below the cut", "i8"),
)
FLANK = (
    Entry("flank.teeth", (), "", "number of teeth z, equal sectors of the body", "i8"),
    Entry("flank.internal", (), "", "1: a ring, whose index counts tooth spaces", "i8"),
    Entry("flank.r_b", (), "m", "base radius"),
    Entry("flank.psi_b", (), "rad", "half tooth-thickness angle at the base circle, nominal"),
    Entry("flank.beta_b", (), "rad", "base helix angle, positive for a right-handed gear: z turns by z tan β_b / r_b"),
    Entry("flank.face_width", (), "m", "face width b; z runs from −b/2 to b/2"),
    Entry("flank.strip_half_width", (), "m", "half-width of the load strip in arc length along the flank"),
    Entry("flank.roll_range", (2,), "m", "roll of form and tip point: the Chebyshev interval"),
    Entry("flank.roll", ("R",), "m", "roll points: Chebyshev points of the first kind, ascending"),
    Entry("flank.diameter", ("n",), "", "nodal diameter ν of the modes", "i8"),
    Entry("flank.part", ("n",), "", "0 single, 1 first (real) and 2 second (imaginary) part of a pair", "i8"),
    Entry("flank.parity", ("n",), "", "+1 symmetric about mid-width, −1 antisymmetric, 0 neither", "i8"),
    Entry(
        "flank.rows",
        (2, "R", "A", "n"),
        "kg-1/2",
        "tooth 0: load-weighted mean displacement along the outward normal; "
        "flank (0: sg = +1), roll point, width function, mode",
        bits=ROW_BITS,
    ),
    Entry(
        "flank.static",
        (2, 2, "M", "R", "R", "A", "A"),
        "m/N",
        "compliance [f, g, m, i, j, a, b]: tooth 0, flank f, roll i, function a under the load of tooth m, flank g, "
        "roll j, function b. The file holds the offsets m = 0 … 3, or 0 … z/2 of a small gear, the others follow: "
        "C[f, g, m, i, j, a, b] = C[g, f, −m, j, i, b, a]",
        bits=TABLE_BITS,
    ),
    Entry(
        "flank.node",
        (2, "R", "A", 6),
        "m/N, 1/N",
        "flank rows of tooth 0 per unit force x, y, z and moment x, y, z on the node",
    ),
)
TANGENT = (
    Entry(
        "flank.tangent.rows",
        (2, "R", "A", "n"),
        "kg-1/2",
        "tooth 0: like flank/rows, displacement along the profile towards growing roll",
        bits=ROW_BITS,
    ),
    Entry(
        "flank.tangent.static_nt",
        TABLE,
        "m/N",
        "compliance [f, g, i, j, a, b] of tooth 0 alone: flank f, roll i, function a along the outward normal under "
        "the load along the profile at flank g, roll j, function b",
        bits=TABLE_BITS,
    ),
    Entry("flank.tangent.static_tt", TABLE, "m/N", "the same, displacement along the profile", bits=TABLE_BITS),
)
SPIN = (
    Entry("spin.coupling", ("n", "n"), "", "integral of density times mode k . (e_z x mode l), skew", bits=ROW_BITS),
    Entry("spin.tilt", (2, "n"), "kg1/2.m", "the same with rigid tilt about x and y: of z u_x and z u_y"),
    Entry("spin.load", ("n",), "kg1/2.m", "centrifugal load per square of the speed"),
    Entry("spin.stiffening", ("n",), "", "B in ω² = ω₀² + B Ω²: stresses less softening"),
    Entry("spin.growth", (2, "R", "A"), "m.s2", "flank rows of tooth 0 under centrifugal load per square of the speed"),
    Entry("spin.inertia", (), "kg.m2.s2", "what that adds to the polar inertia per square of the speed"),
)
PICTURE = (
    Entry(
        "picture.loads",
        ("L", "P", 3),
        "m/N",
        "displacement of the surface of the whole gear, unit load on flank 0, tooth 0",
        "f4",
        bits=PICTURE_BITS,
        each=True,
    ),
    Entry("picture.load_roll", ("L",), "m", "roll point of these loads"),
)
SHAPES = (
    Entry("picture.shapes.points", ("T", 3), "m", "surface points of sector 0", "f4"),
    Entry("picture.shapes.quads", ("U", 4), "", "quadrilaterals of its surface, point numbers", "i8"),
    Entry("picture.shapes.ahead", ("U", 4), "", "1: the point of that number in the next sector", "i8"),
    Entry(
        "picture.shapes.modes",
        ("n", "T", 3),
        "kg-1/2",
        "displacement on sector 0 in every mode",
        "f4",
        bits=PICTURE_BITS,
        each=True,
    ),
)
SURFACE = (
    Entry("picture.points", ("P", 3), "m", "surface points of the whole gear", "f4"),
    Entry("picture.quads", ("Q", 4), "", "quadrilaterals of the surface, point numbers", "i8"),
)
SENSORS = (
    Entry("sensors.points", ("S", 3), "m", "where each sensor lies; of a ring: middle of the rim's patch of sector 0"),
    Entry("sensors.rows", ("3S", "n"), "kg-1/2", "displacement x, y, z of each in the modes"),
)
FELT = (Entry("sensors.static", ("3S", "m"), "m/N, 1/N", "displacement of each sensor per unit load on the nodes"),)
SKIN = (
    Entry("skin.points", ("V", 3), "m", "points of the closed outer surface", "f4"),
    Entry("skin.faces", ("W", 4), "", "its faces, normals outward; a triangle repeats its last point", "i8"),
    Entry(
        "skin.modes",
        ("6+n", "V", 3),
        "1, m, kg-1/2",
        "displacement of the points: rigid motion x, y, z, rx, ry, rz about the origin, then the modes",
        "f4",
        bits=PICTURE_BITS,
        each=True,
    ),
)
# optional, each whole or not at all
GROUPS = (ERROR, CUT, FLANK, TANGENT, SPIN, PICTURE, SHAPES, SURFACE, SENSORS, FELT, SKIN)
ENTRIES = (*BODY, *(entry for group in GROUPS for entry in group))


def value_of(body: Any, field: str) -> Any:
    """Attribute by path, None where a part of it is not there: "flank.rows"."""
    for part in field.split("."):
        body = None if body is None else getattr(body, part)
    return body


def entries_of(body: Any) -> tuple[Entry, ...]:
    """The arrays that a body has; the surface of a gear that is stored by a sector is not among them."""
    found = [group for group in GROUPS if value_of(body, group[0].field) is not None]
    if SHAPES in found:
        found.remove(SURFACE)
    return (*BODY, *(entry for group in found for entry in group))


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


TEXTS = {
    "nodes": "name, kind (rigid: RBE2, averaging: RBE3, nodes, section), components, span along z, in row order",
    "sensors": "names of the sensors",
    "ground": "nodes held when the error was measured",
    "method": "method of reduction",
    "material": "material: youngs_modulus (Pa), poisson_ratio, density (kg/m³)",
    "mesh": "finite-element mesh: element counts, degrees of freedom, quality",
    "provenance": "program versions, time and memory of the reduction",
}


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
