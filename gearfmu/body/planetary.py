"""From a planetary set's numbers to its reduced bodies: sun, planet and ring by cyclic symmetry, carrier as a whole."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.body.apart import Job, Work, reduce_apart_together, side_by_side
from gearfmu.body.imported import imported_carrier_order
from gearfmu.body.interface_body import InterfaceBody, load_interface_body, save_interface_body
from gearfmu.body.layout import ALGORITHM_VERSION
from gearfmu.body.provenance import provenance
from gearfmu.body.reduce import gear_work, reduced_gear
from gearfmu.body.reduced import ReducedBody
from gearfmu.body.stale import refuse_stale
from gearfmu.body.store import load_body, save_body
from gearfmu.errors import BodyError, MeshError
from gearfmu.femesh import mesh_report
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.geometry.planetary import set_geometry
from gearfmu.reduction.basis import Size
from gearfmu.reduction.carrier import carrier_full_order, carrier_need
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.memory import lower_counts, require_memory
from gearfmu.reduction.mesh_error import carrier_mesh_error
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.oscillators import Oscillators, oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer
from gearfmu.spec.body import body_hash
from gearfmu.spec.library import model_folder
from gearfmu.spec.planetary import PlanetarySpec
from gearfmu.spec.planetary_body import SET_BODIES, set_body_inputs

TRUSTED_ERROR = 0.01

Progress = Callable[[str, float], None]
Body = ReducedBody | InterfaceBody


def set_hash(spec: PlanetarySpec, name: str) -> str:
    """Fingerprint the body `name` ("sun", "planet", "ring", "carrier") must carry."""
    return body_hash({**set_body_inputs(spec, name), "algorithm_version": ALGORITHM_VERSION})


def set_hashes(spec: PlanetarySpec) -> tuple[str, ...]:
    """`set_hash` of sun, planet, ring and carrier."""
    return tuple(set_hash(spec, name) for name in SET_BODIES)


def set_body_path(spec: PlanetarySpec, name: str, folder: str | os.PathLike[str] | None = None) -> Path:
    """Where a body lies: `<folder>/<name>.h5`, the folder of the stage file when None."""
    return (Path(folder) if folder is not None else model_folder(spec)) / f"{name}.h5"


def load_set_bodies(spec: PlanetarySpec, folder: str | os.PathLike[str] | None = None) -> list[Body]:
    """The stored bodies: sun, planet, ring, carrier. Raises BodyError when one is missing, damaged or stale."""
    return [_load_current(spec, name, folder) for name in SET_BODIES]


def reduce_set(
    spec: PlanetarySpec,
    folder: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> list[Body]:
    """Reduce what is missing or stale of a set and store it: two large gears at the same time where processors and
    memory are there, then what is left, the carrier, which takes the most memory, last.

    progress : called with (what is being done, share done of it). Raises MeshError and BodyError.
    """
    stored = {} if force else {name: _current_in_set(spec, name, folder) for name in SET_BODIES}
    wanted = [name for name in SET_BODIES if stored.get(name) is None]
    paths = {name: set_body_path(spec, name, folder) for name in wanted}
    gears = [name for name in wanted if name != "carrier"]
    jobs: list[tuple[Work | None, Job]] = [
        (gear_work(getattr(spec, name), set_geometry(spec, name)), (spec, name, paths[name])) for name in gears
    ]
    if apart := side_by_side(jobs):
        reduce_apart_together(apart, progress)
    together = {which for _, which, _ in apart}
    longest_first = sorted(wanted, key=("ring", "sun", "planet", "carrier").index)
    for name in longest_first:
        if name not in together:
            _make(spec, name, paths[name], progress)
    return [stored.get(name) or _load_current(spec, name, folder) for name in SET_BODIES]


def reduce_set_body(spec: PlanetarySpec, name: str, progress: Progress | None = None) -> Body:
    """One body of a set from its numbers. Raises MeshError with the body's name."""
    try:
        if name == "carrier":
            return _carrier(spec, progress)
        gear = spec.gears[SET_BODIES.index(name)]
        return reduced_gear(gear, set_geometry(spec, name), set_hash(spec, name), progress)
    except MeshError as error:
        raise MeshError(f"{spec.source}: {name}: {error}") from error


def _make(spec: PlanetarySpec, name: str, path: Path, progress: Progress | None = None) -> None:
    body = reduce_set_body(spec, name, progress)
    if isinstance(body, InterfaceBody):
        save_interface_body(body, path)
    else:
        save_body(body, path)


