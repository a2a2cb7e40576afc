"""What a load on one tooth of a gear displaces at the teeth of its other engagements, in few numbers.

Far from a tooth only the resultants of its load count (Saint-Venant). U are RANK patterns of the outward normal
displacement of a tooth, over both flanks, lengths of roll and width functions. A tooth loaded by forces F that presses
on a tooth m further is displaced there by U S(m) Uᵀ F. S(m) belongs to the level: the kernel sums it over what is not
dynamic there (`gk_far_fill.c`), from the coefficients below.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import eigh

from gearfmu.spec.forms.shapes import GearShape
from gearfmu.stage.build.compact import ground_rows
from gearfmu.stage.build.tables import blend

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
