"""Body files of former versions, read as bodies of today: gears of `gearfmu-body` 3, carriers of
`gearfmu-interface-body` 1."""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np

from gearfmu.body.body import ENTRIES
from gearfmu.body.layout import read_entry
from gearfmu.files import Entry
from gearfmu.reduction.full_order import COMPONENTS

FORMATS = (("gearfmu-body", 3), ("gearfmu-interface-body", 1))
GEAR_METHOD = "free eigenmodes and static residual"
_GEAR = {  # fields whose dataset had another name, but for the parts below
    "frequency": "modes/frequency", "damping_ratio": "modes/damping_ratio", "rows": "modes/bore_rows",
    "static": "static/c_bb", "flank.teeth": "body/teeth", "flank.r_b": "body/base_radius",
    "flank.psi_b": "body/base_half_angle", "flank.beta_b": "helix/base_angle", "flank.face_width": "body/face_width",
    "flank.diameter": "modes/nodal_diameter", "flank.part": "modes/part", "flank.parity": "modes/parity",
    "flank.rows": "modes/flank_rows", "flank.static": "static/c_ff", "flank.node": "static/c_fb",
    "flank.tangent.static_nt": "tangent/c_nt", "flank.tangent.static_tt": "tangent/c_tt",
    "sensors.points": "rim/patch_point", "sensors.rows": "rim/patch_rows", "picture.points": "surface/points",
    "picture.quads": "surface/quads",
}  # fmt: skip
_WHOLE = {
    "mass": "body/rigid_mass", "points": "interfaces/point", "frequency": "modes/frequency",
    "damping_ratio": "modes/damping_ratio", "rows": "modes/rows", "static": "static/c",
}  # fmt: skip
_PARTS = (("flank.tangent", "tangent"), ("picture.shapes", "shapes"), ("picture", "display"), ("error", "frf"))


def former_values(file: h5py.File) -> tuple[dict[str, Any], dict[str, Any]]:
    """Numbers by their fields in a body, and texts as `layout.TEXTS` has them."""
    gear = file.attrs["format"] == FORMATS[0][0]
    return _gear(file) if gear else _whole(file)


def _gear(file: h5py.File) -> tuple[dict[str, Any], dict[str, Any]]:
    ring = "rim" in file
    name = "rim" if ring else "bore"
    mass = np.zeros((6, 6))
    mass[:3, :3] = read_entry(file, Entry((), "", ""), "body/mass") * np.eye(3)
    mass[3:, 3:] = read_entry(file, Entry((3, 3), "", ""), "body/inertia")
    values = {"flank.beta_b": 0.0, "flank.internal": ring, "mass": mass, "points": np.zeros((1, 3))}
    texts = {
        "nodes": [{"name": name, "kind": "", "components": list(COMPONENTS)}],
        "ground": [name],
        "method": GEAR_METHOD,
    }
    return values | _values(file, _GEAR), texts | ({"sensors": ["rim"]} if ring else {}) | _texts(file)


def _whole(file: h5py.File) -> tuple[dict[str, Any], dict[str, Any]]:
    values = _values(file, _WHOLE)
    lines, error = values["error.frequency"], values["error.error"]
    values |= {"error.band": lines[[0, -1]], "error.max_error": float(error.max())}  # carriers did not store them
    texts = {name: json.loads(file.attrs[name]) for name in ("ground", "method")}
    return values, texts | {"nodes": json.loads(file.attrs["interfaces"])} | _texts(file)


def _values(file: h5py.File, names: dict[str, str]) -> dict[str, Any]:
    """Numbers by their fields in a body; names: datasets of some fields."""
    found = {}
    for entry in ENTRIES:
        part, former = next((pair for pair in _PARTS if entry.field.startswith(f"{pair[0]}.")), ("", ""))
        path = names.get(entry.field, entry.field.replace(part, former, 1).replace(".", "/") if part else entry.path)
        if path in file:
            value = read_entry(file, entry, path)
            found[entry.field] = value[None] if np.ndim(value) < len(entry.shape) else value  # one sensor of a ring
    return found


def _texts(file: h5py.File) -> dict[str, Any]:
    return {name: json.loads(file.attrs[name]) for name in ("material", "mesh", "provenance")}
