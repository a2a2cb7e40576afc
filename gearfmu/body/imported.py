"""Finite elements made elsewhere, as the tables of a stage ask for them: of gears, rings and carriers."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearfmu.errors import BodyError, MeshError
from gearfmu.fem.factor import FactorError
from gearfmu.fem.lanczos import ModesError
from gearfmu.femesh.mesh import FeMesh
from gearfmu.reduction.cyclic.flank import tooth_flank
from gearfmu.reduction.elastic import elastic
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
from gearfmu.reduction.imported.whole import imported_gear_order
from gearfmu.stagefile.forms.general import RingBody, ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.tables.bodies import MountsSpec
from gearfmu.stagefile.tables.imported import ImportSpec, RingImportSpec


def check_gear(gear: ToothedBody) -> CheckedGear:
    """The imported finite elements of a gear, read, checked and placed. Raises MeshError."""
    files = _files(gear)
    if gear.helix_angle:
        raise MeshError(f"{files.file}: finite elements made elsewhere are read for spur gears only")
    return checked_gear(files, _wanted(gear))


def read_gear(gear: ToothedBody) -> ImportedGear:
    """The imported finite elements of a gear, checked and ready to be reduced. Raises MeshError."""
    return imported_gear(_files(gear), _wanted(gear))


def _files(gear: ToothedBody) -> ImportSpec | RingImportSpec:
    assert gear.imported is not None
    return gear.imported


def _wanted(gear: ToothedBody) -> Wanted:
    geometry = gear_shape(gear)
    flank, points = tooth_flank(geometry, gear)
    held = gear.rim_diameter if isinstance(gear, RingBody) else gear.bore_diameter
    return Wanted(geometry.z, flank, points, 0.5 * held, gear.material, gear.body.modes)


def imported_full_order(gear: ToothedBody, mounts: MountsSpec | None = None) -> FullOrder:
    """The whole imported gear or ring before reduction, for every method: interfaces tooth0 … and bore, or on its
    mounts. Raises MeshError."""
    found, wanted, files = check_gear(gear), _wanted(gear), _files(gear)
    try:
        return imported_gear_order(found, wanted, gear.name, gear_shape(gear).r, files.bore_coupling, mounts)
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
    (full, facts), source = imported_carrier(carrier), carrier.imported
    assert source is not None
    problem, space = None, elastic(full)
    try:
        problem = hinge_problem(space, float(space.modes(1)[0][0]))
    except (FactorError, ModesError) as error:
        problem = f"the stiffness matrix cannot be factorised ({error}): it is not of one free solid body"
    if problem:
        raise MeshError(f"{source.file}: {problem}")
    return full, facts
