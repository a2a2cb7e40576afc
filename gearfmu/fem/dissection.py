"""Nested dissection of a finite-element mesh: which unknowns are eliminated together, and in what order.

The elements are split in two halves again and again along the Fiedler vector of their neighbourhood graph; the nodes
common to both halves separate them and are eliminated after both. Source: George, SIAM J. Numer. Anal. 10 (1973) 345;
spectral bisection: Pothen, Simon & Liou, SIAM J. Matrix Anal. 11 (1990) 430.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

_LEAF = 10  # elements that are not split further
_DENSE = 300  # elements up to which the Fiedler vector is found by a dense eigensolver


def nested_dissection(cells: np.ndarray) -> list[np.ndarray]:
    """Groups of nodes in order of elimination, separators after the parts that they separate.

    cells : (E, k) node numbers of each element, −1 for none. Every node that occurs is in exactly one group.
    """
    groups: list[np.ndarray] = []
    _dissect(cells, _neighbours(cells), np.arange(len(cells)), np.zeros(cells.max() + 2, bool), groups)
    return [group for group in groups if len(group)]


def _dissect(cells: np.ndarray, graph: sp.csr_array, part: np.ndarray, done: np.ndarray, groups: list) -> None:
    """Append the groups of the elements `part`, whose nodes marked `done` belong to separators further up."""
    if len(part) <= _LEAF:
        groups.append(_open_nodes(cells[part], done))
        return
    half = _bisect(graph[part][:, part])
    first, second = part[half], part[~half]
    separator = np.intersect1d(_open_nodes(cells[first], done), _open_nodes(cells[second], done))
    done[separator] = True
    _dissect(cells, graph, first, done, groups)
    _dissect(cells, graph, second, done, groups)
    groups.append(separator)


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


def _bisect(graph: sp.csr_array) -> np.ndarray:
    """True for one half of the elements, the smaller entries of the Fiedler vector."""
    laplacian = sp.csc_array(sp.diags(graph.sum(axis=1)) - graph)
    size = laplacian.shape[0]
    if size <= _DENSE:
        fiedler = np.linalg.eigh(laplacian.toarray())[1][:, 1]
    else:
        shift = -1e-3 * laplacian.diagonal().mean()
        start = np.cos(np.arange(size))
        fiedler = spl.eigsh(laplacian, k=2, sigma=shift, v0=start, tol=1e-3)[1][:, 1]
    half = np.zeros(size, bool)
    half[np.argsort(fiedler, kind="stable")[: size // 2]] = True
    return half
