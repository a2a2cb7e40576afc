"""Bodies whose finite elements are taken as a whole: the carrier of a planetary set and the housing of a stage, with
sensors and a skin."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from gearfmu.body.body import Body, How, Node, Sensors, Skin
from gearfmu.body.toothed import named
from gearfmu.errors import MeshError
from gearfmu.fem.factor import FactorError
from gearfmu.fem.lanczos import ModesError
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.femesh.quality import mesh_report
from gearfmu.reduction.carrier import carrier_full_order, carrier_mesh_error, carrier_need
from gearfmu.reduction.cyclic.frf import FrfError
from gearfmu.reduction.cyclic.modal import Progress
from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.imported.carrier import imported_carrier
from gearfmu.reduction.imported.gear import hinge_problem
from gearfmu.reduction.imported.housing import ImportedHousing, imported_housing
from gearfmu.reduction.imported.superelement import superelement
from gearfmu.reduction.memory import lower_counts, require_memory
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import Size, static_response
from gearfmu.reduction.oscillators import oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer
from gearfmu.stagefile.forms.planetary import CarrierBody
from gearfmu.stagefile.forms.shapes import carrier_geometry
from gearfmu.stagefile.tables.housing import HousingBody

LINES = 60  # of the frequencies at which the error of a housing is measured


def reduced_carrier(carrier: CarrierBody, progress: Progress | None = None) -> Body:
    """The carrier of a set, reduced as its file says. Raises MeshError."""
    started, tell = time.process_time(), named(progress, "carrier")
    tell("mesh and finite elements", 0.0)
    if carrier.imported is None:
        need = carrier_need(carrier)
        require_memory(need, lower_counts(carrier.mesh, "carrier.mesh"))
        tell(f"error of the mesh, {need.text}", 0.0)
        facts = _carrier_facts(carrier)
        tell("finite elements", 0.3)
        full = carrier_full_order(carrier)
        mesh = {**facts, "dof_body": full.size}
    else:
        full, mesh = imported_carrier(carrier)
        _check_solid(full, carrier.imported.file)
    tell(carrier.method, 0.5)
    how = How.of(carrier, carrier.method, mesh)
    body = whole_body(full, how, Size(carrier.modes), Judging.over(damping_ratio=carrier.modal_damping))
    return replace(body, how=how.since(started))


def _check_solid(full: FullOrder, file: str) -> None:
    """MeshError where finite elements made elsewhere are no solid."""
    try:
        problem = hinge_problem(elastic(full))
    except (FactorError, ModesError) as error:
        problem = f"the stiffness matrix cannot be factorised ({error}): it is not of one free solid body"
    if problem:
        raise MeshError(f"{file}: {problem}")


def whole_body(full: FullOrder, how: How, size: Size, judging: Judging, found: ImportedHousing | None = None) -> Body:
    """The body of finite elements taken as a whole: a carrier, a housing. size: of the basis that `how.method` makes;
    judging: lines at which it is compared, and its modal damping; found: of a housing, what is read of it and never
    loaded. Raises BodyError."""
    basis = METHODS[how.method](full, size)
    model = oscillators(full, basis, judging.damping_ratio)
    exact = reference(full, judging)
    error = relative_error(exact.matrix, transfer(model, judging, full.ground, residual=True))
    band = float(judging.frequency[0]), float(judging.frequency[-1])
    spans, shapes = {} if found is None else found.spans, basis @ model.turn
    return Body(
        name=full.name,
        how=how,
        mass=model.rigid_mass,
        frequency=model.frequency,
        damping_ratio=model.damping_ratio,
        nodes=tuple(Node(i.name, i.kind, i.components, i.point, spans.get(i.name)) for i in full.interfaces),
        rows=model.rows,
        static=model.static,
        error=FrfError.of(judging.frequency, error, band, full.length, full.ground),
        sensors=_sensed(found, full, shapes) if found is not None and found.sensors else None,
        skin=_skin(found, full, shapes) if found is not None and found.surface is not None else None,
    )


def _sensed(found: ImportedHousing, full: FullOrder, shapes: np.ndarray) -> Sensors:
    """Sensors of a body whose oscillators have the `shapes` (N, n)."""
    rows = sp.csr_array(sp.vstack([sensor.rows for sensor in found.sensors]))
    static = (rows @ static_response(full)) * full.scales()
    points = np.array([sensor.point for sensor in found.sensors])
    return Sensors(tuple(sensor.name for sensor in found.sensors), points, rows @ shapes, static)


def _skin(found: ImportedHousing, full: FullOrder, shapes: np.ndarray) -> Skin:
    surface, rows = found.surface, found.skin
    assert surface is not None and rows is not None
    moved = np.hstack([rows @ full.rigid, rows @ shapes]).T
    return Skin(surface.points.astype("f4"), surface.faces, moved.reshape(-1, len(surface.points), 3).astype("f4"))


def _carrier_facts(carrier: CarrierBody) -> dict[str, Any]:
    """Plain facts about our own mesh of a carrier, its error measured on a finer one."""
    facts = mesh_report(carrier_sector(carrier_geometry(carrier), carrier.mesh))
    counts, error = carrier.mesh.model_dump(), carrier_mesh_error(carrier)
    return {**facts, "dof_sector": facts["dof"], "counts": counts, "frequency_error": error}


def reduced_housing(housing: HousingBody, progress: Progress | None = None) -> Body:
    """The housing of a stage, reduced as its file says. Raises MeshError and BodyError."""
    started, tell = time.process_time(), named(progress, housing.name)
    tell("mesh and finite elements", 0.0)
    found = housing_order(housing)
    method = "modal" if housing.reduced else housing.method  # all modes of a superelement, which are not many
    tell(f"{method}, {found.full.size} unknowns", 0.1)
    holes = {} if found.surface is None else {"holes_of_the_skin": found.surface.holes}
    how = How.of(housing, method, found.facts | holes)
    judging = Judging.over(lines=LINES, damping_ratio=housing.modal_damping)
    body = whole_body(found.full, how, Size(housing.modes), judging, found)
    return replace(body, how=how.since(started))


def housing_order(housing: HousingBody) -> ImportedHousing:
    """A housing before reduction, or as it was reduced elsewhere. Raises MeshError."""
    return superelement(housing) if housing.reduced else imported_housing(housing)
