"""Body: a free elastic body as the kernel takes it, whatever it was made from. Conventions: docs/architecture.md.

A gear, a ring, a shaft, a carrier and a housing are rigid motion, n real oscillators in the mean-axis frame, and static
compliance, all read at nodes. Teeth, spinning, pictures, sensors and a radiating skin are parts that a body has or not.
"""

from __future__ import annotations

import platform
import sys
import time
from dataclasses import dataclass, field, replace
from importlib import metadata
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from gearfmu.body.layout import POINTS, body_problems
from gearfmu.errors import BodyError
from gearfmu.files import PICTURE_BITS, ROW_BITS, TABLE_BITS, entries, stored
from gearfmu.reduction.cyclic.frf import FrfError
from gearfmu.reduction.cyclic.modal import Spin
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.stagefile.forms.general import Reduced
from gearfmu.stagefile.stored import ALGORITHMS, body_hash

if TYPE_CHECKING:
    from gearfmu.body.pictures import Outline

TABLE, COUPLED = (2, 2, "R", "R", "A", "A"), "kg-1/2, m-1.kg-1/2"
_FORMER = {  # names of earlier versions, told by the AttributeError
    "input_hash": "how.hash", "algorithm_version": "how.algorithm", "method": "how.method", "material": "how.material",
    "mesh": "how.mesh", "provenance": "how.provenance", "frf": "error", "display": "picture", "ground": "error.ground",
    "shapes": "picture.shapes", "bore_rows": "rows", "static_bb": "static", "rigid_mass": "mass", "interfaces": "nodes",
    "point": "points", "nodal_diameter": "flank.diameter", "part": "flank.part", "parity": "flank.parity",
    "flank_rows": "flank.rows", "static_ff": "flank.static", "static_fb": "flank.node", "tangent": "flank.tangent",
    "teeth": "flank.teeth", "r_b": "flank.r_b", "psi_b": "flank.psi_b", "base_helix_angle": "flank.beta_b",
    "face_width": "flank.face_width", "strip_half_width": "flank.strip_half_width", "roll": "flank.roll",
    "roll_range": "flank.roll_range", "internal": "flank.internal", "rim": "sensors", "max_error": "error.max_error",
    "trusted_to": "error.trusted_to", "frf_error": "error.error", "frf_frequency": "error.frequency",
    "length": "error.length", "band": "error.band", "knows_profile": "flank.knows_profile",
    "width_functions": "flank.width_functions", "all_offsets": "flank.all_offsets",
}  # fmt: skip


@dataclass(frozen=True)
class How:
    """What a body was made from. hash: `stagefile.stored.body_hash`, 64 hex digits; method: of reduction; material: SI;
    mesh: plain facts; provenance: program versions, time and memory; algorithm: its version, 0 where none made it."""

    hash: str
    method: str
    material: dict[str, Any] = field(default_factory=dict)
    mesh: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    algorithm: int = 0

    @classmethod
    def of(cls, table: Reduced, method: str, mesh: dict[str, Any]) -> How:
        """How a body is made from its table today."""
        material = {} if table.material is None else table.material.model_dump()
        return cls(body_hash(table), method, material, mesh, {}, ALGORITHMS[table.kind])

    def since(self, started: float) -> How:
        """The same with versions of programs, CPU seconds since `time.process_time()` was `started`, and the peak
        memory of the process so far."""
        provenance = {
            "gearfmu": metadata.version("gearfmu"),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "cpu_s": round(time.process_time() - started, 1),
            "peak_memory_GB": _peak_memory(),
        }
        return replace(self, provenance=provenance)


