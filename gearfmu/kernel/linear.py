"""The linear model that the kernel makes of a stage at rest (gearfmu/kernel/src/problem/gk_linearise.h)."""

from __future__ import annotations

import ctypes
from ctypes import c_int32
from dataclasses import dataclass, field, fields

import numpy as np

COUNTS = ("coordinates", "room", "supports", "engagements", "found")
SPIN, GROUND, FIRST_GEAR = -1, 0, 1  # values of `group`


def _array(shape: str, kind: type = np.float64) -> dict[str, tuple[type, list[str]]]:
    """What says that a field is an array of gk_linear, in its order: type, shape by the names of the counts."""
    return {"array": (kind, shape.split())}


@dataclass(frozen=True)
class LinearModel:
    """Equation (29) of docs/theory.md: M q̈ + [diag(ω²) + Wᵀ (Q + S)⁻¹ W] q = 0, with M = diag(mass).

    Of n coordinates: group (n,) `SPIN`, `GROUND` or `FIRST_GEAR` + gear; number (n,) in that group; mass (n,) kg·m², 1
    for oscillators; omega (n,) rad/s; zeta (n,).
    Of m rows at work, closed contacts and springs of ports: label (m, 4) engagement, flank, tooth of gear A, strip, or
    −1, port, joint, 0; force (m,) N or N·m at rest; dashpot (m,) N·s/m; te (m,) derivative of the gap by the
    transmission error; rows W (m, n); residual Q and own S (m, m) m/N, S parallel to the dashpots.
    Of s supports: force = support_rows (s, n) q + support_forces (s, m) λ + support_damping (s, n) q̇;
    support_compliance (s,) m/N of their own springs, damper (s,) N·s/m across them, damper_rows (s, n) of their
    elongation. engagements: of the stage.
    """

    group: np.ndarray = field(metadata=_array("coordinates", np.int32))
    number: np.ndarray = field(metadata=_array("coordinates", np.int32))
    mass: np.ndarray = field(metadata=_array("coordinates"))
    omega: np.ndarray = field(metadata=_array("coordinates"))
    zeta: np.ndarray = field(metadata=_array("coordinates"))
    label: np.ndarray = field(metadata=_array("room label", np.int32))
    force: np.ndarray = field(metadata=_array("room"))
    dashpot: np.ndarray = field(metadata=_array("room"))
    te: np.ndarray = field(metadata=_array("room"))
    rows: np.ndarray = field(metadata=_array("room coordinates"))
    residual: np.ndarray = field(metadata=_array("room room"))
    own: np.ndarray = field(metadata=_array("room room"))
    support_compliance: np.ndarray = field(metadata=_array("supports"))
    support_rows: np.ndarray = field(metadata=_array("supports coordinates"))
    support_forces: np.ndarray = field(metadata=_array("supports room"))
    support_damping: np.ndarray = field(metadata=_array("supports coordinates"))
    damper: np.ndarray = field(metadata=_array("supports"))
    damper_rows: np.ndarray = field(metadata=_array("supports coordinates"))
    engagements: int


ARRAYS: dict[str, tuple[type, list[str]]] = {
    own.name: own.metadata["array"] for own in fields(LinearModel) if own.metadata
}


class LinearInfo(ctypes.Structure):
    """gk_linear."""

    _fields_ = [(name, c_int32) for name in COUNTS] + [(name, ctypes.c_void_p) for name in ARRAYS]


def room_for(info: LinearInfo) -> dict[str, np.ndarray]:
    """Zeroed arrays for the counts of `info`, which is told where they are."""
    counts = {name: getattr(info, name) for name in COUNTS} | {"label": 4}
    arrays: dict[str, np.ndarray] = {}
    for name, (kind, shape) in ARRAYS.items():
        arrays[name] = np.zeros([counts[c] for c in shape], kind)
        setattr(info, name, arrays[name].ctypes.data)
    return arrays


def linear_model(info: LinearInfo, arrays: dict[str, np.ndarray]) -> LinearModel:
    """The model with the rows that were found, without the spins of rotors that stand."""
    moves, found = np.isfinite(arrays["mass"]), {}
    for name, (_, shape) in ARRAYS.items():
        part = arrays[name][tuple(slice(info.found if c == "room" else None) for c in shape)]
        found[name] = np.compress(moves, part, axis=-1) if shape[-1] == "coordinates" else part.copy()
    return LinearModel(**found, engagements=info.engagements)
