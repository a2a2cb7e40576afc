"""The linear model that the kernel makes of a stage at rest (gearfmu/kernel/src/problem/gk_linearise.h)."""

from __future__ import annotations

import ctypes
from ctypes import c_int32
from dataclasses import dataclass

import numpy as np

ARRAYS = {  # in the order of gk_linear: type, shape by the names of the counts
    "group": (np.int32, "coordinates"),
    "number": (np.int32, "coordinates"),
    "mass": (np.float64, "coordinates"),
    "omega": (np.float64, "coordinates"),
    "zeta": (np.float64, "coordinates"),
    "label": (np.int32, "room label"),
    "force": (np.float64, "room"),
    "dashpot": (np.float64, "room"),
    "te": (np.float64, "room"),
    "rows": (np.float64, "room coordinates"),
    "residual": (np.float64, "room room"),
    "own": (np.float64, "room room"),
    "support_compliance": (np.float64, "supports"),
    "support_rows": (np.float64, "supports coordinates"),
    "support_forces": (np.float64, "supports room"),
    "support_damping": (np.float64, "supports coordinates"),
    "damper": (np.float64, "supports"),
    "damper_rows": (np.float64, "supports coordinates"),
}
COUNTS = ("coordinates", "room", "supports", "engagements", "found")
SPIN, GROUND, FIRST_GEAR = -1, 0, 1  # values of `group`


class LinearInfo(ctypes.Structure):
    """gk_linear."""

    _fields_ = [(name, c_int32) for name in COUNTS] + [(name, ctypes.c_void_p) for name in ARRAYS]


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

    group: np.ndarray
    number: np.ndarray
    mass: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    label: np.ndarray
    force: np.ndarray
    dashpot: np.ndarray
    te: np.ndarray
    rows: np.ndarray
    residual: np.ndarray
    own: np.ndarray
    support_compliance: np.ndarray
    support_rows: np.ndarray
    support_forces: np.ndarray
    support_damping: np.ndarray
    damper: np.ndarray
    damper_rows: np.ndarray
    engagements: int


def room_for(info: LinearInfo) -> dict[str, np.ndarray]:
    """Zeroed arrays for the counts of `info`, which is told where they are."""
    counts = {name: getattr(info, name) for name in COUNTS} | {"label": 4}
    arrays = {name: np.zeros([counts[c] for c in shape.split()], kind) for name, (kind, shape) in ARRAYS.items()}
    for name, array in arrays.items():
        setattr(info, name, array.ctypes.data)
    return arrays


def linear_model(info: LinearInfo, arrays: dict[str, np.ndarray]) -> LinearModel:
    """The model with the rows that were found, without the spins of rotors that stand."""
    shapes = {name: shape.split() for name, (_, shape) in ARRAYS.items()}
    cut = {name: tuple(slice(info.found if c == "room" else None) for c in shape) for name, shape in shapes.items()}
    moves = np.isfinite(arrays["mass"])
    found = {name: array[cut[name]] for name, array in arrays.items()}
    for name, shape in shapes.items():
        found[name] = np.compress(moves, found[name], axis=-1) if shape[-1] == "coordinates" else found[name].copy()
    return LinearModel(**found, engagements=info.engagements)
