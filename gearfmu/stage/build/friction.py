"""Friction of the flanks: what a stage file says → starts of the kernel's parameters."""

from __future__ import annotations

from gearfmu.spec.forms.general import Stage

LAWS = ("constant", "benedict_kelley", "iso_tr_14179")  # in the kernel's order


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
