"""From any basis to what the kernel takes: mass-normalised oscillators in the mean-axis frame, rigid motion explicit.

The projected problem VᵀKV y = ω² y is solved once more, so that every method gives the same kind of body:

    q̈_k + 2 ζ_k ω_k q̇_k + ω_k² q_k = Σ N_k,i f_i,     u_i = Σ_k N_k,i q_k + rigid motion + (C_static − Σ N Nᵀ/ω²) f

The basis is M-orthogonal to the rigid modes, hence the frame of the oscillators is the mean-axis frame and rigid and
elastic inertia decouple (theory, section 1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.reduction.elastic import elastic
from gearfmu.reduction.full_order import FullOrder
from gearfmu.reduction.moments import static_response


@dataclass(frozen=True)
class Oscillators:
    """A reduced body: n oscillators, r rigid modes and the static compliance at m interface rows.

    omega (n,) rad/s ascending; damping_ratio (n,); rows (m, n), kg^-½ (rotations kg^-½/m), of all interfaces in the
    order of the FullOrder: labels (m,) = (interface, component), scales (m,) = length for rotations, else 1, m.
    rigid_rows (m, r), rows of the rigid fields about the origin, and rigid_mass (r, r) their mass matrix; r = 0 for a
    body that is held. static (m, m) : C_static, m/N …, of the full model (inertia relief, mean-axis gauge). turn (n,
    n): oscillators in vectors of the basis.
    """

    name: str
    omega: np.ndarray
    damping_ratio: np.ndarray
    rows: np.ndarray
    labels: tuple[tuple[str, str], ...]
    scales: np.ndarray
    rigid_rows: np.ndarray
    rigid_mass: np.ndarray
    static: np.ndarray
    turn: np.ndarray

    @property
    def size(self) -> int:
        """Number n of oscillators."""
        return len(self.omega)

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (n,), Hz."""
        return self.omega / (2 * np.pi)

    def select(self, *names: str) -> np.ndarray:
        """Indices of the rows of the named interfaces, in their order here."""
        return np.array([k for k, (interface, _) in enumerate(self.labels) if interface in names], int)

    def residual(self, dynamic: int | None = None) -> np.ndarray:
        """C_static − Σ N Nᵀ/ω² over the `dynamic` lowest oscillators (all when None): static flexibility of the rest,
        (m, m)."""
        kept = self.rows[:, :dynamic] / self.omega[:dynamic]
        return self.static - kept @ kept.T


def oscillators(body: FullOrder, vectors: np.ndarray, damping_ratio: float) -> Oscillators:
    """Oscillators of `body` in the basis V (N, n) of a method, all with modal damping `damping_ratio`; costs n products
    with K and the static response to all interfaces, which is kept."""
    projected = vectors.T @ (body.stiffness @ vectors)
    rows = body.rows()
    static = (rows @ static_response(body)) * body.scales()
    static = 0.5 * (static + static.T)
    return decoupled(body, projected, rows @ vectors, static, damping_ratio)


def decoupled(
    body: FullOrder, stiffness: np.ndarray, rows: np.ndarray, static: np.ndarray, damping_ratio: float
) -> Oscillators:
    """Oscillators of `body` in a basis orthonormal in M: VᵀKV (n, n), interface rows B V (m, n), C_static (m, m)."""
    squared, turn = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
    assert squared.min(initial=1.0) > 0, "a basis with a motion that costs no energy"
    fields = _rigid_fields(body)
    return Oscillators(
        name=body.name,
        omega=np.sqrt(squared),
        damping_ratio=np.full(len(squared), damping_ratio),
        rows=rows @ turn,
        labels=tuple((i.name, component) for i in body.interfaces for component in i.components),
        scales=body.scales(),
        rigid_rows=body.rows() @ fields,
        rigid_mass=fields.T @ (body.mass @ fields),
        static=static,
        turn=turn,
    )


def _rigid_fields(body: FullOrder) -> np.ndarray:
    """The body's own rigid fields while nothing is held, else what is left of them."""
    space = elastic(body)
    return body.rigid if space.rigid.shape[1] == body.rigid.shape[1] else space.rigid
