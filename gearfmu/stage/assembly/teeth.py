"""The teeth of one gear in the model blob: their numbers, the reading of a reduced body, and the field of deviations.

A body is checked to be that gear's own. It is read at lengths of roll, for width functions and in modes that the stage
can excite.

The field is everything that the stage file says about the flanks, as material (positive: more than nominal) by tooth,
flank, place across the width and length of roll (docs/theory.md, 2.2). Tip relief of the parabolic kind, leads and
pitch errors have sections of their own in the blob, exact and cheaper."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path

import numpy as np

from gearfmu.body import Body
from gearfmu.body.body import Flank
from gearfmu.errors import ModelError
from gearfmu.geometry.iso1328 import Draw, Tolerances, draw, seed_of
from gearfmu.geometry.relief import relief_at, relief_depth
from gearfmu.stage.assembly.blob import gear_numbers
from gearfmu.stagefile.forms.general import RingBody, ToothedBody
from gearfmu.stagefile.forms.shapes import GearShape
from gearfmu.stagefile.tables.bodies import Eccentricity, GearSpec, Wobble
from gearfmu.stagefile.tables.topography import Topography, read_topography

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
SEEN = 1e-9  # rows of a mode, relative to the largest: below it nothing excites it
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
    """`values` with `axis` (R,) replaced by (rolls,): Σ_r weights[:, r]·values[r], summed in the order of r."""
    moved = np.moveaxis(values, axis, 0)
    if np.array_equal(weights, np.eye(len(moved))):
        return values.astype(float)
    flat = np.ascontiguousarray(moved, float).reshape(len(moved), -1)
    return np.moveaxis(products(weights, flat.T).reshape(-1, *moved.shape[1:]), 0, axis)


def products(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left (…, n) · right (m, n)ᵀ, summed in the order of n.

    Element by element on purpose: matrix products may sum in another order from call to call, and equal inputs must
    give an equal blob.
    """
    total = np.zeros((*left.shape[:-1], right.shape[0]))
    part = np.empty_like(total)
    for k in range(right.shape[1]):
        total += np.multiply(left[..., k, None], right[:, k], out=part)
    return total


def excited_modes(body: Body, degrees: np.ndarray, even: bool) -> np.ndarray:
    """Indices of the modes with a row in the chosen width functions, or also, unless `even`, in the motion of the bore;
    pairs stay together.

    even: slices are loaded symmetrically, so antisymmetric modes stay at rest exactly. Of modes of no parity (imported
    bodies without a mirror at mid-width) the rows of the chosen functions count.
    """
    flank, node = body.toothed, np.abs(body.rows)
    seen = np.abs(flank.rows[:, :, degrees]).max(axis=(0, 1, 2)) / np.abs(flank.rows).max() > SEEN
    seen = seen & (flank.parity >= 0) if even else seen | (node > SEEN * node.max(axis=1, keepdims=True)).any(axis=0)
    second = np.flatnonzero(flank.part == 2)
    seen[second] = seen[second - 1] = seen[second] | seen[second - 1]
    return np.flatnonzero(seen)


FLANK_ROLLS = 129  # of the grid along the flank, even between its ends
FLANK_WIDTHS = 33  # across the face width, where deviations are not straight there


