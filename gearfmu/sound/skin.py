"""The closed skin of a body: triangles that face outward, and the shapes of the body's coordinates on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree

from gearfmu.errors import GearfmuError


class SoundError(GearfmuError):
    """A skin, a spectrum or a run from which sound cannot be found."""


@dataclass(frozen=True)
class Skin:
    """points (P, 3) m; triangles (T, 3) numbers of points, counter-clockwise seen from outside; shapes (P, 3, N):
    displacement of the points per unit of N coordinates of the body, rigid motion and modes. `skin_of` makes one."""

    points: np.ndarray
    triangles: np.ndarray
    shapes: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        """(T, 3, 3) m."""
        return self.points[self.triangles]

    @property
    def normals(self) -> np.ndarray:
        """(T, 3), outward, as long as the triangles are large, m²."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    @property
    def volume(self) -> float:
        """m³, below 0 where the triangles face inward."""
        return float((self.corners.mean(axis=1) * self.normals).sum() / 3)

    @property
    def gram(self) -> np.ndarray:
        """(N, N): ∫ φ_n φ_nᵀ dS of the normal displacements φ_n, linear over each triangle; symmetric, not negative."""
        area = np.linalg.norm(self.normals, axis=1)
        normal = np.einsum("tckn,tk->tcn", self.shapes[self.triangles], self.normals / area[:, None])
        total = normal.sum(axis=1)
        corners = np.einsum("t,tcn,tcm->nm", area / 12, normal, normal)
        return corners + np.einsum("t,tn,tm->nm", area / 12, total, total)


def skin_of(points: np.ndarray, faces: Sequence[Sequence[int]] | np.ndarray, shapes: np.ndarray) -> Skin:
    """A skin out of triangles and quadrilaterals, F rows of three or four numbers of points, the last one
    repeated in a triangle; quadrilaterals are cut along their shorter diagonal. points (P, 3) m, shapes (P, 3, N).

    Raises SoundError, which names every hole with its place and size, for faces that close no volume, and for a skin
    that is turned inside out.
    """
    points, shapes = np.asarray(points, dtype=float), np.asarray(shapes, dtype=float)
    skin = Skin(points, _triangles(points, faces), shapes)
    used, turns = np.unique(_edges(skin.triangles), axis=0, return_counts=True)
    keys = {(int(a), int(b)) for a, b in used}
    open_edges = np.array([(a, b) for a, b in sorted(keys) if (b, a) not in keys], dtype=int).reshape(-1, 2)
    if len(open_edges):
        raise SoundError("the skin is not closed: " + "; ".join(_holes(points, open_edges)) + "; close it with faces")
    if (turns > 1).any():
        place = _place(points[used[turns > 1][0]].mean(axis=0))
        raise SoundError(f"the skin's faces are not turned alike, or meet more than twice at an edge, as at {place}")
    if skin.volume <= 0:
        raise SoundError("the skin is turned inside out: list the corners of its faces counter-clockwise from outside")
    return skin


