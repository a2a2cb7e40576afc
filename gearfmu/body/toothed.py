"""The reduced body of an external or internal gear, meshed here or elsewhere: modes, static tables, error, pictures."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearfmu.body.body import Body, Flank, How, Node, Picture, Sensors, Tangent
from gearfmu.body.former import GEAR_METHOD
from gearfmu.body.pictures import drawn_outline, pictured_loads, sector_picture, whole_picture
from gearfmu.errors import MeshError
from gearfmu.fem.factor import FactorError
from gearfmu.fem.lanczos import ModesError
from gearfmu.femesh.quality import mesh_report
from gearfmu.femesh.sector import gear_sector
from gearfmu.reduction.cyclic.flank import Points, ToothFlank, tooth_flank
from gearfmu.reduction.cyclic.frf import FrfCase, FrfError, frf_error
from gearfmu.reduction.cyclic.modal import Modes, Progress, elastic_modes
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics, static_tables
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.reduction.imported.gear import CheckedGear, checked_gear, hinge_problem, loaded_gear
from gearfmu.reduction.imported.mean_tooth import WholeGear, mean_frf, mean_modes, mean_statics
from gearfmu.reduction.memory import gear_need, lower_counts, require_memory
from gearfmu.stagefile.forms.general import ToothedBody
from gearfmu.stagefile.forms.shapes import gear_shape

FRF_CUT = 120e3  # Hz, the cut of level `standard`
_SHARES = ((0.1, 0.6), (0.6, 0.8), (0.8, 1.0))  # of the work: modes, static tables, error
_OFFSETS = 3  # the kernel reads tooth offsets −3 … 3


@dataclass(frozen=True)
class Parts:
    """A reduced gear without its names and numbers: modes, static tables, error, plain facts of the mesh, pictures,
    mass matrix (6, 6) of the rigid body, of a ring the sensor on its rim."""

    modes: Modes
    statics: Statics
    error: FrfError
    facts: dict[str, Any]
    picture: Picture
    inertia: np.ndarray
    sensors: Sensors | None = None


def reduced_gear(gear: ToothedBody, progress: Progress | None = None) -> Body:
    """The reduced body of an external or internal gear. Raises MeshError."""
    started, report = time.process_time(), named(progress, gear.name)
    report("mesh and finite elements", 0.0)
    made = _meshed_here(gear, report) if gear.imported is None else _meshed_elsewhere(gear, report)
    flank = flank_of(gear.teeth, tooth_flank(gear_shape(gear), gear), made.modes, made.statics)
    name, kind = "rim" if flank.internal else "bore", "rigid" if gear.rigid_bore else "averaging"
    return Body(
        name=gear.name,
        mass=symmetric_mass(made.inertia),
        how=How.of(gear, GEAR_METHOD, made.facts).since(started),
        frequency=made.modes.frequency,
        damping_ratio=np.full(len(made.modes.frequency), gear.modal_damping),
        nodes=(Node(name, kind, COMPONENTS, np.zeros(3)),),
        rows=made.modes.bore_rows,
        static=made.statics.static_bb,
        error=replace(made.error, ground=(name,)),
        flank=flank,
        spin=made.modes.spin,
        picture=made.picture,
        sensors=made.sensors,
    )


def named(progress: Progress | None, name: str) -> Progress:
    """Progress of the body `name`, also where no one asks for it."""
    return (lambda what, share: progress(f"{name}: {what}", share)) if progress else (lambda what, share: None)


def _meshed_here(gear: ToothedBody, report: Progress) -> Parts:
    """A gear meshed here, by its sector."""
    geometry = gear_shape(gear)
    sector = gear_sector(geometry, gear.face_width, gear.body.mesh)
    need = gear_need(sector, gear.body)
    require_memory(need, lower_counts(gear.body.mesh, "body.mesh"))
    report(f"finite elements, {need.text}", 0.0)
    body = SectorBody(sector, gear.material, *tooth_flank(geometry, gear), gear.rigid_bore)
    return _by_sector(gear, body, _mesh_facts(body, gear), report)


def _mesh_facts(body: SectorBody, gear: ToothedBody) -> dict[str, Any]:
    facts = mesh_report(body.mesh, body.flank.r_b, gear.body.strip_half_width)
    sector_dofs = 3 * (len(body.mesh.nodes) - len(body.mesh.cut_plus))
    return {
        **facts,
        "counts": gear.body.mesh.model_dump(),
        "dof_sector": sector_dofs,
        "dof_body": body.teeth * sector_dofs,
    }


def _by_sector(gear: ToothedBody, body: SectorBody, facts: dict[str, Any], report: Progress) -> Parts:
    """A gear reduced by cyclic symmetry."""
    for_modes, for_tables, for_error = (_within(report, *share) for share in _SHARES)
    geometry = gear_shape(gear)
    surface, pictured = drawn_outline(geometry, gear.face_width, body.mesh.nodes), pictured_loads(body.points)
    modes = elastic_modes(body, gear.body.modes, for_modes, surface.sample)
    statics = static_tables(body, pictured, for_tables)
    frf = frf_error(body, modes, statics, FrfCase(gear.modal_damping, FRF_CUT, geometry.r), for_error)
    picture = sector_picture(surface, body, modes, statics)
    return Parts(modes, statics, frf, facts, picture, body.inertia, rim_sensor(body, modes))


def _within(report: Progress, first: float, last: float) -> Progress:
    """Progress of a part of the work as progress of the whole."""
    return lambda what, share: report(what, first + (last - first) * share)


def rim_sensor(body: SectorBody, modes: Modes) -> Sensors | None:
    """The patch of a ring's rim in sector 0; None of an external gear."""
    return Sensors(("rim",), body.patch_point[None], modes.patch_rows) if body.internal else None


