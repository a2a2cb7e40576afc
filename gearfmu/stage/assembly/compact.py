"""Tables of a gear's flanks as the model blob stores them: on the points of the body's own, which the kernel spreads
over the even grid of rolls, and nothing twice.

With n = P·A places (points × width functions, place i·A + a), B_m[f, g] (n, n) is the compliance of a tooth's flank g
by a load on flank f of the tooth m before it. B_−m[g, f] is its transpose. Half a turn about the middle line of tooth 0
makes a gear of equal sectors that is alike on both sides of mid-width its own image, flank 0 flank 1: with the signs
s_a = (−1)^degree of the width functions B_m[1, 1] = s B_m[0, 0]ᵀ s, and B_m[f, g] s is symmetric for f ≠ g. Such gears
are called mirrored; it is checked, not assumed.

Far from a tooth only the resultants of its load count (Saint-Venant). U are RANK patterns of the outward normal
displacement of a tooth, over both flanks, lengths of roll and width functions. A tooth loaded by forces F that presses
on a tooth m further is displaced there by U S(m) Uᵀ F. S(m) belongs to the level: the kernel sums it over what is not
dynamic there (`gk_far_fill.c`), from coefficients.

A few polynomials at one length of roll represent a slice's load in these tables, and smear it over much of the width
(docs/theory.md, eq. 8g′). Near the load a flank is a half-space. There the mean of 1/distance between two smeared loads
is known; the kernel puts that of the slices themselves in its place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from scipy.linalg import eigh

from gearfmu.stage.assembly.ground_part import PartFlank, read_tables, turn_tables
from gearfmu.stage.assembly.groups import Group, node_directions
from gearfmu.stage.assembly.teeth import OFFSETS, blend, products
from gearfmu.stagefile.forms.general import RingBody
from gearfmu.stagefile.forms.shapes import GearShape
from gearfmu.stagefile.tables.bodies import GearSpec

EQUAL = 1e-6  # of the largest compliance: what may part the flanks of a mirrored gear, whose tables are rounded
FURTHER = range(1, max(OFFSETS) + 1)
ACROSS = [(0, 1, 0)] + [(f, 1 - f, m) for m in FURTHER for f in (0, 1)]  # from flank, to flank, offset


def is_mirrored(flank: PartFlank, degrees: np.ndarray) -> bool:
    """Whether flank 1 of a gear is the image of its flank 0."""
    along = flank.along
    tables = [flank.residual] + ([along.normal[:, :, None], along.own[:, :, None]] if along else [])
    return all(_is_own_image(table, degrees) for table in tables)


def flank_tables(index: int, flank: PartFlank, degrees: np.ndarray) -> dict[str, np.ndarray]:
    """Sections of gear `index` that its body alone decides."""
    along, mirrored = flank.along, is_mirrored(flank, degrees)
    found = {
        f"rows{index}": flank.turning,
        f"low_rows{index}": read_tables(flank.patterns, 0.0),
        f"low_member{index}": flank.low_member.astype(np.int32),
        f"node{index}": flank.node,
    } | residual_sections(index, flank.residual, degrees, mirrored)
    if along is None:
        return found
    return (
        found
        | {f"along_rows{index}": along.turning, f"along_low{index}": read_tables(along.patterns, 0.0)}
        | along_sections(index, along.normal, along.own, degrees, mirrored)
    )


def ground_tables(index: int, number: int, group: Group, read: np.ndarray) -> dict[str, np.ndarray]:
    """Sections of gear `index` in a set of ground oscillators, of which it reads `read`."""
    layout = group.layout
    sides = node_directions(layout, index)
    shapes = group.shapes[group.at[index]][len(layout.freedoms(index)) :]
    return {
        f"ground_list{index}_{number}": read.astype(np.int32),
        f"centre{index}_{number}": group.rigid(index)[:, read],
        f"low_ground{index}_{number}": shapes[:, read],
        f"node_ground{index}_{number}": -products(sides.T @ group.kappa, group.support_rows[:, read].T),
    }


def residual_sections(
    index: int, residual: np.ndarray, degrees: np.ndarray, mirrored: bool = False
) -> dict[str, np.ndarray]:
    """Sections of a residual (2, 2, 7, P, P, A, A), m/N."""
    blocks, flanks = _Blocks(residual, degrees), (0,) if mirrored else (0, 1)
    return {
        f"residual_own{index}": np.stack([blocks.half(f, f, 0) for f in flanks]),
        f"residual_next{index}": np.stack([[blocks.whole(f, f, m) for m in FURTHER] for f in flanks]),
        f"residual_across{index}": np.stack([blocks.across(*of, mirrored) for of in ACROSS]),
    }


def along_sections(
    index: int, normal: np.ndarray, own: np.ndarray, degrees: np.ndarray, mirrored: bool
) -> dict[str, np.ndarray]:
    """Sections of compliances (2, 2, P, P, A, A) of one tooth per force along the profile, m/N."""
    blocks, turned = _Blocks(normal[:, :, None], degrees), _Blocks(own[:, :, None], degrees)
    flanks = (0,) if mirrored else (0, 1)
    return {
        f"along_normal{index}": np.stack([[blocks.whole(f, g, 0) for g in (0, 1)] for f in flanks]),
        f"along_own{index}": np.stack([turned.half(f, f, 0) for f in flanks]),
        f"along_across{index}": turned.across(0, 1, 0, mirrored),
    }


def ground_rows(index: int, number: int, sections: Mapping[str, np.ndarray]) -> np.ndarray:
    """(3, 2, P, A, reads) kg^-½: outward normal displacement of a tooth by ground oscillators beside the rigid motion
    of the gear, as c₀, c_c, c_s, from the sections of `flank_tables` and `ground_tables`."""
    patterns = turn_tables(sections[f"low_rows{index}"], sections[f"low_member{index}"])
    moved = products(patterns, sections[f"low_ground{index}_{number}"].T)
    return moved + products(sections[f"node{index}"], sections[f"node_ground{index}_{number}"].T)


class _Blocks:
    """Blocks (n, n) of a table (2, 2, offsets, P, P, A, A), offsets −m … m."""

    def __init__(self, table: np.ndarray, degrees: np.ndarray):
        self.table, self.zero = table, table.shape[2] // 2
        self.size = table.shape[3] * table.shape[5]
        self.sign = np.tile((-1.0) ** np.asarray(degrees), table.shape[3])

    def whole(self, f: int, g: int, m: int) -> np.ndarray:
        return self.table[f, g, self.zero + m].transpose(0, 2, 1, 3).reshape(self.size, self.size)

    def half(self, f: int, g: int, m: int) -> np.ndarray:
        """Lower triangle, row by row."""
        return self.whole(f, g, m)[np.tril_indices(self.size)]

    def across(self, f: int, g: int, m: int, mirrored: bool) -> np.ndarray:
        block = self.whole(f, g, m)
        return (block * self.sign)[np.tril_indices(self.size)] if mirrored else block.ravel()


def _is_own_image(table: np.ndarray, degrees: np.ndarray) -> bool:
    sign = (-1.0) ** np.asarray(degrees)
    image = table[::-1, ::-1, ::-1] * sign[:, None] * sign
    return bool(np.abs(table - image).max() <= EQUAL * np.abs(table).max())


RANK = 12  # error beside the own compliance of a tooth: docs/decisions/kernel.md
RIGID_SHARE = 0.5  # of the kinetic energy: oscillators above are dynamic at every level
POINTS = 8  # Gauss points over the face width
FALLEN = 1e-6  # of the largest singular value: what lies below is rounding


def far_sections(
    index: int, sections: dict[str, np.ndarray], shape: GearShape, width: float, sets: int, lowest: float
) -> dict[str, np.ndarray]:
    """Sections "far_rows", "far_modes" and, for every set of ground oscillators, "far_ground" of gear `index`;
    nothing for a rigid gear.

    sections: of the model so far; width: face width, m; lowest: rad/s, below it everything is dynamic at every level.
    """
    resample, omega = sections[f"resample{index}"], sections[f"omega{index}"]
    rows = blend(resample, sections[f"rows{index}"], 1)
    size = rows.shape[:3]
    modes = rows.reshape(math.prod(size), omega.size)
    ground = [_ground_rows(index, s, sections, shape, width).reshape(3, math.prod(size), -1) for s in range(sets)]
    columns = [modes[:, omega > lowest] / omega[omega > lowest]]
    for s, tables in enumerate(ground):
        read = sections[f"ground_list{index}_{s}"]
        rate = sections[f"omega_ground{s}"][read]
        cut = (rate > lowest) & (sections[f"rigid_share{s}"][read] <= RIGID_SHARE)
        columns += [table[:, cut] / rate[cut] for table in tables]
    snapshots = np.hstack(columns)
    if not snapshots.size:
        return {}
    patterns = np.zeros((math.prod(size), RANK))
    found = _left_vectors(snapshots)
    patterns[:, : found.shape[1]] = found
    return {
        f"far_rows{index}": _at_points(resample, patterns.reshape(*size, RANK)),
        f"far_modes{index}": patterns.T @ modes,
    } | {f"far_ground{index}_{s}": patterns.T @ tables for s, tables in enumerate(ground)}


def _at_points(resample: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(2, P, A, RANK): the values at the points that are stored whose `resample` (rolls, P) is `rows`."""
    columns = np.moveaxis(rows, 1, 0)
    found = np.linalg.lstsq(resample, columns.reshape(len(columns), -1))[0]
    return np.moveaxis(found.reshape(-1, *columns.shape[1:]), 0, 1)


