"""The reduced housing of a stage: a body with sensors and a skin."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from gearfmu.body.body import Body, How
from gearfmu.body.parts import provenance
from gearfmu.body.whole import Read, whole_body
from gearfmu.reduction.basis import Size
from gearfmu.reduction.imported.housing import ImportedHousing, imported_housing
from gearfmu.reduction.imported.superelement import superelement
from gearfmu.reduction.transfer import Judging
from gearfmu.stagefile.tables.housing import HousingBody

Progress = Callable[[str, float], None]
LINES = 60  # at which the error is measured


def reduced_housing(housing: HousingBody, progress: Progress | None = None) -> Body:
    """The housing of a stage, reduced as its file says. Raises MeshError and BodyError."""
    started, tell = time.process_time(), progress or (lambda what, share: None)
    tell(f"{housing.name}: mesh and finite elements", 0.0)
    found = housing_order(housing)
    method = "modal" if housing.reduced else housing.method  # all modes of a superelement, which are not many
    tell(f"{housing.name}: {method}, {found.full.size} unknowns", 0.1)
    surface = found.surface
    mesh = found.facts | ({} if surface is None else {"holes_of_the_skin": surface.holes})
    how = How.of(housing, method, mesh)
    read = Read(found.sensors) if surface is None else Read(found.sensors, surface.points, surface.faces, found.skin)
    judging = Judging.over(lines=LINES, damping_ratio=housing.modal_damping)
    body = whole_body(found.full, how, Size(housing.modes), judging, read)
    return replace(
        body,
        name=housing.name,
        how=replace(how, provenance=provenance(time.process_time() - started)),
        nodes=tuple(replace(node, span=found.spans.get(node.name)) for node in body.nodes),
    )


def housing_order(housing: HousingBody) -> ImportedHousing:
    """A housing before reduction, or as it was reduced elsewhere. Raises MeshError."""
    return superelement(housing) if housing.reduced else imported_housing(housing)
