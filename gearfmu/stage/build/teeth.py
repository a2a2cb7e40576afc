"""What the model blob says of a gear's teeth, and whether a reduced body is that gear's own."""

from __future__ import annotations

import math

import numpy as np

from gearfmu.body.body import Flank
from gearfmu.spec.forms.general import RingBody
from gearfmu.spec.forms.shapes import GearShape
from gearfmu.spec.tables.gear import GearSpec
from gearfmu.stage.build.fields import gear_numbers

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
