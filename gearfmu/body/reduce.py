"""From a stage's numbers to its reduced bodies: mesh, finite elements, reduction, file; skipped when the hash
matches."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.body.apart import Job, Work, reduce_apart_together, side_by_side
from gearfmu.body.imported import imported_parts
from gearfmu.body.layout import ALGORITHM_VERSION
from gearfmu.body.parts import (
    Parts,
    drawn_counts,
    kept_offsets,
    pictured_loads,
    rim_of,
    sector_display,
    sector_shapes,
    tangent_of,
    tooth_flank,
)
from gearfmu.body.provenance import provenance
from gearfmu.body.reduced import ReducedBody
from gearfmu.body.stale import refuse_stale
from gearfmu.body.store import load_body, save_body
from gearfmu.errors import BodyError, MeshError
from gearfmu.femesh import mesh_report, sector_mesh
from gearfmu.geometry import GearGeometry
from gearfmu.geometry.internal import InternalGearGeometry
from gearfmu.reduction.display import outline
from gearfmu.reduction.flank import Points, ToothFlank
from gearfmu.reduction.frf import FrfCase, frf_error
from gearfmu.reduction.memory import gear_need, lower_counts, require_memory
from gearfmu.reduction.modal import elastic_modes
from gearfmu.reduction.sector import SectorBody
from gearfmu.reduction.statics import static_tables
from gearfmu.spec.body import body_hash, body_inputs, gear_table
from gearfmu.spec.general import GeneralStage, gear_as_pair
from gearfmu.spec.library import model_folder
from gearfmu.spec.planetary import RingSpec
from gearfmu.spec.stage import StageSpec, require_pair

FRF_CUT = 120e3  # Hz, the cut of level `standard`
Progress = Callable[[str, float], None]
Geometry = GearGeometry | InternalGearGeometry
Stage = StageSpec | GeneralStage


def expected_hash(spec: StageSpec, gear_index: int) -> str:
    """Fingerprint a body of this gear must carry: its inputs and the version of the algorithms."""
    return body_hash({**body_inputs(spec, gear_index), "algorithm_version": ALGORITHM_VERSION})


def stage_hashes(spec: Stage) -> tuple[str, ...]:
    """`expected_hash` of every gear of a stage."""
    return tuple(expected_hash(own, index) for own, index in gears_of(spec))


def body_path(spec: StageSpec, gear_index: int, folder: str | os.PathLike[str] | None = None) -> Path:
    """Where the body of a gear lies: `<folder>/<gear name>.h5`, the folder of the stage file when None."""
    home = Path(folder) if folder is not None else model_folder(spec)
    return home / f"{spec.gears[gear_index].name}.h5"


def load_stage_bodies(spec: Stage, folder: str | os.PathLike[str] | None = None) -> list[ReducedBody]:
    """The stored bodies of a stage, in the order of its gears. Raises BodyError when one is missing, damaged or
    stale."""
    bodies = []
    for own, index in gears_of(spec):
        path = body_path(own, index, folder)
        body = load_body(path)
        refuse_stale(path, body, expected_hash(own, index), spec.source)
        bodies.append(body)
    return bodies


def reduce_stage(
    spec: Stage,
    out_dir: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> list[ReducedBody]:
    """Reduce every gear of a stage and store it; a stored body whose input hash matches is read instead. Shafts need no
    file. Two large gears are reduced at the same time where processors and memory are there.

    out_dir : folder of the .h5 files, that of the stage file when None. force : reduce in any case.
    progress : called with (what is being done, share done of it). Raises MeshError and BodyError.
    """
    gears = [(own, index, body_path(own, index, out_dir)) for own, index in gears_of(spec)]
    bodies = {path: None if force else _stored(path, expected_hash(own, index)) for own, index, path in gears}
    missing = [(own, index, path) for own, index, path in gears if bodies[path] is None]
    together = _together(missing)
    if together:
        reduce_apart_together(together, progress)
        bodies |= {path: load_body(path) for *_, path in together}
    for own, index, path in missing:
        if bodies[path] is None:
            save_body(reduce_gear(own, index, progress), path)
            bodies[path] = load_body(path)  # rounded as the file is
    return [body for body in bodies.values() if body is not None]


def _together(jobs: list[tuple[Any, int, Path]]) -> list[Job]:
    """The gears that are worth processes of their own (`side_by_side`)."""
    works = [gear_work(own.gears[index], gear_geometry(own, index)) for own, index, _ in jobs]
    return side_by_side(list(zip(works, jobs, strict=True)))


def gear_work(gear: Any, geometry: Geometry) -> Work | None:
    """What the reduction of a gear meshed here takes; None of one meshed elsewhere."""
    if getattr(gear, "imported", None):
        return None
    return Work(gear_need(sector_mesh(geometry, gear.face_width, gear.body.mesh), gear.body), geometry.z)


def gears_of(spec: Stage) -> list[tuple[Any, int]]:
    """Every gear as (pair it stands in, its number there): of a general stage each for itself, whatever it meshes
    with."""
    if isinstance(spec, GeneralStage):
        return [(gear_as_pair(spec, gear.name), 0) for gear in spec.gears]
    require_pair(spec)
    return [(spec, index) for index in range(len(spec.gears))]


def reduce_gear(spec: StageSpec, gear_index: int, progress: Progress | None = None) -> ReducedBody:
    """One gear's reduced body from the stage's numbers. Raises MeshError with the gear's name."""
    gear = spec.gears[gear_index]
    try:
        geometry = gear_geometry(spec, gear_index)
        return reduced_gear(gear, geometry, expected_hash(spec, gear_index), progress)
    except MeshError as error:
        raise MeshError(f"{spec.source}: {gear_table(spec, gear.name)}: {error}") from error