def _left_vectors(columns: np.ndarray) -> np.ndarray:
    """The first RANK left singular vectors, largest first, with a sign of their own: eigenvectors of the Gram matrix,
    right to 1e-14 where singular values fall by less than 1e-6."""
    size = len(columns)
    values, vectors = eigh(columns @ columns.T, subset_by_index=[max(size - RANK, 0), size - 1])
    vectors = vectors[:, values > FALLEN**2 * values[-1]][:, ::-1]
    largest = np.abs(vectors).argmax(axis=0)
    return vectors * np.sign(vectors[largest, np.arange(vectors.shape[1])])


def _ground_rows(
    index: int, number: int, sections: dict[str, np.ndarray], shape: GearShape, width: float
) -> np.ndarray:
    """(3, 2, rolls, functions, reads) kg^-1/2: outward normal displacement of a tooth by ground oscillators, rigid
    motion included, as c0 + c_c cos ψ + c_s sin ψ of the tooth's angle."""
    moved = blend(sections[f"resample{index}"], ground_rows(index, number, sections), 2)
    rigid = _rigid_rows(shape, moved.shape[2], width, sections["degrees"])
    return moved + np.einsum("jfras,sk->jfrak", rigid, sections[f"centre{index}_{number}"])


def _rigid_rows(shape: GearShape, rolls: int, width: float, degrees: np.ndarray) -> np.ndarray:
    """(3, 2, rolls, functions, 6): the same by the gear's motions x, y, z, rx, ry, rz at mid-width. The normal of a
    flank at length of roll s turns with s: at the angle τ = ψ − sg (s/r_b − ψ_b) of the line of action."""
    hollow = -1.0 if shape.s_tip < shape.s_form else 1.0
    roll = np.linspace(shape.s_form, shape.s_tip, rolls)[:, None]
    place, weight = np.polynomial.legendre.leggauss(POINTS)
    z, cosine, sine = 0.5 * width * place, math.cos(shape.beta_b), math.sin(shape.beta_b)
    legendre = np.array([np.polynomial.Legendre.basis(n)(place) * (n + 0.5) * weight for n in degrees])
    found = np.empty((3, 2, rolls, len(degrees), 6))
    for flank, sg in enumerate((1.0, -1.0)):
        across, axial = hollow * sg * cosine, -hollow * sg * sine
        middle = roll - sg * z * math.tan(shape.beta_b)
        turned = -sg * (middle / shape.r_b - shape.psi_b)
        by_cosine = np.zeros((6, rolls, POINTS))
        by_sine, constant = np.zeros_like(by_cosine), np.zeros_like(by_cosine)
        by_sine[0], by_cosine[1], constant[2] = -across, across, axial
        by_cosine[3], by_sine[3] = axial * sg * roll - across * z, axial * shape.r_b
        by_sine[4], by_cosine[4] = axial * sg * roll - across * z, -axial * shape.r_b
        constant[5] = across * shape.r_b
        c, s = np.cos(turned), np.sin(turned)
        parts = (constant, by_cosine * c + by_sine * s, by_sine * c - by_cosine * s)
        for j, part in enumerate(parts):
            found[j, flank] = np.einsum("mrz,az->ram", part, legendre)
    return found


