"""The reduced housing of a stage: an InterfaceBody with sensors and skin."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gearfmu.body.carrier import Evidence, interface_body
from gearfmu.body.interface_body import InterfaceBody
from gearfmu.body.sensed import Sensors, Skin
from gearfmu.reduction.basis import Basis, Size
from gearfmu.reduction.full_order import FullOrder, Interface
from gearfmu.reduction.imported.housing import ImportedHousing, imported_housing
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.moments import static_response
from gearfmu.reduction.oscillators import Oscillators, Projection, decoupled
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer
from gearfmu.spec.tables.housing import HousingBody

Progress = Callable[[str, float], None]
LINES = 60  # at which the error is measured


def reduced_housing(housing: HousingBody, input_hash: str, progress: Progress | None = None) -> InterfaceBody:
    """The housing of a stage, reduced as its file says. Raises MeshError and BodyError."""
    started, tell = time.process_time(), progress or (lambda what, share: None)
    tell(f"{housing.name}: mesh and finite elements", 0.0)
    found = imported_housing(housing)
    tell(f"{housing.name}: {housing.method}, {found.full.size} unknowns", 0.1)
    basis = METHODS[housing.method](found.full, Size(housing.modes))
    read = _read(found, basis, housing.modal_damping)
    tell(f"{housing.name}: frequency response", 0.6)
    judging = Judging.over(lines=LINES, damping_ratio=housing.modal_damping)
    exact = reference(found.full, judging)
    error = relative_error(exact.matrix, transfer(read.model, judging, found.full.ground, residual=True))
    made = {
        "mesh": found.facts | ({} if found.surface is None else {"holes_of_the_skin": found.surface.holes}),
        "started": started,
        "input_hash": input_hash,
        "material": housing.material.model_dump(),
    }
    body = interface_body(found.full, read.model, Evidence(judging.frequency, error), made)
    spans = [entry | {"span": list(found.spans[entry["name"]])} for entry in body.interfaces]
    return replace(body, name=housing.name, interfaces=tuple(spans), sensors=read.sensors, skin=read.skin)


@dataclass(frozen=True)
class _Read:
    """The reduced body, and what it moves."""

    model: Oscillators
    sensors: Sensors | None
    skin: Skin | None


def _read(found: ImportedHousing, basis: Basis, damping_ratio: float) -> _Read:
    """Oscillators with the rows of interfaces, sensors and skin: all of them in one projection."""
    full, more = found.full, list(found.sensors)
    if found.surface is not None and found.skin is not None:
        labels = tuple(f"u{k}" for k in range(found.skin.shape[0]))
        more.append(Interface("skin", found.skin, labels, np.zeros(3), "nodes"))
    wide: FullOrder = replace(full, interfaces=(*full.interfaces, *more))
    rows, m, felt = wide.rows(), full.rows().shape[0], 3 * len(found.sensors)
    static = (rows[: m + felt] @ static_response(full)) * full.scales()
    own = 0.5 * (static[:m] + static[:m].T)
    projected = basis.vectors.T @ (full.stiffness @ basis.vectors)
    all_of_it = decoupled(wide, Projection(basis.method, projected, rows @ basis.vectors, own), damping_ratio)
    model = replace(
        all_of_it,
        rows=all_of_it.rows[:m],
        labels=all_of_it.labels[:m],
        scales=all_of_it.scales[:m],
        rigid_rows=all_of_it.rigid_rows[:m],
    )
    sensed, seen = slice(m, m + felt), slice(m + felt, None)
    return _Read(model, _sensors(found, all_of_it, sensed, static[m:]), _skin(found, all_of_it, seen))


def _sensors(found: ImportedHousing, model: Oscillators, own: slice, static: np.ndarray) -> Sensors | None:
    if not found.sensors:
        return None
    return Sensors(
        names=tuple(sensor.name for sensor in found.sensors),
        points=np.array([sensor.point for sensor in found.sensors]),
        rigid_rows=model.rigid_rows[own],
        rows=model.rows[own],
        static=static,
    )


def _skin(found: ImportedHousing, model: Oscillators, own: slice) -> Skin | None:
    if found.surface is None:
        return None
    moved = np.hstack([model.rigid_rows[own], model.rows[own]]).T
    points = found.surface.points
    return Skin(points.astype("f4"), found.surface.faces, moved.reshape(-1, len(points), 3).astype("f4"))