def gear_geometry(spec: Any, gear_index: int) -> Geometry:
    """The geometry of a gear of a pair, or of a gear or ring of a general stage as a pair."""
    gear = spec.gears[gear_index]
    if isinstance(gear, RingSpec):
        return InternalGearGeometry.of(gear, spec.pair, hand=1)
    return GearGeometry.of(gear, spec.pair, hand=(1, -1)[gear_index])


def reduced_gear(gear: Any, geometry: Geometry, input_hash: str, progress: Progress | None = None) -> ReducedBody:
    """The reduced body of an external or internal gear, by cyclic symmetry.

    gear : what a spec says about its mesh, material and reduction (GearSpec, SetGearSpec, RingSpec). Raises MeshError.
    """
    report = _named(progress, gear.name)
    started = time.process_time()
    report("mesh and finite elements", 0.0)
    flank, points = tooth_flank(geometry, gear, isinstance(geometry, InternalGearGeometry))
    if getattr(gear, "imported", None):
        made = imported_parts(gear, geometry, FRF_CUT, report)
    else:
        made = _made_here(gear, geometry, (flank, points), report)
    modes, statics = made.modes, made.statics
    return ReducedBody(
        name=gear.name,
        input_hash=input_hash,
        material=gear.material.model_dump(),
        mesh=made.facts,
        provenance=provenance(time.process_time() - started),
        teeth=geometry.z,
        r_b=geometry.r_b,
        psi_b=geometry.psi_b,
        face_width=gear.face_width,
        mass=float(made.inertia[0, 0]),
        inertia=made.inertia[3:, 3:],
        frequency=modes.frequency,
        damping_ratio=np.full(len(modes.frequency), gear.modal_damping),
        nodal_diameter=modes.nodal_diameter,
        part=modes.part,
        parity=modes.parity,
        flank_rows=_by_point(modes.flank_rows, points),
        bore_rows=modes.bore_rows,
        roll_range=np.array(flank.roll_range),
        roll=points.rolls,
        strip_half_width=gear.body.strip_half_width,
        static_ff=kept_offsets(statics.static_ff, whole=bool(getattr(gear, "mounts", None)) and not geometry.beta),
        static_fb=statics.static_fb,
        static_bb=statics.static_bb,
        frf=made.frf,
        display=made.display,
        rim=made.rim,
        tangent=tangent_of(modes, statics, points),
        shapes=made.shapes,
        spin=modes.spin,
        base_helix_angle=geometry.beta_b,
    )


def _made_here(gear: Any, geometry: Geometry, load_points: tuple[ToothFlank, Points], report: Progress) -> Parts:
    """A gear meshed here, reduced by cyclic symmetry."""
    flank, points = load_points
    sector = sector_mesh(geometry, gear.face_width, gear.body.mesh)
    need = gear_need(sector, gear.body)
    require_memory(need, lower_counts(gear.body.mesh, "body.mesh"))
    report(f"finite elements, {need.text}", 0.0)
    rigid = getattr(gear, "rigid_bore", False)  # sun, planet and ring of a set are averaged
    body = SectorBody(sector, gear.material, flank, points, rigid)
    drawn = sector_mesh(geometry, gear.face_width, drawn_counts(geometry, gear.face_width))
    surface = outline(drawn, sector.nodes)
    modes = elastic_modes(body, gear.body.modes, _within(report, 0.1, 0.6), surface.sample)
    statics = static_tables(body, pictured_loads(points), _within(report, 0.6, 0.8))
    case = FrfCase(gear.modal_damping, FRF_CUT, geometry.r)
    frf = frf_error(body, modes, statics, case, _within(report, 0.8, 1.0))
    display = sector_display(surface, body, statics)
    rim = rim_of(body, modes, statics, getattr(gear, "mounts", None))
    shapes = sector_shapes(surface, modes)
    return Parts(modes, statics, frf, _mesh_facts(body, gear), display, body.inertia, rim, shapes)


def is_current(spec: StageSpec, gear_index: int, folder: str | os.PathLike[str] | None = None) -> bool:
    """Is the stored body sound and made from these numbers?"""
    return _stored(body_path(spec, gear_index, folder), expected_hash(spec, gear_index)) is not None


def _stored(path: Path, wanted_hash: str) -> ReducedBody | None:
    """The body in this file if it is sound and not stale."""
    try:
        body = load_body(path)
    except BodyError:
        return None
    return body if body.input_hash == wanted_hash else None


def _named(progress: Progress | None, name: str) -> Progress:
    return (lambda what, share: progress(f"{name}: {what}", share)) if progress else (lambda what, share: None)


def _within(report: Progress, first: float, last: float) -> Progress:
    """Progress of a part of the work as progress of the whole."""
    return lambda what, share: report(what, first + (last - first) * share)


def _by_point(rows: np.ndarray, points: Points) -> np.ndarray:
    return rows.reshape(2, len(points.rolls), points.functions, -1)


def _mesh_facts(body: SectorBody, gear: Any) -> dict[str, Any]:
    facts = mesh_report(body.mesh, body.flank.r_b, gear.body.strip_half_width)
    sector_dofs = 3 * (len(body.mesh.nodes) - len(body.mesh.cut_plus))
    return {
        **facts,
        "counts": gear.body.mesh.model_dump(),
        "dof_sector": sector_dofs,
        "dof_body": body.teeth * sector_dofs,
    }