def envelope(points: np.ndarray, edge: float) -> Skin:
    """The convex envelope of points (P, 3) m in triangles of edges up to `edge` (m), without shapes."""
    hull = ConvexHull(points)
    triangles = hull.simplices.copy()
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    inward = np.einsum("tk,tk->t", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    kept, numbers = np.unique(triangles, return_inverse=True)
    return refined(skin_of(points[kept], numbers.reshape(triangles.shape), np.zeros((len(kept), 3, 0))), edge)


def refined(skin: Skin, edge: float) -> Skin:
    """The skin with every edge longer than `edge` (m) halved until none is; shapes are linear along edges."""
    points, triangles, shapes = skin.points, skin.triangles, skin.shapes
    while True:
        ends = np.sort(_edges(triangles), axis=1)
        unique, back = np.unique(ends, axis=0, return_inverse=True)
        long = np.linalg.norm(points[unique[:, 0]] - points[unique[:, 1]], axis=1) > edge
        if not long.any():
            return Skin(points, triangles, shapes)
        middle = np.where(long, len(points) + np.cumsum(long) - 1, -1)[back].reshape(3, -1).T
        points = np.concatenate([points, points[unique[long]].mean(axis=1)])
        shapes = np.concatenate([shapes, shapes[unique[long]].mean(axis=1)])
        triangles = _divided(triangles, middle)


def _divided(triangles: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Triangles cut at the middles (T, 3) of their edges 01, 12, 20; −1 where an edge stays whole."""
    parts = []
    for turn in range(3):  # every case once, with the triangle turned so that the case is the one that is written
        t, m = np.roll(triangles, -turn, axis=1), np.roll(middle, -turn, axis=1)
        cut = m >= 0
        one, two, all_three = ((cut == case).all(axis=1) for case in ((1, 0, 0), (1, 1, 0), (1, 1, 1)))
        (a, b, c), (ab, _, _) = t[one].T, m[one].T
        parts += [np.stack(own, axis=1) for own in ((a, ab, c), (ab, b, c))]
        (a, b, c), (ab, bc, _) = t[two].T, m[two].T
        parts += [np.stack(own, axis=1) for own in ((ab, b, bc), (a, ab, bc), (a, bc, c))]
        if turn == 0:
            (a, b, c), (ab, bc, ca) = t[all_three].T, m[all_three].T
            parts += [np.stack(own, axis=1) for own in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([triangles[(middle < 0).all(axis=1)], *parts])


def patches(skin: Skin, count: int) -> np.ndarray:
    """(T,): the patch, 0 … n − 1 with n ≤ count, of each triangle. Patches are compact in place and normal: seeds that
    lie furthest apart, each triangle with the nearest one."""
    area = np.linalg.norm(skin.normals, axis=1)
    if len(area) <= count:
        return np.arange(len(area))
    apart = 1.5 * np.sqrt(area.sum() / count)  # m of distance between perpendicular normals, over √2
    where = np.hstack([skin.corners.mean(axis=1), apart * skin.normals / area[:, None]])
    seeds, nearest = [0], ((where - where[0]) ** 2).sum(axis=1)
    while len(seeds) < count:
        seeds.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, ((where - where[seeds[-1]]) ** 2).sum(axis=1))
    return np.unique(cKDTree(where[seeds]).query(where)[1], return_inverse=True)[1]


def _triangles(points: np.ndarray, faces: Sequence[Sequence[int]] | np.ndarray) -> np.ndarray:
    """(T, 3): triangles as they are, quadrilaterals cut along their shorter diagonal."""
    three = [face[:3] for face in faces if len(face) == 3 or face[3] == face[2]]
    whole = np.array(three, dtype=int).reshape(-1, 3)
    quads = np.array([face for face in faces if len(face) == 4 and face[3] != face[2]], dtype=int).reshape(-1, 4)
    across = np.linalg.norm(points[quads[:, [0, 1]]] - points[quads[:, [2, 3]]], axis=2)
    turned = np.where(across[:, :1] <= (1 + 1e-9) * across[:, 1:], quads, np.roll(quads, -1, axis=1))
    return np.concatenate([whole, turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])


def _edges(triangles: np.ndarray) -> np.ndarray:
    """(3T, 2): first all edges 01, then 12, then 20, in the direction of the triangles."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _holes(points: np.ndarray, edges: np.ndarray) -> list[str]:
    """Place and size of every connected set of edges that belong to one face only."""
    kept, numbers = np.unique(edges, return_inverse=True)
    numbers = numbers.reshape(edges.shape)
    joined = coo_matrix((np.ones(len(edges)), numbers.T), shape=(len(kept), len(kept)))
    count, label = connected_components(joined, directed=False)
    found = []
    for own in (points[kept[label == k]] for k in range(count)):
        size = np.linalg.norm(np.ptp(own, axis=0))
        found.append(f"hole of {len(own)} edges, {1e3 * size:.4g} mm across, at {_place(own.mean(axis=0))}")
    return found


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{1e3 * x:.4g}" for x in point) + ") mm"
