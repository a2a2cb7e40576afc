"""An internal gear on elastic mounts: its modes, flank rows on every tooth, and one mean tooth table for the residual.

The free ring moves by its rigid motion r, its n modes q and its residual C_res. Each mount is a spring k on the mean
displacement of a patch of the rim; condensing what the residual gives way there,
    κ = k (I + k C_res,mm)⁻¹,   M = diag(M_r, I),   K = diag(0, ω²) + [R N]_mᵀ κ [R N]_m,
whose 6 + n modes Φ are those of the mounted ring. On tooth t
    N̂_f = ([R N]_f − C_res,fm κ [R N]_m) Φ,       Ĉ_res = C_res,ff − C_res,fm κ C_res,mf,
so that Σ N̂ N̂ᵀ/Ω² + Ĉ_res is the static compliance of the mounted finite elements exactly; above the n-th mode the
residual is quasi-static, as everywhere (theory, residual). Mounts break the cyclic symmetry of modes and rows; what is
left to the residual of a cut is tooth-cyclic to a few parts in a thousand, so its mean over the teeth is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sl

from gearfmu.body.reduced import ReducedBody, Rim
from gearfmu.errors import BodyError
from gearfmu.fem.coupling import rigid_fields
from gearfmu.geometry.planetary import mount_spaces


def _rim(body: ReducedBody) -> Rim:
    assert body.rim is not None, "a ring has a rim"
    return body.rim


@dataclass(frozen=True)
class MountedRing:
    """A ring on its mounts: frequency (6 + n,) Hz ascending, and everything at its tooth flanks.

    The six lowest-energy motions, rigid without mounts, are elastic modes here. Use `mounted`.
    """

    body: ReducedBody
    frequency: np.ndarray
    shapes: np.ndarray
    stiffness: np.ndarray
    _mount_rows: np.ndarray

    def flank_rows(self, tooth: int) -> np.ndarray:
        """Rows (2·R·A, 6 + n) of the flanks of tooth space `tooth` in the mounted modes, kg^-½."""
        at_mounts = self._flank_to_mounts(tooth) @ self.stiffness @ self._mount_rows
        return (_free_flank_rows(self.body, tooth) - at_mounts) @ self.shapes

    def mount_rows(self) -> np.ndarray:
        """Rows (3·mounts, 6 + n): displacement x, y, z of each mount's patch, in its sector's frame, kg^-½."""
        give = np.eye(len(self.stiffness)) - self._residual_mm @ self.stiffness
        return give @ self._mount_rows @ self.shapes

    def mount_forces(self) -> np.ndarray:
        """Force (3·mounts, 6 + n) of each mount on the ground per modal coordinate, sector's frame, N·kg^-½/m."""
        return _rim(self.body).mount_stiffness * self.mount_rows()

    def static(self, tooth: int, other: int) -> np.ndarray:
        """Compliance (2·R·A, 2·R·A), m/N, of the flanks of `tooth` under loads on those of `other`."""
        first, second = self.flank_rows(tooth), self.flank_rows(other)
        modal = (first / (2 * np.pi * self.frequency) ** 2) @ second.T
        return modal + self._residual(tooth, other)

    def static_mount_forces(self, tooth: int) -> np.ndarray:
        """Forces (3·mounts, 2·R·A) of the mounts on the ground under unit loads on the flanks of `tooth`, at rest."""
        modal = (self.mount_forces() / (2 * np.pi * self.frequency) ** 2) @ self.flank_rows(tooth).T
        return modal + self.stiffness @ self._flank_to_mounts(tooth).T

    def mean_residual(self, cut: float) -> np.ndarray:
        """The one mean tooth table (z, 2·R·A, 2·R·A), m/N, by tooth offset: compliance of everything but the modes
        below `cut` (Hz), averaged over the teeth."""
        table, _ = self._residual_tables(cut)
        return table

    def residual_spread(self, cut: float) -> float:
        """Largest deviation of a tooth's own residual from the mean table, relative to the table's largest entry."""
        table, own = self._residual_tables(cut)
        return float(np.abs(own - table[0]).max() / np.abs(table[0]).max())

    def _residual_tables(self, cut: float) -> tuple[np.ndarray, np.ndarray]:
        z, left = self.body.teeth, self.frequency >= cut
        weight = 1 / (2 * np.pi * self.frequency[left])
        rows = np.array([self.flank_rows(t)[:, left] * weight for t in range(z)])
        to_mounts = np.array([self._flank_to_mounts(t) for t in range(z)])
        root = np.linalg.cholesky(self.stiffness)
        free = _cyclic_flank(self.body) - self._modal_static_ff
        table = free + _mean_products(rows) - _mean_products(to_mounts @ root)
        own = free[0] + rows @ rows.transpose(0, 2, 1) - to_mounts @ self.stiffness @ to_mounts.transpose(0, 2, 1)
        return table, own

    def _residual(self, tooth: int, other: int) -> np.ndarray:
        """Ĉ_res between two teeth, beyond all stored modes."""
        offset = (other - tooth) % self.body.teeth
        block = _cyclic_flank(self.body)[offset] - self._modal_static_ff[offset]
        return block - self._flank_to_mounts(tooth) @ self.stiffness @ self._flank_to_mounts(other).T

    @cached_property
    def _modal_static_ff(self) -> np.ndarray:
        """Σ N Nᵀ/ω² of the free modes between flanks, by tooth offset: (z, 2·R·A, 2·R·A)."""
        return _modal_static(self.body, self.body.flank_rows.reshape(-1, self.body.modes), self.body.flank_rows)

    @cached_property
    def _residual_fm(self) -> np.ndarray:
        """C_res of flanks of space 0 per force on the patch of sector m: (z, 2·R·A, 3)."""
        rim, size = _rim(self.body), self.body.flank_rows[..., 0].size
        full = rim.static_fp.transpose(1, 0, 2, 3, 4).reshape(self.body.teeth, size, 3)
        return full - _modal_static(self.body, self.body.flank_rows.reshape(size, -1), rim.patch_rows)

    @cached_property
    def _residual_mm(self) -> np.ndarray:
        return _residual_mm(self.body)

    def _flank_to_mounts(self, tooth: int) -> np.ndarray:
        """C_res of the flanks of `tooth` per force on each mount: (2·R·A, 3·mounts)."""
        z = self.body.teeth
        return np.concatenate([self._residual_fm[(m - tooth) % z] for m in mount_sectors(self.body)], axis=1)


