"""What the model blob says of a gear's teeth: whether a reduced body is that gear's own, and its rows and compliances
on an even grid of rolls, for the width functions that the stage can excite."""

from __future__ import annotations

import math

import numpy as np

from gearfmu.body import Body
from gearfmu.body.body import Flank
from gearfmu.stage.assembly.fields import gear_numbers
from gearfmu.stagefile.forms.general import RingBody
from gearfmu.stagefile.forms.shapes import GearShape
from gearfmu.stagefile.tables.gear import GearSpec

SHARPEST_EDGE = 1e-6


def gear_section(gear: GearSpec | RingBody, shape: GearShape, phase: float, place: float) -> np.ndarray:
    """The section "gear" of a gear."""
    material, edge = gear.material, max(gear.tip_edge_radius, SHARPEST_EDGE)
    relief = gear.tip_relief if gear.tip_relief and gear.tip_relief.kind == "parabolic" else None
    start = float(relief.start_roll) if relief else shape.s_a
    curve = relief.amount / (shape.s_a - start) ** 2 if relief else 0.0
    inner = shape.s_tip - math.copysign(edge, shape.s_tip - shape.s_form)  # the edge's centre, inside the tooth
    local = 2 * (1 - material.poisson_ratio**2) / (math.pi * material.youngs_modulus)
    return gear_numbers(
        {
            "r_b": shape.r_b,
            "s_form": shape.s_form,
            "s_tip": shape.s_tip,
            "psi_b": shape.psi_b,
            "phase": phase,
            "face_width": gear.face_width,
            "local": local,
            "strip_half_width": gear.body.strip_half_width,
            "relief": curve,
            "relief_start": start,
            "tip_edge": edge,
            "corner_radius": math.hypot(shape.r_b, inner),
            "corner_angle": shape.s_tip / shape.r_b - math.atan2(inner, shape.r_b),
            "z_mid": place,
            "helix": shape.beta_b,
        }
    )


def mismatches(gear: GearSpec | RingBody, shape: GearShape, flank: Flank) -> list[str]:
    """What says that a body's teeth are not those of a gear, one sentence each; empty when it is."""
    pairs = {
        "teeth": (gear.teeth, flank.teeth),
        "base radius": (shape.r_b, flank.r_b),
        "face width": (gear.face_width, flank.face_width),
        "load strip": (gear.body.strip_half_width, flank.strip_half_width),
    }
    found = [
        f"body of {gear.name}: {what} {have:g} instead of {want:g}"
        for what, (want, have) in pairs.items()
        if not math.isclose(want, have, rel_tol=1e-9)
    ]
    low, high = sorted((shape.s_form, shape.s_tip))
    if not low - 1e-9 <= flank.roll.min() <= flank.roll.max() <= high + 1e-9:
        found.append(
            f"body of {gear.name}: its rolls {flank.roll.min():g} … {flank.roll.max():g} m "
            f"leave the flank {low:g} … {high:g} m"
        )
    return found


ROLLS = 48  # error and price of the grid: docs/decisions.md
MOST_FUNCTIONS = 6
OFFSETS = range(-3, 4)


def resampling(roll: np.ndarray, s_form: float, s_tip: float, rolls: int = ROLLS) -> np.ndarray:
    """(rolls, R) weights from values at the body's Chebyshev points of the first kind `roll` (R,) to an even grid on
    [s_form, s_tip].

    Barycentric formula with the known weights (−1)^k sin((2k + 1)π/2R) (Berrut & Trefethen 2004). Applied to both
    sides of a compliance it stays positive semidefinite. (scipy's interpolator permutes the points at random: two
    calls, two last bits.)
    """
    k = np.arange(roll.size)
    weight = (-1.0) ** k * np.sin((2 * k + 1) * np.pi / (2 * roll.size))
    distance = np.linspace(s_form, s_tip, rolls)[:, None] - roll
    hit = distance == 0.0
    terms = weight / np.where(hit, 1.0, distance)
    terms = np.where(hit.any(axis=1, keepdims=True), hit.astype(float), terms)
    return terms / sum(terms.T)[:, None]


def stored_points(body: Body, s_form: float, s_tip: float, rolls: int) -> tuple[np.ndarray, np.ndarray]:
    """Where a model stores what a flank reads: at the body's own R points, or on the even grid where that has fewer.

    (P, R) weights from the body's points to those that are stored, (rolls, P) from these to the even grid.
    """
    to_grid = resampling(body.toothed.roll, s_form, s_tip, rolls)
    own = body.toothed.roll.size < rolls
    return (np.eye(body.toothed.roll.size), to_grid) if own else (to_grid, np.eye(rolls))


def blend(weights: np.ndarray, values: np.ndarray, axis: int) -> np.ndarray:
    """`values` with `axis` (R,) replaced by (rolls,): Σ_r weights[:, r]·values[r], summed in the order of r.

    Element by element on purpose: matrix products may sum in another order from call to call, and equal inputs must
    give an equal blob.
    """
    moved = np.moveaxis(values, axis, 0)
    if np.array_equal(weights, np.eye(len(moved))):
        return values.astype(float)
    flat = np.ascontiguousarray(moved, float).reshape(len(moved), -1)
    total = np.zeros((weights.shape[0], flat.shape[1]))
    part = np.empty_like(total)
    for weight, value in zip(weights.T, flat, strict=True):
        total += np.multiply(weight[:, None], value, out=part)
    return np.moveaxis(total.reshape(-1, *moved.shape[1:]), 0, axis)


def symmetric_functions(count: int) -> np.ndarray:
    """Degrees of the Legendre functions that a load symmetric about mid-width can excite.

    A spur pair without lead modification loads its slices symmetrically: odd functions and antisymmetric modes stay
    at rest exactly.
    """
    return np.arange(0, count, 2)


def excited_modes(body: Body, degrees: np.ndarray) -> np.ndarray:
    """Indices of the modes with a row in the chosen width functions or in the planar motion of the bore; pairs stay
    together. Of modes of no parity (imported bodies without a mirror at mid-width) the rows of the chosen functions
    count."""
    flank = body.toothed
    rows = np.abs(flank.rows[:, :, degrees, :]).max(axis=(0, 1, 2)) / np.abs(flank.rows).max()
    seen = (rows > 1e-9) & (flank.parity >= 0)
    second = np.flatnonzero(flank.part == 2)
    seen[second] = seen[second - 1] = seen[second] | seen[second - 1]
    return np.flatnonzero(seen)
