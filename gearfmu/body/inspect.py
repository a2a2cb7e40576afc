"""What a file of ours holds, as plain data for `gearfmu inspect`."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from gearfmu.body.body import Body, Flank
from gearfmu.body.layout import entries_of, value_of
from gearfmu.body.store import load_body
from gearfmu.files import format_of


def inspect_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Summary of a body file as JSON-ready data: kind, versions, hash, facts, datasets. Raises BodyError."""
    body = load_body(path)
    return {
        "file": str(path),
        "kind": "body",
        "name": body.name,
        "input_hash": body.how.hash,
        "format_version": format_of(path)[1],
        "algorithm_version": body.how.algorithm,
        "facts": _facts(body),
        "frf": _error(body),
        "material": body.how.material,
        "mesh": body.how.mesh,
        "provenance": body.how.provenance,
        "datasets": [
            {"path": e.path, "shape": list(np.shape(value_of(body, e.field))), "unit": e.unit, "meaning": e.meaning}
            for e in entries_of(body)
        ],
    }


def _facts(body: Body) -> dict[str, Any]:
    return {
        "method": body.how.method,
        "modes": body.modes,
        "frequency_range_Hz": [float(body.frequency[0]), float(body.frequency[-1])],
        "mass_kg": body.total_mass,
        "centre_of_mass_m": body.centre_of_mass.tolist(),
        "inertia_kgm2": np.diag(body.inertia).tolist(),
        "interfaces": {
            node.name: f"{node.kind}, ".removeprefix(", ")
            + f"{len(node.components)} components, at "
            + ", ".join(f"{1e3 * x:.3g}" for x in node.point)
            + " mm"
            for node in body.nodes
        },
        **(_teeth(body.flank) if body.flank is not None else {}),
    }


def _teeth(flank: Flank) -> dict[str, Any]:
    middle, offsets = len(flank.roll) // 2, flank.static.shape[2]
    return {
        "teeth": flank.teeth,
        **({"internal": True} if flank.internal else {}),
        "base_radius_m": flank.r_b,
        "face_width_m": flank.face_width,
        **({"base_helix_angle_deg": float(np.degrees(flank.beta_b))} if flank.beta_b else {}),
        "strip_half_width_m": flank.strip_half_width,
        "roll_points": len(flank.roll),
        "width_functions": flank.width_functions,
        "tooth_offsets": f"all {flank.teeth}" if flank.all_offsets else f"−{offsets // 2} to {offsets // 2}",
        "rows_along_profile": flank.knows_profile,
        "tooth_compliance_mid_flank_m_per_N": float(flank.static[0, 0, 0, middle, middle, 0, 0]),
    }


def _error(body: Body) -> dict[str, Any]:
    error = body.error
    if error is None:
        return {}
    return {
        "band_Hz": list(map(float, error.band)),
        "max_error": error.max_error,
        "trusted_to_Hz": error.trusted_to,
        "ground": list(error.ground),
        **({"cut_Hz": error.cut, "size": error.size} if error.cut is not None else {}),
        "length_scale_m": error.length,
    }