def _peak_memory() -> float | None:
    """Largest resident memory of this process so far; None where the system does not report it (Windows)."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (1e9 if sys.platform == "darwin" else 1e6), 2)


@dataclass(frozen=True)
class Node:
    """Where a body is loaded and read. kind: "rigid" (RBE2), "averaging" (RBE3), "nodes", "section" of a beam, "" where
    its file does not say; components: of `COMPONENTS`, one row of the body each; point (3,) m; span: from where to
    where its surface reaches along z, m, where that is known."""

    name: str
    kind: str
    components: tuple[str, ...]
    point: np.ndarray
    span: tuple[float, float] | None = None

    @property
    def rigid_rows(self) -> np.ndarray:
        """(k, 6): rigid motion about the origin → components."""
        return rigid_rows(self.point)[[COMPONENTS.index(component) for component in self.components]]


def rigid_rows(point: np.ndarray) -> np.ndarray:
    """(6, 6): rigid motion about the origin → motion of a point (3,) m."""
    x, y, z = point
    rows = np.eye(6)
    rows[0, 4:], rows[1, 3], rows[1, 5], rows[2, 3:5] = (z, -y), -z, x, (y, -x)
    return rows


@dataclass(frozen=True)
class Sensors:
    """S points that are read and never loaded. A ring has one: the mean of the patch of its rim that belongs to sector
    0, in that sector's frame."""

    names: tuple[str, ...]
    points: np.ndarray = stored(
        ("S", 3), "m", "where each sensor lies; of a ring: middle of the rim's patch of sector 0"
    )
    rows: np.ndarray = stored(("3S", "n"), "kg-1/2", "displacement x, y, z of each in the modes")
    static: np.ndarray | None = stored(
        ("3S", "m"), "m/N, 1/N", "displacement of each sensor per unit load on the nodes", optional=True
    )

    @property
    def rigid_rows(self) -> np.ndarray:
        """(3S, 6): rigid motion about the origin → displacement of each."""
        return np.vstack([rigid_rows(point)[:3] for point in self.points])


@dataclass(frozen=True)
class Skin:
    """A closed surface that radiates."""

    points: np.ndarray = stored(("V", 3), "m", "points of the closed outer surface", "f4")
    faces: np.ndarray = stored(("W", 4), "", "its faces, normals outward; a triangle repeats its last point", "i8")
    modes: np.ndarray = stored(
        ("6+n", "V", 3),
        "1, m, kg-1/2",
        "displacement of the points: rigid motion x, y, z, rx, ry, rz about the origin, then the modes",
        "f4",
        bits=PICTURE_BITS,
        each=True,
    )

    @property
    def skin_modes(self) -> np.ndarray:
        """(P, 3, 6 + n): `modes`, by points."""
        return self.modes.transpose(1, 2, 0)


@dataclass(frozen=True)
class Picture:
    """Pictures of a gear. loads: at roll `load_roll`; shapes: a sector in all modes, None where none was made. The
    surface of a gear with shapes is that of its sectors and not stored."""

    points: np.ndarray = stored(("P", 3), "m", "surface points of the whole gear", "f4")
    quads: np.ndarray = stored(("Q", 4), "", "quadrilaterals of the surface, point numbers", "i8")
    loads: np.ndarray = stored(
        ("L", "P", 3),
        "m/N",
        "displacement of the surface of the whole gear, unit load on flank 0, tooth 0",
        "f4",
        bits=PICTURE_BITS,
        each=True,
    )
    load_roll: np.ndarray = stored(("L",), "m", "roll point of these loads")
    shapes: Shapes | None = None


@dataclass(frozen=True)
class Shapes:
    """Drawn surface of one sector, normals outward, and how it moves in every mode of the gear, of the second mode of a
    pair its own."""

    points: np.ndarray = stored(("T", 3), "m", "surface points of sector 0", "f4")
    quads: np.ndarray = stored(("U", 4), "", "quadrilaterals of its surface, point numbers", "i8")
    ahead: np.ndarray = stored(("U", 4), "", "1: the point of that number in the next sector", "i8")
    modes: np.ndarray = stored(
        ("n", "T", 3), "kg-1/2", "displacement on sector 0 in every mode", "f4", bits=PICTURE_BITS, each=True
    )


