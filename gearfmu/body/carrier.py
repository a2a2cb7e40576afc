"""The reduced carrier of a planetary set, made as a whole."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from gearfmu.body.imported import imported_carrier_order
from gearfmu.body.interface_body import InterfaceBody
from gearfmu.body.parts import provenance
from gearfmu.femesh import mesh_report
from gearfmu.femesh.carrier import carrier_sector
from gearfmu.reduction.basis import Size
from gearfmu.reduction.carrier import carrier_full_order, carrier_need
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.memory import lower_counts, require_memory
from gearfmu.reduction.mesh_error import carrier_mesh_error
from gearfmu.reduction.methods import METHODS
from gearfmu.reduction.oscillators import Oscillators, oscillators
from gearfmu.reduction.transfer import Judging, reference, relative_error, transfer
from gearfmu.spec.forms.members import CarrierMember

TRUSTED_ERROR = 0.01
Progress = Callable[[str, float], None]


def reduced_carrier(carrier: CarrierMember, input_hash: str, progress: Progress | None = None) -> InterfaceBody:
    """The carrier of a set, reduced as its file says. Raises MeshError."""
    part, started = carrier.part, time.process_time()
    _tell(progress, "carrier: mesh and finite elements", 0.0)
    if part.imported is None:
        need = carrier_need(carrier)
        require_memory(need, lower_counts(part.mesh, "carrier.mesh"))
        _tell(progress, f"carrier: error of the mesh, {need.text}", 0.0)
        facts = _carrier_facts(carrier)
        _tell(progress, "carrier: finite elements", 0.3)
        full = carrier_full_order(carrier)
        mesh = {**facts, "dof_body": full.size}
    else:
        full, mesh = imported_carrier_order(carrier)
    _tell(progress, f"carrier: {part.method}", 0.5)
    method, size = METHODS[part.method], Size(part.modes)
    model = oscillators(full, method(full, size), part.modal_damping)
    _tell(progress, "carrier: frequency response", 0.7)
    judging = Judging.over(damping_ratio=part.modal_damping)
    exact = reference(full, judging)
    error = relative_error(exact.matrix, transfer(model, judging, full.ground, residual=True))
    evidence = Evidence(judging.frequency, error)
    made = {"mesh": mesh, "started": started, "input_hash": input_hash, "material": part.material.model_dump()}
    return interface_body(full, model, evidence, made)


def _carrier_facts(carrier: CarrierMember) -> dict[str, Any]:
    """Plain facts about our own mesh of a carrier, its error measured on a finer one."""
    facts = mesh_report(carrier_sector(carrier.geometry, carrier.part.mesh))
    counts, error = carrier.part.mesh.model_dump(), carrier_mesh_error(carrier)
    return {**facts, "dof_sector": facts["dof"], "counts": counts, "frequency_error": error}


class Evidence:
    """Error over frequency, and up to where it stays below 1 %."""

    def __init__(self, frequency: np.ndarray, error: np.ndarray):
        self.frequency, self.error = frequency, error
        bad = np.flatnonzero(error > TRUSTED_ERROR)
        self.trusted_to = float(frequency[-1] if not len(bad) else frequency[max(bad[0] - 1, 0)])


def interface_body(full: FullOrder, model: Oscillators, evidence: Evidence, made: dict[str, Any]) -> InterfaceBody:
    """The body of a reduced FullOrder. made: mesh, material, input_hash, and started, s of processor time."""
    return InterfaceBody(
        name="carrier",
        input_hash=made["input_hash"],
        method=model.method,
        interfaces=tuple({"name": i.name, "kind": i.kind, "components": list(i.components)} for i in full.interfaces),
        ground=full.ground,
        material=made["material"],
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