def mounted(body: ReducedBody) -> MountedRing:
    """The ring on the mounts that its file declares. Raises BodyError for a body without mounts."""
    if body.rim is None or body.rim.mounts == 0:
        raise BodyError(f"body '{body.name}' has no mounts: declare [ring.mounts] in its stage and reduce it again")
    at_mounts = np.vstack([_mount_rows(body, sector) for sector in mount_sectors(body)])
    give = np.eye(len(at_mounts)) + _rim(body).mount_stiffness * _residual_mm(body)
    stiffness = _rim(body).mount_stiffness * np.linalg.inv(give)
    stiffness = 0.5 * (stiffness + stiffness.T)
    mass, elastic = np.eye(6 + body.modes), np.zeros(6 + body.modes)
    mass[:6, :6] = _rigid_mass(body)
    elastic[6:] = (2 * np.pi * body.frequency) ** 2
    squared, shapes = sl.eigh(np.diag(elastic) + at_mounts.T @ stiffness @ at_mounts, mass)
    return MountedRing(body, np.sqrt(squared) / (2 * np.pi), shapes, stiffness, at_mounts)


def mount_sectors(body: ReducedBody) -> list[int]:
    """Sectors whose patches of the rim are held."""
    return mount_spaces(body.teeth, _rim(body).mounts)


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


def _rigid_mass(body: ReducedBody) -> np.ndarray:
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = body.mass * np.eye(3), body.inertia
    return mass


def _turn(sector: int, teeth: int) -> np.ndarray:
    """(6, 6): rigid motion in the body's frame → in the frame of a sector."""
    angle = 2 * np.pi * sector / teeth
    c, s = np.cos(angle), np.sin(angle)
    return np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))


def _mount_rows(body: ReducedBody, sector: int) -> np.ndarray:
    rigid = rigid_fields(_rim(body).patch_point) @ _turn(sector, body.teeth)
    return np.concatenate([rigid, turned_rows(body, _rim(body).patch_rows, sector)], axis=1)


def _free_flank_rows(body: ReducedBody, tooth: int) -> np.ndarray:
    size = body.flank_rows[..., 0].size
    rigid = _rim(body).flank_rigid.reshape(size, 6) @ _turn(tooth, body.teeth)
    return np.concatenate([rigid, turned_rows(body, body.flank_rows.reshape(size, -1), tooth)], axis=1)


def _modal_static(body: ReducedBody, rows: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Σ N Nᵀ/ω² between `rows` on tooth 0 and `others` on tooth m: (z, rows, others)."""
    others = others.reshape(-1, body.modes)
    weighted = rows / (2 * np.pi * body.frequency) ** 2
    return np.array([weighted @ turned_rows(body, others, m).T for m in range(body.teeth)])


def _residual_mm(body: ReducedBody) -> np.ndarray:
    """C_res between the mounts, (3·mounts, 3·mounts)."""
    free = _rim(body).static_pp - _modal_static(body, _rim(body).patch_rows, _rim(body).patch_rows)
    sectors = mount_sectors(body)
    return np.block([[free[(n - m) % body.teeth] for n in sectors] for m in sectors])


def _cyclic_flank(body: ReducedBody) -> np.ndarray:
    """C_ff of the free ring by tooth offset, (z, 2·R·A, 2·R·A). BodyError where the file does not hold all of them."""
    if not body.all_offsets:
        raise BodyError(f"body '{body.name}' keeps a few tooth offsets only, as helical ones do: no mean tooth table")
    size = body.flank_rows[..., 0].size
    return body.static_ff.transpose(2, 0, 3, 5, 1, 4, 6).reshape(body.teeth, size, size)


def _mean_products(rows: np.ndarray) -> np.ndarray:
    """Mean over teeth t of rows[t] rows[t + m]ᵀ for every offset m: (z, k, k), by the Fourier transform over teeth."""
    z = len(rows)
    spectrum = np.fft.rfft(rows, axis=0)
    products = spectrum.conj() @ spectrum.transpose(0, 2, 1)
    return np.fft.irfft(products, n=z, axis=0) / z