SMEARED_ROLLS, DISTANCES = 9, 17  # places of the table: mean length of roll, distance of the slices
SMEARED_POINTS = (40, 56)  # of quadrature across the width; unlike, so that no two coincide where 1/r is infinite
GRADED = 40  # of quadrature over the distance along the line, dense as its cube where 1/r is infinite


def smeared(gear: GearSpec | RingBody, shape: GearShape, degrees: np.ndarray) -> np.ndarray:
    """The section "smeared" of a gear: (SMEARED_ROLLS, DISTANCES, A, A) 1/m for the Legendre degrees (A,), at lengths
    of roll from s_form to s_tip and distances across the width from 0 to the face width."""
    arcs = np.linspace(shape.s_form, shape.s_tip, SMEARED_ROLLS) / shape.r_b
    known = (gear.face_width, gear.body.strip_half_width, shape.beta_b, tuple(arcs.tolist()), tuple(degrees.tolist()))
    return _between(*known)


def smeared_tip(gear: GearSpec | RingBody, shape: GearShape, degrees: np.ndarray) -> np.ndarray:
    """The section "smeared_tip": (DISTANCES, A, A) 1/m to mirror images beyond the tip edge, at distances along the
    profile that are squares of even steps, up to twice the length of the flank's profile."""
    profile = abs(shape.s_tip**2 - shape.s_form**2) / (2 * shape.r_b)
    z, first, z2, second = _quadrature(gear.face_width, degrees)
    away = (z[:, None] - z2) / math.cos(shape.beta_b)
    across = 2 * profile * np.linspace(0.0, 1.0, DISTANCES) ** 2
    strip = gear.body.strip_half_width
    return _turned_alike(np.array([first.T @ _of_strips(away, y, strip) @ second for y in across]), degrees)


