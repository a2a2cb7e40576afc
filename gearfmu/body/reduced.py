"""ReducedBody: a gear as the kernel sees it. Conventions: docs/architecture.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearfmu.body.layout import ALGORITHM_VERSION, FORMAT_VERSION, Entry, entries_of
from gearfmu.errors import BodyError
from gearfmu.reduction.cyclic.frf import FrfError
from gearfmu.reduction.cyclic.spin import Spin
from gearfmu.reduction.display import Display, Shapes

_KINDS = {"f8": "floating-point", "f4": "floating-point", "i8": "integer"}


@dataclass(frozen=True)
class Sensors:
    """Points of a body that are read and never loaded.

    rows (3S, n), kg^-½: displacement x, y, z of each point in the modes; points (S, 3), m. A ring has one: the mean of
    the patch of its rim that belongs to sector 0, in that sector's frame.
    """

    rows: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Tangent:
    """Displacement along the profile, towards growing roll: what friction loads and reads.

    rows (2, R, A, n), kg^-½, like flank_rows. static_nt, static_tt (2, 2, R, R, A, A), m/N: along the normal and along
    the profile at (tooth 0, flank f, roll i, function a) per load along the profile at (tooth 0, g, j, b).
    """

    rows: np.ndarray
    static_nt: np.ndarray
    static_tt: np.ndarray


@dataclass(frozen=True)
class ReducedBody:
    """A free gear body, reduced: rigid body + n real elastic modes + static compliance, with its evidence.

    Shapes, units and meaning of every field stand in `layout.ENTRIES` and docs/file-formats.md. In short: frequency
    (n,) Hz; flank_rows (2, R, A, n); bore_rows (6, n); static_ff (2, 2, M, R, R, A, A), m/N; static_fb (2, R, A, 6);
    static_bb (6, 6). M is z, or 2K + 1 where only the tooth offsets −K … K are kept: offset m stands at m mod M.
    input_hash: SHA-256 of the inputs and of the version of the algorithms, 64 hex digits. sensors: of a ring, whose
    rim takes the place of the bore in bore_rows, static_fb and static_bb; None of an external one. tangent: rows along
    the profile, None of an imported gear with all its teeth. shapes: surface of a sector and how it moves in every
    mode, None where none was made. spin: what the modes feel when the body turns, None of an imported one.
    base_helix_angle: rad, positive for a right-handed gear, 0 for a spur one.
    Raises BodyError naming every field that cannot be.
    """

    name: str
    input_hash: str
    material: dict[str, Any]
    mesh: dict[str, Any]
    provenance: dict[str, Any]
    teeth: int
    r_b: float
    psi_b: float
    face_width: float
    mass: float
    inertia: np.ndarray
    frequency: np.ndarray
    damping_ratio: np.ndarray
    nodal_diameter: np.ndarray
    part: np.ndarray
    parity: np.ndarray
    flank_rows: np.ndarray
    bore_rows: np.ndarray
    roll_range: np.ndarray
    roll: np.ndarray
    strip_half_width: float
    static_ff: np.ndarray
    static_fb: np.ndarray
    static_bb: np.ndarray
    frf: FrfError
    display: Display
    sensors: Sensors | None = None
    tangent: Tangent | None = None
    shapes: Shapes | None = None
    spin: Spin | None = None
    base_helix_angle: float = 0.0
    format_version: int = FORMAT_VERSION
    algorithm_version: int = ALGORITHM_VERSION

    def __post_init__(self) -> None:
        if problems := body_problems(self):
            raise BodyError(f"body '{self.name}' is not valid: " + "; ".join(problems))

    @property
    def modes(self) -> int:
        """Number n of elastic modes."""
        return len(self.frequency)

    @property
    def internal(self) -> bool:
        """Whether the body is a ring: its index k counts tooth spaces, its normals point into them."""
        return self.sensors is not None

    @property
    def groups(self) -> tuple[str, ...]:
        """Which of the optional `layout.GROUPS` the body has."""
        has = {
            "rim": self.internal,
            "helix": self.base_helix_angle != 0,
            "tangent": self.knows_profile,
            "shapes": self.shapes is not None,
            "surface": self.shapes is None,
            "spin": self.spin is not None,
        }
        return tuple(name for name, there in has.items() if there)

    @property
    def knows_profile(self) -> bool:
        """Whether flanks can be loaded and read along the profile, as friction does."""
        return self.tangent is not None

    @property
    def all_offsets(self) -> bool:
        """Whether `static_ff` holds all tooth offsets."""
        return self.static_ff.shape[2] == self.teeth

    @property
    def width_functions(self) -> int:
        """Number A of Legendre functions across the face width."""
        return self.flank_rows.shape[2]


def value_of(body: ReducedBody, field: str) -> Any:
    """Attribute by path: "frf.error"."""
    value: Any = body
    for part in field.split("."):
        value = getattr(value, part)
    return value


def body_problems(body: ReducedBody) -> list[str]:
    """Everything that is wrong with shapes, numbers and order of a body; empty when it is sound."""
    problems: list[str] = []
    sizes: dict[str, int] = {"z": body.teeth}
    for entry in entries_of(body.groups):
        problems += _array_problems(entry, np.asarray(value_of(body, entry.field)), sizes)
    return problems or _meaning_problems(body)


def _array_problems(entry: Entry, value: np.ndarray, sizes: dict[str, int]) -> list[str]:
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


def _meaning_problems(body: ReducedBody) -> list[str]:
    checks = {
        "input_hash is not 64 hex digits": len(body.input_hash) == 64
        and set(body.input_hash) <= set("0123456789abcdef"),
        "body/teeth must be 3 or more": body.teeth >= 3,
        "body/base_radius, face_width, mass and flank/strip_half_width must be above 0": min(
            body.r_b, body.face_width, body.mass, body.strip_half_width
        )
        > 0,
        "static/c_ff must hold the tooth offsets −K … K, K at least 3, or all": body.static_ff.shape[2] == body.teeth
        or (7 <= body.static_ff.shape[2] < body.teeth and body.static_ff.shape[2] % 2 == 1),
        "helix/base_angle must lie between −π/4 and π/4": abs(body.base_helix_angle) < np.pi / 4,
        "there must be a mode, a roll point and a width function": min(body.flank_rows.shape) > 0,
        "modes/frequency must be above 0 and ascending": body.modes == 0
        or (body.frequency[0] > 0 and bool(np.all(np.diff(body.frequency) >= 0))),
        "modes/damping_ratio must lie between 0 and 1": bool(
            np.all((body.damping_ratio >= 0) & (body.damping_ratio < 1))
        ),
        "modes/part: the two modes of a pair must follow each other": _pairs_sound(body),
        "modes/nodal_diameter must lie between 0 and z/2": bool(
            np.all((body.nodal_diameter >= 0) & (2 * body.nodal_diameter <= body.teeth))
        ),
        "modes/parity must be −1, 0 or +1": bool(np.all(np.abs(body.parity) <= 1)),
        "flank/roll must ascend inside flank/roll_range": bool(
            np.all(np.diff(np.concatenate([body.roll_range[:1], body.roll, body.roll_range[1:]])) > 0)
        ),
        "shapes/quads names a point that is not there": body.shapes is None
        or bool(np.all((body.shapes.quads >= 0) & (body.shapes.quads < len(body.shapes.points)))),
        "display/loads does not fit the surface": body.display.loads.shape[1] == len(body.display.points),
        "display/quads names a point that is not there": bool(
            np.all((body.display.quads >= 0) & (body.display.quads < len(body.display.points)))
        ),
    }
    return [text for text, holds in checks.items() if not holds]


def _pairs_sound(body: ReducedBody) -> bool:
    first, second = body.part == 1, body.part == 2
    follows = np.concatenate([[False], first[:-1]])
    same = np.concatenate([[True], np.diff(body.nodal_diameter) == 0])
    return bool(np.all((body.part >= 0) & (body.part <= 2))) and bool(
        np.all(second == follows) and np.all(same[second])
    )