class FlankField:
    """Deviations of the flanks of one gear. gear : GearSpec or RingBody; shape : its geometry."""

    def __init__(self, gear: ToothedBody, shape: GearShape):
        self.gear, self.shape = gear, shape

    # ---- what is said, one by one --------------------------------------------------------------------------------
    @cached_property
    def drawn(self) -> Draw | None:
        """Deviations of the tolerance class; parts that are not drawn are zero."""
        wanted = self.gear.deviations
        if wanted is None:
            return None
        gear, shape = self.gear, self.shape
        limits = Tolerances.of(wanted.tolerance_class, 2 * shape.r, shape.m, gear.face_width)
        all_of_it = draw(limits, gear.teeth, shape.alpha_t, seed_of(wanted.seed, gear.name), wanted.per_tooth)
        parts = zip(("pitch", "profile", "helix"), (all_of_it.index, all_of_it.profile, all_of_it.helix), strict=True)
        return Draw(*(wanted.use * values * (name in wanted.parts) for name, values in parts))

    @cached_property
    def topography(self) -> Topography | None:
        """The file's; ModelError when it cannot be read any more."""
        if self.gear.topography is None:
            return None
        found, problems = read_topography(Path(self.gear.topography), self.gear.teeth, self.shape)
        if found is None:
            raise ModelError("; ".join(map(str, problems)))
        return found

    def index(self) -> np.ndarray:
        """Individual index deviations F_pi (2 flanks, z) m, arc on the reference circle, counter-clockwise."""
        own = np.zeros(self.gear.teeth)
        own[list(self.gear.index_deviation)] = list(self.gear.index_deviation.values())
        if self.gear.pitch_deviation:
            own = own + np.cumsum(self.gear.pitch_deviation)
        return own + (self.drawn.index if self.drawn else np.zeros((2, 1)))

    def profile(self, roll: np.ndarray) -> np.ndarray:
        """Material (len(roll),) m of the profile's modifications, the same on all flanks; without a parabolic tip
        relief."""
        shape, gear = self.shape, self.gear
        material = np.zeros(roll.size)
        if gear.profile is not None:
            x = self._height(roll)
            material += gear.profile.slope * x / 2 - gear.profile.crowning * x**2
        if gear.tip_relief is not None and gear.tip_relief.kind != "parabolic":
            tip = gear.tip_relief
            material -= relief_at(roll, tip.amount, tip.start_roll, shape.s_a, tip.kind)
        if gear.root_relief is not None:
            root = gear.root_relief
            material -= relief_at(roll, root.amount, root.start_roll, shape.s_form, root.kind)
        return material

    def _height(self, roll: np.ndarray) -> np.ndarray:
        """−1 where the flank ends at its root, 1 at its tip."""
        return 2 * (roll - self.shape.s_form) / (self.shape.s_tip - self.shape.s_form) - 1

    # ---- all of it -----------------------------------------------------------------------------------------------
    @property
    def rolls(self) -> np.ndarray:
        """The grid's lengths of roll (m), from the end of the flank at its root to that at its tip."""
        return np.linspace(self.shape.s_form, self.shape.s_tip, FLANK_ROLLS)

    @property
    def widths(self) -> np.ndarray:
        """The grid's places across the width (m), from its middle; one where nothing differs across it."""
        drawn = self.drawn is not None and bool(np.any(self.drawn.helix))
        count = FLANK_WIDTHS if self.topography is not None else 2 if drawn else 1
        return self.gear.face_width / 2 * (np.linspace(-1, 1, count) if count > 1 else np.zeros(1))

    def material(self) -> np.ndarray | None:
        """Material (z or 1, 2 flanks, W, R) m on the grid of `widths` and `rolls`, without what has a section of its
        own; None where it is zero everywhere."""
        roll, z = self.rolls, self.widths
        sum_: np.ndarray = np.zeros((1, 2, z.size, roll.size)) + self.profile(roll)
        if self.drawn is not None:
            profile, helix = (values.T[:, :, None, None] for values in (self.drawn.profile, self.drawn.helix))
            sum_ = sum_ + profile * self._height(roll) / 2 + helix * (z / self.gear.face_width)[:, None]
        if self.topography is not None:
            sum_ = sum_ + self.topography.grid(self.gear.teeth, roll, z)
        if np.all(sum_ == sum_[:1]):
            sum_ = sum_[:1]
        return sum_ if np.any(sum_) else None

    def whole(self, z: np.ndarray) -> np.ndarray:
        """Material (z or 1, 2 flanks, len(z), R) m at places across the width (m) and on `rolls`: all that is said,
        parabolic tip relief and lead too."""
        roll, own, lead = self.rolls, self.material(), _lead_section(0, self.gear)
        whole = np.zeros((1, 2, z.size, roll.size))
        if own is not None:
            places = np.interp(z, self.widths, np.arange(self.widths.size))
            low = np.minimum(places.astype(int), max(self.widths.size - 2, 0))
            part = (places - low)[:, None]
            high = np.minimum(low + 1, self.widths.size - 1)
            whole = whole + (1 - part) * own[:, :, low] + part * own[:, :, high]
        if lead:
            x = np.linspace(-1, 1, FLANK_WIDTHS) * self.gear.face_width / 2
            whole = whole - np.array([np.interp(z, x, side) for side in lead["lead0"]])[None, :, :, None]
        relief = self.gear.tip_relief
        if relief is not None and relief.kind == "parabolic":
            whole = whole - relief_at(roll, relief.amount, relief.start_roll, self.shape.s_a)
        return whole

    @property
    def any(self) -> bool:
        """Whether there is anything to see: flanks or places of teeth that are not nominal."""
        gear = self.gear
        return bool(self.index().any() or self.material() is not None or gear.lead or gear.tip_relief)

    @property
    def span(self) -> float:
        """From the lowest to the highest of all flanks (m), leads included."""
        material, lead = self.material(), _lead_section(0, self.gear)
        whole = 0.0 if material is None else float(np.ptp(material))
        return whole + float(np.ptp(lead["lead0"]) if lead else 0.0)


def deviation_sections(index: int, gear: ToothedBody, shape: GearShape) -> dict[str, np.ndarray]:
    """Sections of gear `index`: depth by tooth, flank, place across the width and roll; index deviations as angles;
    lead; what does not run true. None where there is nothing to say."""
    field = FlankField(gear, shape)
    sections: dict[str, np.ndarray] = {}
    if (angles := field.index() / shape.r).any():
        sections[f"index{index}"] = angles
    if (material := field.material()) is not None:
        teeth, _, places, rolls = material.shape
        sections[f"flank_size{index}"] = np.array([teeth, places, rolls], np.int32)
        sections[f"flank{index}"] = -material
    if gear.eccentricity is not None or gear.wobble is not None:
        sections[f"runout{index}"] = np.array([*_vector(gear.eccentricity), *_lean(gear.wobble)])
    return sections | _lead_section(index, gear)


def _vector(polar: Eccentricity | Wobble | None) -> tuple[float, float]:
    """x, y of an amount in a direction."""
    return (polar.amount * math.cos(polar.angle), polar.amount * math.sin(polar.angle)) if polar else (0.0, 0.0)


def _lean(wobble: Wobble | None) -> tuple[float, float]:
    """Rotations (rad) about x and y that lean an axis towards a direction: e_z + (x, y) is e_z turned by (−y, x)."""
    x, y = _vector(wobble)
    return -y, x


def _lead_section(index: int, gear: ToothedBody) -> dict[str, np.ndarray]:
    """Depth (2 flanks, FLANK_WIDTHS) m across the face width, in the transverse section; no section without
    modifications."""
    if gear.lead is None:
        return {}
    x = np.linspace(-1, 1, FLANK_WIDTHS)
    depth = gear.lead.crowning * x**2
    if gear.lead.end_relief is not None:
        relief = gear.lead.end_relief
        into = np.clip(1 - (1 - np.abs(x)) * gear.face_width / 2 / relief.length, 0, None)
        depth = depth + relief_depth(relief.kind, relief.amount, relief.length, into)
    turned = gear.lead.slope * x / 2
    return {f"lead{index}": np.stack([depth - turned, depth + turned])}