@lru_cache(maxsize=64)
def _between(width: float, strip: float, helix: float, arcs: tuple[float, ...], degrees: tuple[int, ...]) -> np.ndarray:
    """`between_functions`, kept: the same gear is assembled again and again, in sweeps and beside its equals."""
    found = between_functions(width, strip, helix, np.array(arcs), np.array(degrees))
    found.flags.writeable = False
    return found


def between_functions(width: float, strip: float, helix: float, arcs: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Mean of 1/distance (1/m) between the loads of two width functions, with both end faces as mirrors.

    Two lines of constant roll, whose places on the line of contact are some distance apart across the width, carry the
    densities P_a and P_b, uniform over ±strip along the profile.

    width, strip: face width and half-width of the load strip, m. helix: signed base helix angle, rad. arcs: (R,) length
    of profile per length of roll. degrees: (A,). Returns (R, DISTANCES, A, A) at distances from 0 to `width`; the place
    of higher z has the first function.
    """
    z, first, z2, second = _quadrature(width, degrees)
    away, mirrored = z[:, None] - z2, np.stack([z[:, None] + z2 - width, z[:, None] + z2 + width]) / math.cos(helix)
    apart, weight = _graded(width)
    shared = weight[:, None, None] * _correlation(width, apart, degrees)
    result = np.empty((len(arcs), DISTANCES, len(degrees), len(degrees)))
    for r, slope in enumerate(arcs * math.tan(helix)):
        for d, distance in enumerate(np.linspace(0.0, width, DISTANCES)):
            mean = _of_strips(apart / math.cos(helix), slope * (distance - apart), strip)
            images = _of_strips(mirrored, slope * (distance - away), strip).sum(axis=0)
            result[r, d] = np.tensordot(mean, shared, 1) + first.T @ images @ second
    return _turned_alike(result, degrees)


def _turned_alike(table: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Half a turn exchanges both places and their functions; quadrature alone does not keep this to the last bit."""
    sign = (-1.0) ** degrees
    return (table + np.swapaxes(table, -1, -2) * sign[:, None] * sign) / 2


def _graded(width: float) -> tuple[np.ndarray, np.ndarray]:
    """Distances from −width to width and weights of quadrature, for functions that are infinite as a logarithm at 0."""
    x, weight = leggauss(GRADED)
    u = (x + 1) / 2
    distance, weight = width * u**3, 3 * width * u**2 * weight / 2
    return np.concatenate([-distance[::-1], distance]), np.concatenate([weight[::-1], weight])


def _correlation(width: float, apart: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """(n, A, A) 1/m: ∫ P_a(2z/b) P_b(2(z − apart)/b) dz/b² over the z at which both places are on the width."""
    highest = int(degrees.max())
    x, weight = leggauss(highest + 1)
    length, middle = width - np.abs(apart[:, None]), apart[:, None] / 2
    z = middle + length / 2 * x
    first, second = (legvander(2 * place / width, highest)[..., degrees] for place in (z, z - apart[:, None]))
    return np.einsum("nq,nqa,nqb->nab", length / 2 * weight / width**2, first, second)


def _quadrature(width: float, degrees: np.ndarray) -> tuple[np.ndarray, ...]:
    """Places across the width and densities there times weights of quadrature, (n,) and (n, A), for two loads."""
    result: list[np.ndarray] = []
    for count in SMEARED_POINTS:
        x, weight = leggauss(count)
        result += [width / 2 * x, legvander(x, int(degrees.max()))[:, degrees] * weight[:, None] / 2]
    return tuple(result)


def _of_strips(x: np.ndarray, y: np.ndarray | float, strip: float) -> np.ndarray:
    """Mean of 1/√(x² + (y + t)²) over the t between two points of ±strip: a second difference."""

    def twice(v: np.ndarray | float) -> np.ndarray:
        return v * np.arcsinh(v / np.abs(x)) - np.hypot(x, v)

    return (twice(y + 2 * strip) - 2 * twice(y) + twice(y - 2 * strip)) / (4 * strip**2)
