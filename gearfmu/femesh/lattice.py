"""Lattices of nodes: grading, transfinite interpolation, quadrilaterals of a lattice, extrusion to hexahedra."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def graded(elements: int, growth: float) -> np.ndarray:
    """Parameters (2·elements + 1,) from 0 to 1 of corner and mid nodes; elements grow by the factor `growth`."""
    return _parameters(growth ** np.arange(elements))


def graded_to_both(elements: int, growth: float) -> np.ndarray:
    """The same with elements that grow from either end to the middle."""
    place = np.arange(elements)
    return _parameters(growth ** np.minimum(place, place[::-1]))


def transfinite(low: np.ndarray, high: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Lattice (P, Q, 2) between the curves low, high (P, 2), first and last of the second index, and start, end (Q, 2).

    Gordon and Hall's interpolation with the curves' own arc-length parameters, so that gradings of opposite sides
    need not agree.
    """
    u0, u1, v0, v1 = (parameter(curve) for curve in (low, high, start, end))
    du, dv = (u1 - u0)[:, None], (v1 - v0)[None, :]
    u = (u0[:, None] + du * v0[None, :]) / (1 - du * dv)
    v = (v0[None, :] + dv * u0[:, None]) / (1 - du * dv)
    u, v = u[..., None], v[..., None]
    result = (1 - v) * low[:, None] + v * high[:, None] + (1 - u) * start[None] + u * end[None]
    result -= (1 - u) * (1 - v) * low[0] + u * (1 - v) * low[-1] + (1 - u) * v * high[0] + u * v * high[-1]
    result[:, 0], result[:, -1], result[0], result[-1] = low, high, start, end
    return result


def parameter(curve: np.ndarray) -> np.ndarray:
    """Share (P,) of its length, chords taken, at which each point of a curve (P, 2) lies."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()


def quads_of(lattice: np.ndarray) -> np.ndarray:
    """Coordinates (E, 8, 2) of the counter-clockwise quadrilaterals of a lattice (2a+1, 2b+1, 2)."""
    rows, columns = lattice.shape[0] // 2, lattice.shape[1] // 2
    steps = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    quads = np.stack(
        [lattice[i : i + 2 * rows - 1 : 2, j : j + 2 * columns - 1 : 2] for i, j in steps], axis=2
    ).reshape(-1, 8, 2)
    first, last = quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0]
    clockwise = np.median(first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0]) < 0
    return quads[:, [0, 3, 2, 1, 7, 6, 5, 4]] if clockwise else quads


def mirrored(quads: np.ndarray) -> np.ndarray:
    """Mirror image about y = 0 of quadrilaterals (E, 8, 2), counter-clockwise again."""
    return (quads * [1, -1] + 0.0)[:, [0, 3, 2, 1, 7, 6, 5, 4]]


def edges(line: np.ndarray) -> np.ndarray:
    """(F, 3) start, end, middle of the elements along a line of 2F + 1 nodes."""
    return np.stack([line[:-2:2], line[2::2], line[1::2]], axis=1)


def extruded(quads: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Coordinates (L·E, 20, 3) of hexahedra (VTK order) over quadrilaterals (E, 8, 2) between levels z (2L + 1,)."""
    corner, middle = quads[:, :4], quads[:, 4:]
    layers = []
    for k in range(0, len(z) - 2, 2):
        parts = [(corner, z[k]), (corner, z[k + 2]), (middle, z[k]), (middle, z[k + 2]), (corner, z[k + 1])]
        layers.append(np.concatenate([_at_level(plane, level) for plane, level in parts], axis=1))
    return np.concatenate(layers)


def numbered(elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (N, 3) and elements (E, 20) from coordinates (E, 20, 3); nodes coincide where they are exactly equal."""
    nodes, index = np.unique((elements + 0.0).reshape(-1, 3), axis=0, return_inverse=True)
    return nodes, index.reshape(-1, 20)


def _parameters(sizes: np.ndarray) -> np.ndarray:
    """Corner and mid nodes from 0 to 1 of elements of these sizes."""
    corners = np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    corners[-1] = 1.0
    result = np.empty(2 * len(sizes) + 1)
    result[::2] = corners
    result[1::2] = 0.5 * (corners[1:] + corners[:-1])
    return result


def _at_level(plane: np.ndarray, level: float) -> np.ndarray:
    return np.concatenate([plane, np.full((*plane.shape[:2], 1), level)], axis=2)


def finder(nodes: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Index of points (P, 2) that are rows of a unique array, by exact equality."""
    index = {(x, y): k for k, (x, y) in enumerate(nodes.tolist())}
    return lambda points: np.array([index[x, y] for x, y in (points + 0.0).tolist()])
