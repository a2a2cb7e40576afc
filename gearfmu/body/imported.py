"""A gear body from finite elements made elsewhere: the same parts as of a gear meshed here."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from gearfmu.body.body import Picture, whole_surface
from gearfmu.body.parts import (
    DRAWN,
    Parts,
    outline,
    pictured_loads,
    rim_sensor,
    sector_picture,
    tooth_flank,
)
from gearfmu.errors import BodyError, MeshError
from gearfmu.fem.factor import FactorError
from gearfmu.fem.lanczos import ModesError
from gearfmu.femesh import FeMesh, sector_mesh
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.reduction.cyclic.frf import FrfCase, frf_error
from gearfmu.reduction.cyclic.modal import Progress, elastic_modes
from gearfmu.reduction.cyclic.statics import Statics, static_tables
from gearfmu.reduction.elastic import Elastic, elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.carrier import imported_carrier
from gearfmu.reduction.imported.gear import (
    BORE,
    CheckedGear,
    ImportedGear,
    Wanted,
    checked_gear,
    hinge_problem,
    imported_gear,
)
from gearfmu.reduction.imported.mean_tooth import WholeGear, mean_frf, mean_modes, mean_statics
from gearfmu.reduction.imported.sector import ImportedSector
from gearfmu.reduction.imported.whole import Held, imported_gear_order
from gearfmu.stagefile.forms.general import RingBody, ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierBody, MountsSpec
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.tables.imported import ImportSpec, RingImportSpec


def check_gear(gear: ToothedBody) -> CheckedGear:
    """The imported finite elements of a gear, read, checked and placed. Raises MeshError."""
    files = _files(gear)
    if gear.helix_angle:
        raise MeshError(f"{files.file}: finite elements made elsewhere are read for spur gears only")
    return checked_gear(files, _wanted(gear))


def _files(gear: ToothedBody) -> ImportSpec | RingImportSpec:
    assert gear.imported is not None
    return gear.imported


def _wanted(gear: ToothedBody) -> Wanted:
    geometry = gear_shape(gear)
    internal = isinstance(geometry, InternalGearGeometry)
    flank, points = tooth_flank(geometry, gear, internal)
    held = gear.rim_diameter if isinstance(gear, RingBody) else gear.bore_diameter
    return Wanted(geometry.z, flank, points, 0.5 * held, gear.material, gear.body.modes)


def imported_full_order(gear: ToothedBody, mounts: MountsSpec | None = None) -> FullOrder:
    """The whole imported gear or ring before reduction, for every method: interfaces tooth0 … and bore, or on its
    mounts. Raises MeshError."""
    found, wanted, files = check_gear(gear), _wanted(gear), _files(gear)
    held = Held(gear.name, gear_shape(gear).r, files.bore_coupling, mounts)
    try:
        return imported_gear_order(found, wanted, held)
    except MeshError as error:
        raise MeshError(f"{files.file}: {error}") from error


def imported_sector_mesh(gear: ToothedBody) -> FeMesh:
    """The sector mesh of an imported gear, as of one meshed here, for pictures. BodyError where there is none: mean
    tooth, tetrahedra, ready-made matrices."""
    found = check_gear(gear)
    cut = found.cut
    if cut is None or set(cut.elements) != {"hexahedron20"} or found.matrices is not None:
        raise BodyError(
            f"{_files(gear).file}: this needs hexahedra, our own matrices and a mesh that repeats itself "
            "from tooth to tooth; "
            "use the pictures of your own finite-element program"
        )
    bore = np.flatnonzero(np.isin(cut.of_mesh, found.mesh.sets[BORE]))
    sets = {"rim" if isinstance(gear, RingBody) else BORE: bore}
    return FeMesh(cut.nodes, cut.elements["hexahedron20"], sets, gear.teeth, cut.cut_minus, cut.cut_plus)


def imported_carrier_order(carrier: CarrierBody) -> tuple[FullOrder, dict[str, Any]]:
    """The imported carrier of a planetary set before reduction, known to be one solid, and plain facts. MeshError."""
    found, source = imported_carrier(carrier), carrier.imported
    assert source is not None
    problem, space = None, elastic(found.full)
    try:
        problem = hinge_problem(space, float(space.modes(1)[0][0]))
    except (FactorError, ModesError) as error:
        problem = f"the stiffness matrix cannot be factorised ({error}): it is not of one free solid body"
    if problem:
        raise MeshError(f"{source.file}: {problem}")
    return found.full, found.facts


def imported_parts(gear: ToothedBody, cut: float, report: Progress) -> Parts:
    """Modes, static tables, error and pictures of an imported gear. cut : Hz, of the stored error. Raises MeshError."""
    geometry, files = gear_shape(gear), _files(gear)
    found = imported_gear(files, _wanted(gear))
    case = FrfCase(gear.modal_damping, cut, geometry.r)
    drawn = sector_mesh(geometry, gear.face_width, DRAWN)
    try:
        if isinstance(found.body, ImportedSector):
            return _by_sector(found, gear, case, (drawn, report))
        return _by_mean_tooth(found, gear.body.modes, case, (drawn, report))
    except (FactorError, ModesError) as error:
        raise MeshError(
            f"{files.file}: the stiffness matrix cannot be factorised ({error}): it is singular "
            "beyond the six rigid "
            "motions (a hinge, a loose part), or not of a free body"
        ) from error


def _by_sector(found: ImportedGear, gear: ToothedBody, case: FrfCase, drawing: tuple[Any, Progress]) -> Parts:
    body, (drawn, report) = found.body, drawing
    assert isinstance(body, ImportedSector)
    surface = outline(drawn, body.mesh.nodes)
    modes = elastic_modes(body, gear.body.modes, report, surface.sample)
    statics = static_tables(body, pictured_loads(body.points), report)
    report("frequency response", 0.0)
    frf = frf_error(body, modes, statics, case)
    picture = sector_picture(surface, body, modes, statics)
    return Parts(modes, statics, frf, found.facts, picture, body.inertia, rim_sensor(body, modes))


def _by_mean_tooth(found: ImportedGear, count: int, case: FrfCase, drawing: tuple[Any, Progress]) -> Parts:
    gear, (drawn, report) = found.body, drawing
    assert isinstance(gear, WholeGear)
    space = Elastic(gear.body)
    if problem := hinge_problem(space, float(space.modes(1)[0][0])):
        raise MeshError(f"{found.facts['file']}: {problem}")
    modes, left = mean_modes(gear, space, count, report)
    statics, deviation = mean_statics(gear, space, pictured_loads(gear.points), report)
    report("frequency response", 0.0)
    frf = mean_frf(gear, space, modes, statics, case)
    facts = found.facts | {"teeth_deviation": deviation, "compliance_left_to_residual": left}
    return Parts(modes, statics, frf, facts, _whole_picture(drawn, found, statics), gear.inertia)


def _whole_picture(drawn: Any, found: ImportedGear, statics: Statics) -> Picture:
    """Pictures on the drawn surface: every point moves like the nearest node of the whole mesh."""
    gear = found.body
    assert isinstance(gear, WholeGear)
    sector = outline(drawn, found.nodes)
    points, quads = whole_surface(sector, gear.teeth)
    kept = np.unique(gear.body.node_of_dof[gear.body.node_of_dof < len(found.nodes)])
    nearest = cKDTree(found.nodes[kept]).query(points)[1]
    dofs = 3 * nearest[:, None] + np.arange(3)
    pictured = pictured_loads(gear.points)
    loads = np.array([picture[dofs] for picture in statics.pictures], "f4")
    rolls = gear.points.rolls[[load // gear.points.functions for load in pictured]]
    return Picture(points.astype("f4"), quads, loads, rolls)