def flank_of(teeth: int, load_points: tuple[ToothFlank, Points], modes: Modes, statics: Statics) -> Flank:
    """The flank of a body: its geometry and load points, rows of the modes and static tables at them."""
    flank, points = load_points
    return Flank(
        teeth=teeth,
        internal=flank.internal,
        r_b=flank.r_b,
        psi_b=flank.psi_b,
        beta_b=flank.base_helix_angle,
        face_width=flank.face_width,
        strip_half_width=flank.strip_half_width,
        roll_range=np.array(flank.roll_range),
        roll=points.rolls,
        diameter=modes.nodal_diameter,
        part=modes.part,
        parity=modes.parity,
        rows=modes.flank_rows.reshape(2, len(points.rolls), points.functions, -1),
        static=kept_offsets(statics.static_ff),
        node=statics.static_fb,
        tangent=tangent_of(modes, statics, points),
    )


def kept_offsets(static_ff: np.ndarray) -> np.ndarray:
    """Of the table (2, 2, z, …) of all tooth offsets those that the kernel reads (2, 2, 7, …)."""
    if static_ff.shape[2] <= 2 * _OFFSETS + 1:
        return static_ff
    return np.concatenate([static_ff[:, :, : _OFFSETS + 1], static_ff[:, :, -_OFFSETS:]], axis=2)


def tangent_of(modes: Modes, statics: Statics, points: Points) -> Tangent | None:
    """Rows and tables of the loads along the profile; None where none were made."""
    if statics.static_tt is None or statics.static_nt is None or modes.tangent_rows is None:
        return None
    rows = modes.tangent_rows.reshape(2, len(points.rolls), points.functions, -1)
    return Tangent(rows, statics.static_nt, statics.static_tt)


def symmetric_mass(inertia: np.ndarray) -> np.ndarray:
    """Mass matrix (6, 6) of a body of equal sectors about its middle: mass and inertia alone."""
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = inertia[0, 0] * np.eye(3), inertia[3:, 3:]
    return mass


def _meshed_elsewhere(gear: ToothedBody, report: Progress) -> Parts:
    """A gear from finite elements made elsewhere, by its sector or its mean tooth."""
    found = checked_gear(gear)
    body = loaded_gear(found, gear)
    try:
        if isinstance(body, SectorBody):
            return _by_sector(gear, body, found.facts, report)
        return _by_mean_tooth(gear, body, found, report)
    except (FactorError, ModesError) as error:
        raise MeshError(
            f"{found.mesh.source}: the stiffness matrix cannot be factorised ({error}): it is singular beyond the six "
            "rigid motions (a hinge, a loose part), or not of a free body"
        ) from error


def _by_mean_tooth(gear: ToothedBody, whole: WholeGear, found: CheckedGear, report: Progress) -> Parts:
    """A gear reduced as a whole, brought to the form of a cyclic one."""
    space, geometry = Elastic(whole.body), gear_shape(gear)
    if problem := hinge_problem(space):
        raise MeshError(f"{found.facts['file']}: {problem}")
    modes, left = mean_modes(whole, space, gear.body.modes, report)
    statics, deviation = mean_statics(whole, space, pictured_loads(whole.points), report)
    report("frequency response", 0.0)
    frf = mean_frf(whole, space, modes, statics, FrfCase(gear.modal_damping, FRF_CUT, geometry.r))
    facts = found.facts | {"teeth_deviation": deviation, "compliance_left_to_residual": left}
    nodes = found.mesh.nodes
    picture = whole_picture(drawn_outline(geometry, gear.face_width, nodes), nodes, whole, statics)
    return Parts(modes, statics, frf, facts, picture, whole.inertia)