@dataclass(frozen=True)
class Exact:
    """What a beam knows beyond its modes. omega (n,) rad/s; residual (m, m): static compliance beyond the modes;
    gyroscopic (6 + n, 6 + n), kg·m² …, skew: of sections that tilt."""

    omega: np.ndarray
    residual: np.ndarray
    gyroscopic: np.ndarray


@dataclass(frozen=True)
class Tangent:
    """Displacement along the profile, towards growing roll: what friction loads and reads."""

    rows: np.ndarray = stored(
        (2, "R", "A", "n"),
        "kg-1/2",
        "tooth 0: like flank/rows, displacement along the profile towards growing roll",
        bits=ROW_BITS,
    )
    static_nt: np.ndarray = stored(
        TABLE,
        "m/N",
        "compliance [f, g, i, j, a, b] of tooth 0 alone: flank f, roll i, function a along the outward normal under "
        "the load along the profile at flank g, roll j, function b",
        bits=TABLE_BITS,
    )
    static_tt: np.ndarray = stored(TABLE, "m/N", "the same, displacement along the profile", bits=TABLE_BITS)


@dataclass(frozen=True)
class Flank:
    """Teeth of a body of equal sectors.

    diameter, part, parity: the modes as patterns round the axis. M of `static` is z, or 2K + 1 where only the tooth
    offsets −K … K are kept: offset m stands at m mod M. internal: normals point into the tooth spaces, and the node is
    the rim. tangent: None of a mean tooth.
    """

    teeth: int = stored((), "", "number of teeth z, equal sectors of the body", "i8")
    internal: bool = stored((), "", "1: a ring, whose index counts tooth spaces", "i8")
    r_b: float = stored((), "m", "base radius")
    psi_b: float = stored((), "rad", "half tooth-thickness angle at the base circle, nominal")
    beta_b: float = stored((), "rad", "base helix angle, positive for a right-handed gear: z turns by z tan β_b / r_b")
    face_width: float = stored((), "m", "face width b; z runs from −b/2 to b/2")
    strip_half_width: float = stored((), "m", "half-width of the load strip in arc length along the flank")
    roll_range: np.ndarray = stored((2,), "m", "roll of form and tip point: the Chebyshev interval")
    roll: np.ndarray = stored(("R",), "m", "roll points: Chebyshev points of the first kind, ascending")
    diameter: np.ndarray = stored(("n",), "", "nodal diameter ν of the modes", "i8")
    part: np.ndarray = stored(("n",), "", "0 single, 1 first (real) and 2 second (imaginary) part of a pair", "i8")
    parity: np.ndarray = stored(("n",), "", "+1 symmetric about mid-width, −1 antisymmetric, 0 neither", "i8")
    rows: np.ndarray = stored(
        (2, "R", "A", "n"),
        "kg-1/2",
        "tooth 0: load-weighted mean displacement along the outward normal; "
        "flank (0: sg = +1), roll point, width function, mode",
        bits=ROW_BITS,
    )
    static: np.ndarray = stored(
        (2, 2, "M", "R", "R", "A", "A"),
        "m/N",
        "compliance [f, g, m, i, j, a, b]: tooth 0, flank f, roll i, function a under the load of tooth m, flank g, "
        "roll j, function b. The file holds the offsets m = 0 … 3, or 0 … z/2 of a small gear, the others follow: "
        "C[f, g, m, i, j, a, b] = C[g, f, −m, j, i, b, a]",
        bits=TABLE_BITS,
    )
    node: np.ndarray = stored(
        (2, "R", "A", 6), "m/N, 1/N", "flank rows of tooth 0 per unit force x, y, z and moment x, y, z on the node"
    )
    tangent: Tangent | None = None

    @property
    def knows_profile(self) -> bool:
        """Whether flanks can be loaded and read along the profile, as friction does."""
        return self.tangent is not None

    @property
    def all_offsets(self) -> bool:
        """Whether `static` holds all tooth offsets."""
        return self.static.shape[2] == self.teeth

    @property
    def width_functions(self) -> int:
        """Number A of Legendre functions across the face width."""
        return self.rows.shape[2]


