"""Natural frequencies of an internal gear on elastic mounts.

The free ring moves by its rigid motion r, its n modes q and its residual C_res. Each mount is a spring k on the mean
displacement of a patch of the rim; condensing what the residual gives way there,
    κ = k (I + k C_res,mm)⁻¹,   M = diag(M_r, I),   K = diag(0, ω²) + [R N]_mᵀ κ [R N]_m,
with 6 + n modes. Above the n-th mode of the free ring the residual is quasi-static, as everywhere (theory, residual).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from gearfmu.body.reduced import ReducedBody, Rim
from gearfmu.errors import BodyError
from gearfmu.fem.coupling import rigid_fields
from gearfmu.geometry.planetary import mount_spaces


def mounted_frequencies(body: ReducedBody) -> np.ndarray:
    """(6 + n,) Hz ascending, of the ring on the mounts that its file declares: the six motions that are rigid without
    them are among them. Raises BodyError for a body without mounts."""
    if body.rim is None or body.rim.mounts == 0:
        raise BodyError(f"body '{body.name}' has no mounts: declare [ring.mounts] in its stage and reduce it again")
    rim, sectors = body.rim, mount_spaces(body.teeth, body.rim.mounts)
    at_mounts = np.vstack([_mount_rows(body, rim, sector) for sector in sectors])
    give = np.eye(len(at_mounts)) + rim.mount_stiffness * _residual(body, rim, sectors)
    stiffness = rim.mount_stiffness * np.linalg.inv(give)
    mass, elastic = np.eye(6 + body.modes), np.zeros(6 + body.modes)
    mass[:3, :3], mass[3:6, 3:6] = body.mass * np.eye(3), body.inertia
    elastic[6:] = (2 * np.pi * body.frequency) ** 2
    held = at_mounts.T @ (0.5 * (stiffness + stiffness.T)) @ at_mounts
    return np.asarray(np.sqrt(sl.eigh(np.diag(elastic) + held, mass, eigvals_only=True)) / (2 * np.pi))


def turned_rows(body: ReducedBody, rows: np.ndarray, sector: int) -> np.ndarray:
    """Rows (m, n) of sector 0 as those of another sector, in its own frame (docs/architecture.md)."""
    theta = 2 * np.pi * body.nodal_diameter * sector / body.teeth
    first, second, single = (np.flatnonzero(body.part == part) for part in (1, 2, 0))
    result = rows * np.cos(theta)
    c, s = np.cos(theta[first]), np.sin(theta[first])
    a, b = rows[:, first], rows[:, second]
    result[:, first], result[:, second] = a * c - b * s, a * s + b * c
    result[:, single] = rows[:, single] * np.cos(theta[single]).round()
    return result


def _mount_rows(body: ReducedBody, rim: Rim, sector: int) -> np.ndarray:
    """(3, 6 + n): displacement x, y, z of the patch of a sector, in its frame, under rigid motion and in the modes."""
    angle = 2 * np.pi * sector / body.teeth
    c, s = np.cos(angle), np.sin(angle)
    into_sector = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
    rigid = rigid_fields(rim.patch_point) @ into_sector
    return np.concatenate([rigid, turned_rows(body, rim.patch_rows, sector)], axis=1)


def _residual(body: ReducedBody, rim: Rim, sectors: list[int]) -> np.ndarray:
    """C_res between the mounts, (3·mounts, 3·mounts): static compliance of the free ring less that of its modes."""
    rows = rim.patch_rows
    weighted = rows / (2 * np.pi * body.frequency) ** 2
    free = [rim.static_pp[m] - weighted @ turned_rows(body, rows, m).T for m in range(body.teeth)]
    return np.block([[free[(n - m) % body.teeth] for n in sectors] for m in sectors])
