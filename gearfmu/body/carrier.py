"""The reduced carrier of a planetary set, made as a whole."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from gearfmu.body.imported import imported_carrier_order
from gearfmu.body.interface_body import InterfaceBody
from gearfmu.body.provenance import provenance
from gearfmu.femesh import mesh_report
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.geometry.carrier import CarrierGeometry
from gearfmu.reduction.basis import Size
from gearfmu.reduction.carrier import carrier_full_order, carrier_need
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.memory import lower_counts, require_memory
from gearfmu.reduction.mesh_error import carrier_mesh_error
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.oscillators import Oscillators, oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer
from gearfmu.spec.planetary import PlanetarySpec

TRUSTED_ERROR = 0.01
Progress = Callable[[str, float], None]


def reduced_carrier(spec: PlanetarySpec, input_hash: str, progress: Progress | None = None) -> InterfaceBody:
    """The carrier of a set, reduced as its file says. Raises MeshError."""
    started = time.process_time()
    _tell(progress, "carrier: mesh and finite elements", 0.0)
    if spec.carrier.imported is None:
        need = carrier_need(spec)
        require_memory(need, lower_counts(spec.carrier.mesh, "carrier.mesh"))
        _tell(progress, f"carrier: error of the mesh, {need.text}", 0.0)
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
    made = {"mesh": mesh, "started": started, "input_hash": input_hash}
    return _interface_body(full, model, evidence, spec, made)


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
        input_hash=made["input_hash"],
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
