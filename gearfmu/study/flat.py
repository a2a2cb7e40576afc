"""Two elastic bodies in a flat contact of constant stiffness, as a model of the kernel and as its exact motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gearfmu.stage.blob import write_blob

GRID = 4  # rolls of the tables: all equal
OFFSETS, OWN = 7, 3
FLAT, TORQUE = 1, 1.0
TOUCHING = 1e-15  # m
NO_LOCAL = 1e-20  # 1/Pa: the local law as good as rigid; all compliance is in the residual
CUTS, LONGEST_STEP = 1e9, 1e-3  # Hz, s: beyond anything here


@dataclass(frozen=True)
class FlatBody:
    """mass kg · omega (n,) rad/s · rows (A, n): outward displacement by width function and mode, 1/√kg · residual
    (A, A) m/N."""

    mass: float
    omega: np.ndarray
    rows: np.ndarray
    residual: np.ndarray


def _body(mass: float, frequency: tuple[float, ...], rows: tuple[tuple[float, ...], ...]) -> FlatBody:
    return FlatBody(mass, 2 * np.pi * np.array(frequency), np.array(rows), np.diag([4e-8, 1.5e-8]))


@dataclass(frozen=True)
class FlatPair:
    """Left body thrown with `speed` (m/s) against the right one at rest; contact 1 m wide in an even number of slices,
    with width functions P0 and P2."""

    left: FlatBody = field(default_factory=lambda: _body(0.8, (1.9e3,), ((0.5,), (0.3,))))
    right: FlatBody = field(default_factory=lambda: _body(1.7, (3.0e3,), ((0.6,), (-0.3,))))
    slices: int = 2
    speed: float = 0.2

    @property
    def bodies(self) -> tuple[FlatBody, FlatBody]:
        return self.left, self.right


def flat_blob(pair: FlatPair) -> bytes:
    """The model blob (sections: gearfmu/kernel/src/model/gk_model.c)."""
    sections: dict = {
        "model": np.array([1, FLAT, pair.slices, 0], np.int32),
        "name": "flat_pair",
        "shafts": "left|right",
        "degrees": np.array([0, 2], np.int32),
        "pair": np.array([TOUCHING, 0.0, 0.0, 1.0, 1.0, CUTS, CUTS, LONGEST_STEP, 0.0]),
    }
    for g, body in enumerate(pair.bodies):
        sections |= {f"{name}{g}": values for name, values in _sections(body).items()}
    return write_blob(sections)


def _sections(body: FlatBody) -> dict[str, np.ndarray]:
    n, functions = body.omega.size, len(body.rows)
    static = np.zeros((2, 2, OFFSETS, GRID, GRID, functions, functions))
    static[0, 0, OWN] = body.residual + (body.rows / body.omega**2) @ body.rows.T
    mass = (body.mass, body.mass)
    gear = [1, 0.01, 0, 0.01, 0, 0, *mass, 1.0, NO_LOCAL, 1e-3, 0, 0.01, 1e-4, 0.01, 0, 1e8, 0]
    return {
        "gear": np.array(gear, float),
        "port": np.array([TORQUE, 0, 1, 0, 1, 1, 1, 0], float),
        "size": np.array([n, GRID, functions], np.int32),
        "omega": body.omega,
        "zeta": np.zeros(n),
        "diameter": np.zeros(n, np.int32),
        "part": np.zeros(n, np.int32),
        "rows": np.broadcast_to(body.rows, (2, GRID, functions, n)),
        "bore": np.zeros((3, n)),
        "c_ff": static,
        "c_fb": np.zeros((2, GRID, functions, 3)),
        "c_bb": np.zeros((3, 3)),
    }


def contact_rows(pair: FlatPair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """rows (slices, n) of the gaps by mass-normalised coordinate (each body's rigid motion first), compliance
    (slices, slices) m/N, ω (n,)."""
    edges = np.linspace(-1, 1, pair.slices + 1)
    second = np.diff(0.5 * (edges**3 - edges)) / np.diff(edges)  # mean of P2 over each slice
    weights = np.stack([np.ones(pair.slices), 5 * second], axis=1)
    parts, omega, compliance = [], [], np.zeros((pair.slices, pair.slices))
    for body, direction in zip(pair.bodies, (-1, 1), strict=True):
        parts += [np.full((pair.slices, 1), direction / np.sqrt(body.mass)), -weights @ body.rows]
        omega += [[0.0], body.omega]
        compliance += weights @ body.residual @ weights.T
    return np.hstack(parts), compliance, np.concatenate(omega)


def contact_frequencies(pair: FlatPair) -> np.ndarray:
    """Angular frequencies (k,), rad/s, of the two bodies while they are in contact: eigenvalues of Ω² + WᵀC⁻¹W, their
    common rigid motion left out."""
    rows, springs, omega = _linear(pair)
    square = np.linalg.eigvalsh(np.diag(omega**2) + rows.T @ springs @ rows)
    return np.sqrt(square[square > 1e-9 * square.max()])


def exact_force(pair: FlatPair, time: np.ndarray) -> np.ndarray:
    """Contact force (t,) N at `time` (t,) while the contact that closes at time 0 stays closed."""
    rows, springs, omega = _linear(pair)
    square, shape = np.linalg.eigh(np.diag(omega**2) + rows.T @ springs @ rows)
    v0 = np.zeros(omega.size)
    v0[0] = pair.speed * np.sqrt(pair.left.mass)
    root = np.sqrt(np.maximum(square, 0.0))
    part = np.where(root > 1.0, np.sin(np.outer(time, root)) / np.maximum(root, 1.0), time[:, None])
    q = (part * (shape.T @ v0)) @ shape.T
    return -(q @ rows.T @ springs).sum(axis=1)


def _linear(pair: FlatPair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """rows, stiffness of the contact, ω. Slices that mirror each other are one contact: the inverse is that of the
    symmetric part."""
    rows, compliance, omega = contact_rows(pair)
    return rows, np.linalg.pinv(compliance), omega
