"""Friction and squeeze film of the flanks: what a stage file says → starts of the kernel's parameters; and what a film
can stop."""

from __future__ import annotations

import math

from gearfmu.errors import ModelError
from gearfmu.ranges import kernel_number
from gearfmu.spec.forms.general import EngagementSpec, Stage
from gearfmu.spec.forms.shapes import face_width, mesh_shape

REACH = kernel_number("FILM_REACH")  # m: flanks further apart know no film
LAWS = ("constant", "benedict_kelley", "iso_tr_14179")  # of friction, in the kernel's order
NEXT_TO_NONE = 1e-4  # Pa·s: of an engagement that says nothing beside one that does


def friction_starts(stage: Stage) -> dict[str, float]:
    """Parameter → start. Empty where no engagement says anything about friction; else it is on, and an engagement that
    says nothing has none."""
    if not any(mesh.friction for mesh in stage.engagements):
        return {}
    starts = {"effect.friction": 1.0}
    for mesh in stage.engagements:
        prefix = f"{mesh.name}." if len(stage.engagements) > 1 else ""
        own = mesh.friction
        if own is None:
            starts[f"{prefix}friction_coefficient"] = 0.0
            continue
        starts |= {
            f"{prefix}friction_law": float(LAWS.index(own.law)),
            f"{prefix}friction_coefficient": own.coefficient,
            f"{prefix}oil_viscosity": own.viscosity,
            f"{prefix}flank_roughness": own.roughness,
        }
    return starts


def film_starts(stage: Stage) -> dict[str, float]:
    """Parameter → start. Empty where no engagement says anything about a film; else it is on, and an engagement that
    says nothing has oil of next to no viscosity.

    ModelError where friction and film of an engagement name two viscosities: there is one oil."""
    if not any(mesh.film for mesh in stage.engagements):
        return {}
    starts = {"effect.film": 1.0}
    for mesh in stage.engagements:
        prefix = f"{mesh.name}." if len(stage.engagements) > 1 else ""
        rubs = mesh.friction is not None and mesh.friction.law != "constant"
        if mesh.film is None:
            if not rubs:
                starts[f"{prefix}oil_viscosity"] = NEXT_TO_NONE
            continue
        if rubs and mesh.friction is not None and mesh.friction.viscosity != mesh.film.viscosity:
            raise ModelError(
                f"engagement {mesh.name}: friction says oil of {mesh.friction.viscosity:g} Pa·s, film of "
                f"{mesh.film.viscosity:g} Pa·s; state the same viscosity in both"
            )
        starts |= {f"{prefix}oil_viscosity": mesh.film.viscosity, f"{prefix}film_roughness": mesh.film.roughness}
    return starts


def film_stop(stage: Stage, mesh: EngagementSpec) -> float:
    """`film_impulse` of an engagement with a film from REACH on, spur teeth at the pitch point."""
    assert mesh.film is not None
    pair, internal = mesh_shape(stage, mesh), stage.internal(mesh)
    a, b = (gear.r_b for gear in pair.gears)
    first, second = (pair.length * r_b / (b - a if internal else a + b) for r_b in (a, b))
    radius = first * second / (second - first if internal else first + second)
    return film_impulse(REACH, mesh.film.viscosity, mesh.film.roughness, radius, face_width(stage, mesh))


def film_impulse(gap: float, viscosity: float, roughness: float, radius: float, width: float) -> float:
    """∫ c dd from flanks that touch to a gap (m), N·s: momentum that the film takes on the way, docs/theory.md (8r)."""
    gap = min(gap, REACH)
    factor = 3 * math.sqrt(2) * math.pi * viscosity * width * radius**1.5
    far = (REACH + roughness) ** -1.5
    return factor * (2 * roughness**-0.5 - 2 * (gap + roughness) ** -0.5 - gap * far)