@dataclass(frozen=True, eq=False)
class Body:
    """A free body: n oscillators, m rows at its nodes, in the order of `nodes`; SI.

    error: how well it follows its finite elements, None where nothing was compared; spin: None turns as if rigid;
    picture: None is not drawn. Raises BodyError naming every field that cannot be.
    """

    name: str
    how: How
    nodes: tuple[Node, ...]
    mass: np.ndarray = stored((6, 6), "kg, kg.m, kg.m2", "mass matrix of rigid motion about the origin")
    frequency: np.ndarray = stored(("n",), "Hz", "natural frequencies of the free body, ascending, none rigid")
    damping_ratio: np.ndarray = stored(("n",), "", "modal damping ratio")
    rows: np.ndarray = stored(("m", "n"), COUPLED, "displacement and rotation of the nodes in the modes")
    static: np.ndarray = stored(
        ("m", "m"), "m/N, 1/N, 1/(N.m)", "compliance of the nodes; inertia relief, mean-axis gauge"
    )
    error: FrfError | None = None
    flank: Flank | None = None
    spin: Spin | None = None
    exact: Exact | None = None
    picture: Picture | None = None
    sensors: Sensors | None = None
    skin: Skin | None = None

    def __post_init__(self) -> None:
        if problems := body_problems(self):
            raise BodyError(f"body '{self.name}' is not valid: " + "; ".join(problems))

    if not TYPE_CHECKING:  # a checker knows the names

        def __getattr__(self, name):
            now = f": it is '{_FORMER[name]}' now" if name in _FORMER else ""
            raise AttributeError(f"a body has no '{name}'{now}")

    @property
    def modes(self) -> int:
        """Number n of oscillators."""
        return len(self.frequency)

    @property
    def total_mass(self) -> float:
        """kg."""
        return float(self.mass[0, 0])

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(3,) m."""
        return np.array([self.mass[1, 5], self.mass[2, 3], self.mass[0, 4]]) / self.mass[0, 0]

    @property
    def inertia(self) -> np.ndarray:
        """(3, 3) about the origin, kg·m²."""
        return self.mass[3:, 3:]

    @property
    def points(self) -> np.ndarray:
        """(K, 3) m: where the nodes lie."""
        return np.array([node.point for node in self.nodes])

    @property
    def rigid_rows(self) -> np.ndarray:
        """(m, 6): rigid motion about the origin → nodes."""
        return np.vstack([node.rigid_rows for node in self.nodes])

    @property
    def toothed(self) -> Flank:
        """The flank of a body that has one."""
        assert self.flank is not None, f"body '{self.name}' has no teeth"
        return self.flank


PARTS: dict[str, type] = {  # classes by their path in a body, inner ones first
    "flank.tangent": Tangent,
    "picture.shapes": Shapes,
    "error": FrfError,
    "flank": Flank,
    "spin": Spin,
    "picture": Picture,
    "sensors": Sensors,
    "skin": Skin,
}
ENTRIES = (POINTS, *entries(Body), *(entry for path, kind in PARTS.items() for entry in entries(kind, f"{path}.")))


def whole_surface(sector: Outline | Shapes, teeth: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (z·P, 3) and quads (z·Q, 4) of all sectors."""
    per_sector = len(sector.points)
    quads = [((j + sector.ahead) % teeth) * per_sector + sector.quads for j in range(teeth)]
    points = turn_sectors(np.broadcast_to(sector.points, (teeth, per_sector, 3)))
    return points.reshape(-1, 3), np.concatenate(quads)


def turn_sectors(vectors: np.ndarray) -> np.ndarray:
    """Sector-frame vectors (…, z, P, 3) in the body frame."""
    angle = 2 * np.pi * np.arange(vectors.shape[-3]) / vectors.shape[-3]
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y, vectors[..., 2]], axis=-1)
