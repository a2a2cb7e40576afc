"""Body files of former versions, read as bodies of today: gears of `gearfmu-body` 3, carriers of
`gearfmu-interface-body` 1."""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np

from gearfmu.body.layout import (
    BODY,
    CUT,
    ERROR,
    FLANK,
    PICTURE,
    SENSORS,
    SHAPES,
    SPIN,
    SURFACE,
    TANGENT,
    Entry,
    read_entry,
)
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
_OPTIONAL = {"tangent": TANGENT, "shapes": SHAPES, "surface": SURFACE, "spin": SPIN, "rim": SENSORS, "helix": ()}
_SUMS = ("error.band", "error.max_error")  # what carriers did not store


def former_values(file: h5py.File) -> tuple[dict[str, Any], dict[str, Any]]:
    """Numbers by their fields in a body, and texts as `layout.TEXTS` has them."""
    gear = file.attrs["format"] == FORMATS[0][0]
    return _gear(file) if gear else _whole(file)


def _gear(file: h5py.File) -> tuple[dict[str, Any], dict[str, Any]]:
    ring, helical = "rim" in file, "helix" in file
    wanted = [
        *BODY,
        *ERROR,
        *CUT,
        *FLANK,
        *PICTURE,
        *(e for name in _OPTIONAL if name in file for e in _OPTIONAL[name]),
    ]
    own = {"mass", "points", "flank.internal"} | (set() if helical else {"flank.beta_b"})
    values = {e.field: _read(file, e, _GEAR) for e in wanted if e.field not in own}
    mass = np.zeros((6, 6))
    mass[:3, :3] = read_entry(file, Entry("", (), "", ""), "body/mass") * np.eye(3)
    mass[3:, 3:] = read_entry(file, Entry("", (3, 3), "", ""), "body/inertia")
    values |= {"mass": mass, "points": np.zeros((1, 3)), "flank.internal": ring}
    name = "rim" if ring else "bore"
    texts = {
        "nodes": [{"name": name, "kind": "", "components": list(COMPONENTS)}],
        "ground": [name],
        "method": GEAR_METHOD,
    }
    return {"flank.beta_b": 0.0} | values, texts | ({"sensors": ["rim"]} if ring else {}) | _texts(file)


def _whole(file: h5py.File) -> tuple[dict[str, Any], dict[str, Any]]:
    values = {e.field: _read(file, e, _WHOLE) for e in (*BODY, *ERROR) if e.field not in _SUMS}
    lines, error = values["error.frequency"], values["error.error"]
    values |= {"error.band": lines[[0, -1]], "error.max_error": float(error.max())}
    texts = {name: json.loads(file.attrs[name]) for name in ("ground", "method")}
    return values, texts | {"nodes": json.loads(file.attrs["interfaces"])} | _texts(file)


def _read(file: h5py.File, entry: Entry, names: dict[str, str]) -> Any:
    path = names.get(entry.field)
    if path is None:
        group = next((pair for pair in _PARTS if entry.field.startswith(f"{pair[0]}.")), ("", ""))
        path = entry.field.replace(group[0], group[1], 1).replace(".", "/") if group[0] else entry.path
    value = read_entry(file, entry, path)
    return value[None] if np.ndim(value) < len(entry.shape) else value  # the one sensor of a ring


def _texts(file: h5py.File) -> dict[str, Any]:
    return {name: json.loads(file.attrs[name]) for name in ("material", "mesh", "provenance")}