def _load(name: str, path: Path) -> Body:
    return load_interface_body(path) if name == "carrier" else load_body(path)


def is_current_in_set(spec: PlanetarySpec, name: str, folder: str | os.PathLike[str] | None = None) -> bool:
    """Is the stored body sound and made from these numbers?"""
    return _current_in_set(spec, name, folder) is not None


def _current_in_set(spec: PlanetarySpec, name: str, folder: str | os.PathLike[str] | None) -> Body | None:
    """The stored body; None where it is missing, damaged or made from other numbers."""
    try:
        return _load_current(spec, name, folder)
    except BodyError:
        return None


def _load_current(spec: PlanetarySpec, name: str, folder: str | os.PathLike[str] | None) -> Body:
    """The stored body. Raises BodyError when it is missing, damaged or stale."""
    path = set_body_path(spec, name, folder)
    body = _load(name, path)
    refuse_stale(path, body, set_hash(spec, name), spec.source)
    return body


def _carrier(spec: PlanetarySpec, progress: Progress | None) -> InterfaceBody:
    started = time.process_time()
    _tell(progress, "carrier: mesh and finite elements", 0.0)
    if spec.carrier.imported is None:
        need = carrier_need(spec)
        require_memory(need, lower_counts(spec.carrier.mesh, "carrier.mesh"))
        _tell(progress, f"carrier: frequencies of a finer mesh, {need.text}", 0.0)
        facts = _carrier_facts(spec)
        _tell(progress, "carrier: finite elements", 0.3)
        full = carrier_full_order(spec)
        mesh = {**facts, "dof_body": full.size}
    else:
        full, mesh = imported_carrier_order(spec)
    _tell(progress, f"carrier: {spec.carrier.method}", 0.5)
    method, size = METHODS[spec.carrier.method], Size(spec.carrier.modes)
    model = oscillators(full, method(full, size), spec.carrier.modal_damping)
    _tell(progress, "carrier: frequency response", 0.7)
    judging = Judging.over(damping_ratio=spec.carrier.modal_damping)
    exact = reference(full, judging)
    error = relative_error(exact.matrix, transfer(model, judging, full.ground, residual=True))
    evidence = _Evidence(judging.frequency, error)
    return _interface_body(full, model, evidence, spec, {"mesh": mesh, "started": started})


def _carrier_facts(spec: PlanetarySpec) -> dict[str, Any]:
    """Plain facts about our own mesh of a carrier, its error measured on a finer one."""
    facts = mesh_report(carrier_sector(CarrierGeometry.of(spec), spec.carrier.mesh))
    counts, error = spec.carrier.mesh.model_dump(), carrier_mesh_error(spec)
    return {**facts, "dof_sector": facts["dof"], "counts": counts, "frequency_error": error}


class _Evidence:
    """Error over frequency, and up to where it stays below 1 %."""

    def __init__(self, frequency: np.ndarray, error: np.ndarray):
        self.frequency, self.error = frequency, error
        bad = np.flatnonzero(error > TRUSTED_ERROR)
        self.trusted_to = float(frequency[-1] if not len(bad) else frequency[max(bad[0] - 1, 0)])


def _interface_body(
    full: FullOrder, model: Oscillators, evidence: _Evidence, spec: PlanetarySpec, made: dict[str, Any]
) -> InterfaceBody:
    return InterfaceBody(
        name="carrier",
        input_hash=set_hash(spec, "carrier"),
        method=model.method,
        interfaces=tuple({"name": i.name, "kind": i.kind, "components": list(i.components)} for i in full.interfaces),
        ground=full.ground,
        material=spec.carrier.material.model_dump(),
        mesh=made["mesh"],
        provenance=provenance(time.process_time() - made["started"]),
        rigid_mass=model.rigid_mass,
        point=np.array([i.point for i in full.interfaces]),
        rigid_rows=model.rigid_rows,
        frequency=model.frequency,
        damping_ratio=model.damping_ratio,
        rows=model.rows,
        static=model.static,
        frf_frequency=evidence.frequency,
        frf_error=evidence.error,
        length=full.length,
        trusted_to=evidence.trusted_to,
    )


def _tell(progress: Progress | None, what: str, share: float) -> None:
    if progress:
        progress(what, share)
