"""Two elastic bodies in a flat contact of constant stiffness, as a model of the kernel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.stage.assembly.assemble import MODEL_VERSION
from gearfmu.stage.assembly.blob import gear_numbers, order_sections, write_blob
from gearfmu.stage.assembly.compact import residual_sections
from gearfmu.stage.assembly.teeth import OFFSETS

GRID = 4  # rolls of the tables: all equal
OWN = 3
FLAT, TORQUE = 0, 1
TOUCHING = 1e-15  # m
NO_LOCAL = 1e-20  # 1/Pa: the local law as good as rigid; all compliance is in the residual
CUTS, LONGEST_STEP, LONGEST_PERIOD = 1e9, 1e-3, 2 * math.pi  # Hz, s, s: beyond anything here
LOAD = 100.0  # N: where the local law is taken when effect.hertz is off


@dataclass(frozen=True)
class FlatBody:
    """mass kg · omega (n,) rad/s and zeta (n,) · rows (A, n): outward displacement by width function and mode, 1/√kg ·
    residual (A, A) m/N: static compliance beyond the modes. Rows and whole static compliance are rounded to the single
    precision in which a model stores them."""

    mass: float
    omega: np.ndarray
    zeta: np.ndarray
    rows: np.ndarray
    residual: np.ndarray

    def __post_init__(self) -> None:
        carried = (self.rows / self.omega**2) @ self.rows.T
        stored = _single(self.residual + carried)
        object.__setattr__(self, "rows", _single(self.rows))
        object.__setattr__(self, "residual", stored - (self.rows / self.omega**2) @ self.rows.T)


def rigid_block(mass: float, compliance: float = 0.0) -> FlatBody:
    """Without modes; compliance: of its face, m/N."""
    return FlatBody(mass, np.zeros(0), np.zeros(0), np.zeros((1, 0)), np.array([[compliance]]))


def _single(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, np.float32).astype(float)


@dataclass(frozen=True)
class FlatContact:
    """Flat engagement 1 m wide: slices, degrees of the width functions, gap m, local 2 (1 − ν²)/(πE) 1/Pa, damping
    N·s/m per m of width."""

    slices: int = 1
    degrees: tuple[int, ...] = (0,)
    gap: float = TOUCHING
    local: float = NO_LOCAL
    damping: float = 0.0


def flat_blob(name: str, bodies: Sequence[FlatBody], contact: FlatContact) -> bytes:
    """Model of two bodies, "left" and "right", with torque ports (here forces), that meet in a flat contact: gap =
    x_right − x_left − outward displacements, in every slice. What spins elsewhere moves along x here."""
    functions = len(contact.degrees)
    sections: dict = {
        "counts": np.array([MODEL_VERSION, contact.slices, 2, 2, 1, 2, 0, functions, GRID, 1], np.int32),
        "name": name,
        "rotor_names": "left|right",
        "engagement_names": "mesh",
        "support_names": "",
        "displacement_names": "",
        "limits": np.array([CUTS, CUTS, LONGEST_STEP, LONGEST_PERIOD]),
        "degrees": np.array(contact.degrees, np.int32),
        "inertia": np.array([body.mass for body in bodies]),
        "engaged": np.array([[0, 1, FLAT, 0]], np.int32),
        "engagement": np.array([[0.0, 0.0, contact.gap, 0.0, 0.0, 0.0, contact.damping, LOAD, 0.0, 0.0]]),
        "port_kinds": np.array([[0, TORQUE, 0], [1, TORQUE, 0]], np.int32),
        "ports": np.array([[1.0, 0.0, 1.0, 1.0, 1.0, 0.0]] * 2),
        "port_residual": np.zeros((2, 2)),
        "port_support": np.zeros((2, 0)),
        "omega_ground0": np.zeros(0),
        "zeta_ground0": np.zeros(0),
        "rigid_share0": np.zeros(0),
        "damper_rows0": np.zeros((0, 0)),
        "damper0": np.zeros(0),
        "support_rows0": np.zeros((0, 0)),
        "support_compliance0": np.zeros(0),
        "kappa0": np.zeros((0, 0)),
        "port_rows0": np.zeros((2, 0)),
    }
    for g, body in enumerate(bodies):
        sections |= _body_sections(g, body, contact)
    return write_blob(order_sections(sections))


def _body_sections(g: int, body: FlatBody, contact: FlatContact) -> dict[str, np.ndarray]:
    n, functions = body.omega.size, len(contact.degrees)
    static = np.zeros((2, 2, len(OFFSETS), GRID, GRID, functions, functions))
    static[0, 0, OWN] = body.residual + (body.rows / body.omega**2) @ body.rows.T
    return residual_sections(g, static, np.array(contact.degrees)) | {
        f"size{g}": np.array([g, 1, n, 0, 0, GRID, 0, 0], np.int32),
        f"gear{g}": _flat_numbers(contact.local),
        f"omega{g}": body.omega,
        f"zeta{g}": body.zeta,
        f"diameter{g}": np.zeros(n, np.int32),
        f"member{g}": np.zeros(n, np.int32),
        f"level_modes{g}": np.array([0, n, n], np.int32),
        f"rows{g}": np.broadcast_to(body.rows, (2, GRID, functions, n)),
        f"resample{g}": np.eye(GRID),
        f"low_rows{g}": np.zeros((2, GRID, functions, 0)),
        f"low_member{g}": np.zeros(0, np.int32),
        f"node{g}": np.zeros((3, 2, GRID, functions, 6)),
        f"node_support{g}": np.zeros((6, 0)),
        f"port_residual{g}": np.zeros((2, GRID, functions, 2)),
        f"ground_list{g}_0": np.zeros(0, np.int32),
        f"centre{g}_0": np.zeros((6, 0)),
        f"low_ground{g}_0": np.zeros((0, 0)),
        f"node_ground{g}_0": np.zeros((6, 0)),
    }


def _flat_numbers(local: float) -> np.ndarray:
    """A flank that is there in name only; its width and the local law count."""
    return gear_numbers(
        {
            "r_b": 0.01,
            "s_form": 0.0,
            "s_tip": 0.01,
            "psi_b": 0.0,
            "phase": 0.0,
            "face_width": 1.0,
            "local": local,
            "strip_half_width": 1e-3,
            "relief": 0.0,
            "relief_start": 0.01,
            "tip_edge": 1e-4,
            "corner_radius": 0.01,
            "corner_angle": 0.0,
            "z_mid": 0.0,
            "helix": 0.0,
        }
    )
