"""The reduced body of an external or internal gear: mesh, finite elements, modes and static tables."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from gearfmu.body.apart import Work
from gearfmu.body.body import Body, How, Node
from gearfmu.body.former import GEAR_METHOD
from gearfmu.body.imported import imported_parts
from gearfmu.body.parts import (
    Parts,
    drawn_counts,
    flank_of,
    outline,
    pictured_loads,
    provenance,
    rim_sensor,
    sector_picture,
    tooth_flank,
)
from gearfmu.femesh import mesh_report, sector_mesh
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.reduction.cyclic.flank import Points, ToothFlank
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.reduction.memory import gear_need, lower_counts, require_memory
from gearfmu.stagefile.forms.general import ToothedBody
from gearfmu.stagefile.forms.shapes import GearShape, gear_shape

ORIGIN = np.zeros(3)
FRF_CUT = 120e3  # Hz, the cut of level `standard`
Progress = Callable[[str, float], None]


def gear_work(gear: ToothedBody) -> Work | None:
    """Memory and time for the reduction of a gear meshed here; None of one meshed elsewhere. Raises MeshError."""
    if gear.imported is not None:
        return None
    geometry = gear_shape(gear)
    return Work(gear_need(sector_mesh(geometry, gear.face_width, gear.body.mesh), gear.body), geometry.z)


def reduced_gear(gear: ToothedBody, progress: Progress | None = None) -> Body:
    """The reduced body of an external or internal gear, by cyclic symmetry. Raises MeshError."""
    geometry = gear_shape(gear)
    report = _named(progress, gear.name)
    started = time.process_time()
    report("mesh and finite elements", 0.0)
    flank, points = tooth_flank(geometry, gear, isinstance(geometry, InternalGearGeometry))
    if gear.imported is not None:
        made = imported_parts(gear, FRF_CUT, report)
    else:
        made = _made_here(gear, geometry, (flank, points), report)
    node = Node("rim" if flank.internal else "bore", "rigid" if gear.rigid_bore else "averaging", COMPONENTS, ORIGIN)
    return Body(
        name=gear.name,
        how=replace(How.of(gear, GEAR_METHOD, made.facts), provenance=provenance(time.process_time() - started)),
        mass=symmetric_mass(made.inertia),
        frequency=made.modes.frequency,
        damping_ratio=np.full(len(made.modes.frequency), gear.modal_damping),
        nodes=(node,),
        rows=made.modes.bore_rows,
        static=made.statics.static_bb,
        error=replace(made.error, ground=(node.name,)),
        flank=flank_of(geometry.z, (flank, points), made.modes, made.statics),
        spin=made.modes.spin,
        picture=made.picture,
        sensors=made.sensors,
    )


def symmetric_mass(inertia: np.ndarray) -> np.ndarray:
    """Mass matrix (6, 6) of a body of equal sectors about its middle: mass and inertia alone."""
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = inertia[0, 0] * np.eye(3), inertia[3:, 3:]
    return mass


def _made_here(
    gear: ToothedBody, geometry: GearShape, load_points: tuple[ToothFlank, Points], report: Progress
) -> Parts:
    """A gear meshed here, reduced by cyclic symmetry."""
    flank, points = load_points
    sector = sector_mesh(geometry, gear.face_width, gear.body.mesh)
    need = gear_need(sector, gear.body)
    require_memory(need, lower_counts(gear.body.mesh, "body.mesh"))
    report(f"finite elements, {need.text}", 0.0)
    body = SectorBody(sector, gear.material, flank, points, gear.rigid_bore)
    drawn = sector_mesh(geometry, gear.face_width, drawn_counts(geometry, gear.face_width))
    surface = outline(drawn, sector.nodes)
    modes = elastic_modes(body, gear.body.modes, _within(report, 0.1, 0.6), surface.sample)
    statics = static_tables(body, pictured_loads(points), _within(report, 0.6, 0.8))
    case = FrfCase(gear.modal_damping, FRF_CUT, geometry.r)
    frf = frf_error(body, modes, statics, case, _within(report, 0.8, 1.0))
    picture, facts = sector_picture(surface, body, modes, statics), _mesh_facts(body, gear)
    return Parts(modes, statics, frf, facts, picture, body.inertia, rim_sensor(body, modes))


def _named(progress: Progress | None, name: str) -> Progress:
    return (lambda what, share: progress(f"{name}: {what}", share)) if progress else (lambda what, share: None)


def _within(report: Progress, first: float, last: float) -> Progress:
    """Progress of a part of the work as progress of the whole."""
    return lambda what, share: report(what, first + (last - first) * share)


def _mesh_facts(body: SectorBody, gear: ToothedBody) -> dict[str, Any]:
    facts = mesh_report(body.mesh, body.flank.r_b, gear.body.strip_half_width)
    sector_dofs = 3 * (len(body.mesh.nodes) - len(body.mesh.cut_plus))
    return {
        **facts,
        "counts": gear.body.mesh.model_dump(),
        "dof_sector": sector_dofs,
        "dof_body": body.teeth * sector_dofs,
    }
