"""The layout of a body file: one table from which it is written, read, checked and documented."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

FORMAT = "gearfmu-body"
FORMAT_VERSION = 3
ALGORITHM_VERSION = 2  # raise it when the numbers of a body change: every stored body is then stale


@dataclass(frozen=True)
class Entry:
    """One dataset: path in the file, attribute path in ReducedBody, shape in symbols or numbers, unit, meaning, and how
    it is stored (`gearfmu/body/packing.py`).

    kind: in memory, "f8" doubles, "f4" singles (pictures), "i8" integers. bits: 0, the file holds the numbers
    themselves; else whole multiples of a step, which the largest number has fewer than 2^bits of, and along the roll
    points (R) those of its cosine transform. each: a step for every index of the first axis instead of one for all.
    """

    path: str
    field: str
    shape: tuple[str | int, ...]
    unit: str
    meaning: str
    kind: str = "f8"
    bits: int = 0
    each: bool = False


TABLE_BITS = 23  # of compliances; what this costs a model: docs/decisions/bodies.md
ROW_BITS = 21  # of rows in modes and of the coupling of modes
PICTURE_BITS = 7


def _entries() -> tuple[Entry, ...]:
    return (*_body_entries(), *_mode_entries(), *_static_entries(), *_frf_entries(), *_display_entries())


def _body_entries() -> tuple[Entry, ...]:
    return (
        Entry("body/teeth", "teeth", (), "", "number of teeth z, equal sectors of the body", "i8"),
        Entry("body/base_radius", "r_b", (), "m", "base radius r_b"),
        Entry("body/base_half_angle", "psi_b", (), "rad", "half tooth-thickness angle at the base circle, nominal"),
        Entry("body/face_width", "face_width", (), "m", "face width b; z runs from −b/2 to b/2"),
        Entry("body/mass", "mass", (), "kg", "mass of the whole body"),
        Entry("body/inertia", "inertia", (3, 3), "kg.m2", "inertia about the origin: on the axis at mid-width"),
        Entry("flank/roll_range", "roll_range", (2,), "m", "roll of form and tip point: the Chebyshev interval"),
        Entry("flank/roll", "roll", ("R",), "m", "roll points: Chebyshev points of the first kind, ascending"),
        Entry(
            "flank/strip_half_width",
            "strip_half_width",
            (),
            "m",
            "half-width of the load strip in arc length along the flank",
        ),
    )


def _mode_entries() -> tuple[Entry, ...]:
    return (
        Entry(
            "modes/frequency", "frequency", ("n",), "Hz", "natural frequencies of the free body, ascending, none rigid"
        ),
        Entry("modes/damping_ratio", "damping_ratio", ("n",), "", "modal damping ratio"),
        Entry("modes/nodal_diameter", "nodal_diameter", ("n",), "", "nodal diameter ν", "i8"),
        Entry(
            "modes/part", "part", ("n",), "", "0 single, 1 first (real) and 2 second (imaginary) part of a pair", "i8"
        ),
        Entry("modes/parity", "parity", ("n",), "", "+1 symmetric about mid-width, −1 antisymmetric, 0 neither", "i8"),
        Entry(
            "modes/flank_rows",
            "flank_rows",
            (2, "R", "A", "n"),
            "kg-1/2",
            "tooth 0: load-weighted mean displacement along the outward normal; "
            "flank (0: sg = +1), roll point, width function, mode",
            bits=ROW_BITS,
        ),
        Entry(
            "modes/bore_rows",
            "bore_rows",
            (6, "n"),
            "kg-1/2, m-1.kg-1/2",
            "averaging node of the bore: mean ux, uy, uz, rotation rx, ry, rz",
        ),
    )


def _static_entries() -> tuple[Entry, ...]:
    return (
        Entry(
            "static/c_ff",
            "static_ff",
            (2, 2, "M", "R", "R", "A", "A"),
            "m/N",
            "compliance [f, g, m, i, j, a, b]: tooth 0, flank f, roll i, function a under the load of tooth m, "
            "flank g, roll j, function b; inertia relief, mean-axis gauge. The file holds the offsets m = 0 … 3 "
            "(a small gear's and older rings: 0 … z/2), the others follow: C[f, g, m, i, j, a, b] = "
            "C[g, f, −m, j, i, b, a]",
            bits=TABLE_BITS,
        ),
        Entry(
            "static/c_fb",
            "static_fb",
            (2, "R", "A", 6),
            "m/N, 1/N",
            "flank rows of tooth 0 per unit force x, y, z and moment x, y, z on the bore node",
        ),
        Entry("static/c_bb", "static_bb", (6, 6), "m/N, 1/N, 1/(N.m)", "bore node per unit load on the bore node"),
    )


def _frf_entries() -> tuple[Entry, ...]:
    return (
        Entry("frf/frequency", "frf.frequency", ("F",), "Hz", "frequency lines"),
        Entry("frf/error", "frf.error", ("F",), "", "relative Frobenius error with the bore node held (paper eq. 3)"),
        Entry(
            "frf/error_free", "frf.error_free", ("F",), "", "the same of the free body's elastic part, with bore ports"
        ),
        Entry("frf/band", "frf.band", (2,), "Hz", "band of max_error"),
        Entry("frf/max_error", "frf.max_error", (), "", "largest error (bore held) in the band"),
        Entry("frf/trusted_to", "frf.trusted_to", (), "Hz", "the error stays below 1 % up to this frequency"),
        Entry("frf/cut", "frf.cut", (), "Hz", "modes below this were dynamic in the comparison, the others static"),
        Entry("frf/size", "frf.size", (), "", "number of modes below the cut", "i8"),
        Entry("frf/length", "frf.length", (), "m", "length by which rotations are multiplied"),
    )


def _display_entries() -> tuple[Entry, ...]:
    return (
        Entry(
            "display/loads",
            "display.loads",
            ("L", "P", 3),
            "m/N",
            "displacement of the surface of the whole gear, unit load on flank 0, tooth 0",
            "f4",
            bits=PICTURE_BITS,
            each=True,
        ),
        Entry("display/load_roll", "display.load_roll", ("L",), "m", "roll point of these loads"),
    )


def _surface_entries() -> tuple[Entry, ...]:
    return (
        Entry("surface/points", "display.points", ("P", 3), "m", "surface points of the whole gear", "f4"),
        Entry("surface/quads", "display.quads", ("Q", 4), "", "quadrilaterals of the surface, point numbers", "i8"),
    )


def _rim_entries() -> tuple[Entry, ...]:
    return (
        Entry("rim/patch_point", "sensors.points", (1, 3), "m", "middle of the rim's patch of sector 0"),
        Entry("rim/patch_rows", "sensors.rows", (3, "n"), "kg-1/2", "mean displacement x, y, z of that patch"),
    )


def _helix_entries() -> tuple[Entry, ...]:
    return (
        Entry(
            "helix/base_angle",
            "base_helix_angle",
            (),
            "rad",
            "base helix angle β_b, positive for a right-handed gear: the section at z is turned by z tan β_b / r_b",
        ),
    )


def _tangent_entries() -> tuple[Entry, ...]:
    table = (2, 2, "R", "R", "A", "A")
    return (
        Entry(
            "tangent/rows",
            "tangent.rows",
            (2, "R", "A", "n"),
            "kg-1/2",
            "tooth 0: like modes/flank_rows, displacement along the profile towards growing roll",
            bits=ROW_BITS,
        ),
        Entry(
            "tangent/c_nt",
            "tangent.static_nt",
            table,
            "m/N",
            "compliance [f, g, i, j, a, b] of tooth 0 alone: flank f, roll i, function a along the outward normal "
            "under the load along the profile at flank g, roll j, function b",
            bits=TABLE_BITS,
        ),
        Entry(
            "tangent/c_tt",
            "tangent.static_tt",
            table,
            "m/N",
            "the same, displacement along the profile",
            bits=TABLE_BITS,
        ),
    )


def _shape_entries() -> tuple[Entry, ...]:
    return (
        Entry("shapes/points", "shapes.points", ("S", 3), "m", "surface points of sector 0", "f4"),
        Entry("shapes/quads", "shapes.quads", ("T", 4), "", "quadrilaterals of its surface, point numbers", "i8"),
        Entry("shapes/ahead", "shapes.ahead", ("T", 4), "", "1: the point of that number in the next sector", "i8"),
        Entry(
            "shapes/modes",
            "shapes.modes",
            ("n", "S", 3),
            "kg-1/2",
            "displacement on sector 0 in every mode",
            "f4",
            bits=PICTURE_BITS,
            each=True,
        ),
    )


def _spin_entries() -> tuple[Entry, ...]:
    return (
        Entry(
            "spin/coupling",
            "spin.coupling",
            ("n", "n"),
            "",
            "integral of density times mode k . (e_z x mode l), skew",
            bits=ROW_BITS,
        ),
        Entry(
            "spin/tilt", "spin.tilt", (2, "n"), "kg1/2.m", "the same with rigid tilt about x and y: of z u_x and z u_y"
        ),
        Entry("spin/load", "spin.load", ("n",), "kg1/2.m", "centrifugal load per square of the speed"),
        Entry("spin/stiffening", "spin.stiffening", ("n",), "", "B in ω² = ω₀² + B Ω²: stresses less softening"),
        Entry(
            "spin/growth",
            "spin.growth",
            (2, "R", "A"),
            "m.s2",
            "flank rows of tooth 0 under centrifugal load per square of the speed",
        ),
        Entry(
            "spin/inertia",
            "spin.inertia",
            (),
            "kg.m2.s2",
            "what that adds to the polar inertia per square of the speed",
        ),
    )


ENTRIES = _entries()
RIM_ENTRIES = _rim_entries()
GROUPS = {
    "rim": RIM_ENTRIES,
    "helix": _helix_entries(),
    "tangent": _tangent_entries(),
    "shapes": _shape_entries(),
    "surface": _surface_entries(),
    "spin": _spin_entries(),
}


def entries_of(groups: Iterable[str]) -> tuple[Entry, ...]:
    """The datasets of a body: those of every gear, and of the `groups` that it has besides: "rim" (an internal gear),
    "helix" (a helical one), "tangent" (one that is loaded along the profile too), "shapes" (surface of a
    sector, in all modes), "surface" (that of the whole gear, where no sector stands for it), "spin" (what modes feel
    when the body turns)."""
    return (*ENTRIES, *(entry for name in GROUPS if name in groups for entry in GROUPS[name]))


TEXTS = {
    "material": "material: youngs_modulus (Pa), poisson_ratio, density (kg/m³)",
    "mesh": "finite-element mesh: element counts, degrees of freedom, quality",
    "provenance": "program versions, time and memory of the reduction",
}
