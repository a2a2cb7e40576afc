"""What a file of ours holds, as plain data for `gearfmu inspect`."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from gearfmu.body.interface_body import FORMAT as INTERFACE_FORMAT
from gearfmu.body.interface_body import interface_facts, load_interface_body
from gearfmu.body.layout import entries_of
from gearfmu.body.reduced import ReducedBody, value_of
from gearfmu.body.store import load_body
from gearfmu.hdf5 import format_of


def inspect_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Summary of a body file as JSON-ready data: kind, versions, hash, facts, datasets. Raises BodyError."""
    if format_of(path) == INTERFACE_FORMAT:
        return {"file": str(path), "kind": "interface body", **interface_facts(load_interface_body(path))}
    body = load_body(path)
    return {
        "file": str(path),
        "kind": "body",
        "name": body.name,
        "input_hash": body.input_hash,
        "format_version": body.format_version,
        "algorithm_version": body.algorithm_version,
        "facts": _facts(body),
        "frf": _frf(body),
        "material": body.material,
        "mesh": body.mesh,
        "provenance": body.provenance,
        "datasets": [
            {"path": e.path, "shape": list(np.shape(value_of(body, e.field))), "unit": e.unit, "meaning": e.meaning}
            for e in entries_of(body.groups)
        ],
    }


def _facts(body: ReducedBody) -> dict[str, Any]:
    middle, offsets = len(body.roll) // 2, body.static_ff.shape[2]
    return {
        "teeth": body.teeth,
        "mass_kg": body.mass,
        "polar_inertia_kgm2": float(body.inertia[2, 2]),
        "transverse_inertia_kgm2": float(body.inertia[0, 0]),
        "method": "free eigenmodes and static residual",
        "base_radius_m": body.r_b,
        "face_width_m": body.face_width,
        **({"base_helix_angle_deg": float(np.degrees(body.base_helix_angle))} if body.base_helix_angle else {}),
        "strip_half_width_m": body.strip_half_width,
        "modes": body.modes,
        "frequency_range_Hz": [float(body.frequency[0]), float(body.frequency[-1])],
        "roll_points": len(body.roll),
        "width_functions": body.width_functions,
        "tooth_offsets": f"all {body.teeth}" if body.all_offsets else f"−{offsets // 2} to {offsets // 2}",
        "rows_along_profile": body.knows_profile,
        "tooth_compliance_mid_flank_m_per_N": float(body.static_ff[0, 0, 0, middle, middle, 0, 0]),
        **({"internal": True} if body.internal else {}),
    }


def _frf(body: ReducedBody) -> dict[str, Any]:
    return {
        "band_Hz": list(map(float, body.frf.band)),
        "max_error": body.frf.max_error,
        "trusted_to_Hz": body.frf.trusted_to,
        "cut_Hz": body.frf.cut,
        "size": body.frf.size,
        "length_scale_m": body.frf.length,
    }
