"""Sound of a vibrating closed surface in free air: boundary elements by collocation, with CHIEF points.

Surface pressure p and normal velocity v, time factor e^{iωt}, k = ω/c, G = e^{−ikr}/(4πr), r = |y − x|, n outward:

    ½ p(x) − ∫ ∂G/∂n_y p dS = iωρ ∫ G v dS,  x on the surface;      −∫ ∂G/∂n_y p dS = iωρ ∫ G v dS,  x inside       (1)

Pressure and velocity are constant over a patch of triangles. The static parts of both integrals are closed forms of the
triangle's corners (potential of a plane polygon; solid angle), found once; the rest of the kernels is smooth. The
equations on the surface alone fail at the resonances of the volume inside; those at points inside, held exactly by
multipliers, make the solution unique. The power follows from the far field,

    F(d) = 1/4π ∫ [ik (d·n) p + iωρ v] e^{ik d·y} dS,      W = 1/(2ρc) ∫ |F|² dΩ                                     (2)

so it is never negative, and small where radiation is weak; ½ Re ∫ p v* dS on the surface must give the same power.

Sources: H. A. Schenck, J. Acoust. Soc. Am. 44 (1968) 41 (CHIEF); A. Van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng.
30 (1983) 125 (solid angle); D. R. Wilton et al., IEEE Trans. Antennas Propag. 32 (1984) 276 (potential of polygons).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from gearfmu.sound.skin import Skin, SoundError, patches

INSIDE = 25  # patches per point inside
FEWEST, MOST = 12, 120  # points inside
FINE = 2.5  # triangles a patch from which one point of integration a triangle is enough
CHUNK = 2_000_000  # pairs of points that are integrated together
CORNER = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6  # rule of degree 2 on a triangle
_PAIR = 8 * 2 + 16 * 4  # bytes a pair of patches: static parts, both kernels, the system and its factors


def memory_needed(count: int, coordinates: int) -> int:
    """Bytes that a surface of `count` patches with so many coordinates takes."""
    return _PAIR * (count + MOST) ** 2 + CHUNK * 8 * 24 + 16 * 4 * count * coordinates


@dataclass(frozen=True)
class Surface:
    """n patches and their static integrals, `surface_of` a skin. area (n,) m²; velocity (n, N): mean normal velocity of
    each patch per unit velocity of N coordinates; at (n + c, 3): points of collocation, the last c of them inside;
    source (Q, 3), normal (Q, 3), weight (Q,), patch (Q,): points of integration, sorted by patch; single, double
    (n + c, n): ∫ 1/(4πr) dS in m and ∫ ∂(1/4πr)/∂n dS."""

    area: np.ndarray
    velocity: np.ndarray
    at: np.ndarray
    source: np.ndarray
    normal: np.ndarray
    weight: np.ndarray
    patch: np.ndarray
    single: np.ndarray
    double: np.ndarray

    @property
    def edge(self) -> float:
        """m: side of a square as large as the largest patch."""
        return float(np.sqrt(self.area.max()))

    def pressure(self, k: float) -> np.ndarray:
        """(n, N): surface pressure over ρc per unit velocity of each coordinate, at the wave number k (1/m)."""
        system, right = self._kernels(k)
        n, inside = len(self.area), len(self.at) - len(self.area)
        system[np.arange(n), np.arange(n)] += 0.5
        border = np.zeros((inside, inside))
        whole = np.block([[system[:n], system[n:].conj().T], [system[n:], border]])
        return np.linalg.solve(whole, right)[:n]

    def _kernels(self, k: float) -> tuple[np.ndarray, np.ndarray]:
        """−∫ ∂G/∂n dS (n + c, n) and ik ∫ G v dS (n + c, N)."""
        double = np.empty((len(self.at), len(self.area)), dtype=complex)
        right = np.empty((len(self.at), self.velocity.shape[1]), dtype=complex)
        first = np.flatnonzero(np.diff(self.patch, prepend=-1))
        weight = self.weight / (4 * np.pi)
        for rows in _chunks(len(self.at), len(self.source)):
            away = self.source[None] - self.at[rows, None]
            r = np.maximum(np.linalg.norm(away, axis=2), 1e-9 * self.edge)
            wave = np.exp(-1j * k * r)
            single = np.add.reduceat(weight * (wave - 1) / r, first, axis=1)
            slope = weight * np.einsum("xqk,qk->xq", away, self.normal) / r**3
            double[rows] = np.add.reduceat(slope * ((1 + 1j * k * r) * wave - 1), first, axis=1) - self.double[rows]
            right[rows] = 1j * k * ((single + self.single[rows]) @ self.velocity)
        return double, right

    def resistance(self, k: float, pressure: np.ndarray) -> np.ndarray:
        """(N, N) m²: R/ρc from the far field of `pressure(k)`, symmetric and not negative."""
        radius = np.linalg.norm(self.source, axis=1).max()
        order = int(np.ceil(k * radius)) + 8
        height, share = np.polynomial.legendre.leggauss(order)
        turn = np.arange(2 * order) * np.pi / order
        level = np.sqrt(1 - height**2)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        direction = np.concatenate(
            [np.c_[s * circle, np.full(len(turn), z)] for s, z in zip(level, height, strict=True)]
        )
        first = np.flatnonzero(np.diff(self.patch, prepend=-1))
        wave = self.weight * np.exp(1j * k * direction @ self.source.T)
        far = np.add.reduceat(wave * (direction @ self.normal.T), first, axis=1) @ pressure
        far += np.add.reduceat(wave, first, axis=1) @ self.velocity
        far *= (k / (4 * np.pi)) * np.sqrt(np.repeat(share, len(turn)) * np.pi / order)[:, None]
        return np.real(far.conj().T @ far)

    def near(self, pressure: np.ndarray) -> np.ndarray:
        """(N, N) m²: R/ρc from the power that leaves the surface, Re ∫ v p dS; not symmetric."""
        return np.real(self.velocity.T @ (self.area[:, None] * pressure))


def surface_of(skin: Skin, count: int) -> Surface:
    """At most `count` patches on a skin about its own middle. SoundError for a skin too thin for points inside."""
    label = patches(skin, count)
    order = np.argsort(label, kind="stable")
    label, triangles, normals = label[order], skin.triangles[order], skin.normals[order]
    corners = skin.points[triangles] - skin.corners.mean(axis=(0, 1))
    size, first = np.linalg.norm(normals, axis=1), np.flatnonzero(np.diff(label, prepend=-1))
    area = np.add.reduceat(size, first)
    flow = np.einsum("tkn,tk->tn", skin.shapes[triangles].mean(axis=1), normals)
    centre = corners.mean(axis=1)
    middle = np.add.reduceat(size[:, None] * centre, first) / area[:, None]
    off = ((centre - middle[label]) ** 2).sum(axis=1)
    nearest = np.lexsort((off, label))[first]  # the triangle of each patch that is nearest to its middle
    at = np.concatenate([centre[nearest], _inside(corners, centre, np.sqrt(area.mean()), len(area))])
    own = np.full(len(at), -1)
    own[: len(nearest)] = nearest
    parts = [_static(corners, normals, at[rows], own[rows], first) for rows in _chunks(len(at), len(corners))]
    rule = CORNER if len(triangles) < FINE * len(area) else np.full((1, 3), 1 / 3)
    times = len(rule)
    return Surface(
        area=area,
        velocity=np.add.reduceat(flow, first) / area[:, None],
        at=at,
        source=np.einsum("qc,tck->tqk", rule, corners).reshape(-1, 3),
        normal=np.repeat(normals / size[:, None], times, axis=0),
        weight=np.repeat(size / times, times),
        patch=np.repeat(label, times),
        single=np.concatenate([single for single, _ in parts]),
        double=np.concatenate([double for _, double in parts]),
    )


def _static(
    corners: np.ndarray, normals: np.ndarray, at: np.ndarray, own: np.ndarray, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """∫ 1/(4πr) dS and ∫ ∂(1/4πr)/∂n dS (x, n) over patches whose first triangles are given; own (x,): the triangle in
    whose plane a point lies, −1 for none, which contributes nothing to the latter."""
    height, angle = solid_angles(corners, normals, at)
    on = own >= 0
    angle[on, own[on]] = 0.0
    single = -height * angle
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    away = [corners[None, :, c] - at[:, None] for c in range(3)]
    far = [np.linalg.norm(own, axis=2) for own in away]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        side = corners[:, b] - corners[:, a]
        length = np.linalg.norm(side, axis=1)
        outward = np.cross(side / length[:, None], unit)
        distance = np.einsum("xtk,tk->xt", away[a], outward)
        around = far[a] + far[b]
        single += distance * np.log((around + length) / np.maximum(around - length, 1e-12 * length))
    return np.add.reduceat(single, first, axis=1) / (4 * np.pi), np.add.reduceat(-angle, first, axis=1) / (4 * np.pi)


def solid_angles(corners: np.ndarray, normals: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(x, T): distance of triangles (T, 3, 3) from points (x, 3) along their normals, and the solid angle under which
    each is seen, positive where the normal points away. All of a closed skin together: 4π inside, 0 outside."""
    a, b, c = (corners[None, :, i] - at[:, None] for i in range(3))
    far = [np.linalg.norm(own, axis=2) for own in (a, b, c)]
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    height = np.einsum("xtk,tk->xt", a, unit)
    product = 2 * height * np.linalg.norm(normals, axis=1)
    ab, bc, ca = (np.einsum("xtk,xtk->xt", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return height, 2 * np.arctan2(product, far[0] * far[1] * far[2] + ab * far[2] + bc * far[0] + ca * far[1])


def _inside(corners: np.ndarray, centre: np.ndarray, edge: float, count: int) -> np.ndarray:
    """(c, 3): points inside, spread evenly, 1.5 edges away from the skin, less where the body is thin."""
    wanted = int(np.clip(count // INSIDE, FEWEST, MOST))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    normals = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    trial = low + (high - low) * qmc.Halton(3, seed=1).random(16 * wanted)
    trial = trial[[np.abs(solid_angles(corners, normals, x[None])[1].sum()) > 2 * np.pi for x in trial]]
    if not len(trial):
        raise SoundError("the skin encloses hardly any volume: sound needs the outside of a closed body")
    gap = np.array([np.linalg.norm(centre - x, axis=1).min() for x in trial])
    deep = trial[gap > min(1.5 * edge, 0.5 * gap.max())]
    return deep[:wanted]


def _chunks(rows: int, columns: int) -> list[slice]:
    step = max(1, CHUNK // columns)
    return [slice(begin, min(begin + step, rows)) for begin in range(0, rows, step)]
