"""A small ring with a bore and bolts as a FullOrder, interfaces as averaging nodes: free, or on springs."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from blocks import STEEL, ring

from gearfmu.fem import hex20
from gearfmu.fem.coupling import averaging_rows_uniform, rigid_modes
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface

INNER, OUTER, HEIGHT = 0.02, 0.05, 0.012


def averaging(name: str, nodes: np.ndarray, chosen: np.ndarray) -> Interface:
    """Averaging node of the chosen nodes at their middle."""
    point = nodes[chosen].mean(axis=0)
    rows = averaging_rows_uniform(nodes - point, chosen)
    return Interface(name, sp.csr_array(rows), COMPONENTS, point, "averaging")


def ring_body(cells: tuple[int, int, int] = (2, 12, 1), bolts: int = 2, outer: float = OUTER) -> FullOrder:
    """A free ring; the bore is ground, `bolts` patches on the outer half of one face are loaded.

    outer : outer radius; the same mesh stretched."""
    nodes, elements = ring(cells, INNER, OUTER, HEIGHT)
    radius = np.hypot(nodes[:, 0], nodes[:, 1])
    nodes[:, :2] *= ((INNER + (radius - INNER) * (outer - INNER) / (OUTER - INNER)) / radius)[:, None]
    radius = np.hypot(nodes[:, 0], nodes[:, 1])
    chosen = {"bore": radius < INNER * 1.0001}
    for k in range(bolts):
        at_face = (nodes[:, 2] > 0.49 * HEIGHT) & (radius > 0.6 * INNER + 0.4 * outer)
        chosen[f"bolt_{k + 1}"] = at_face & _near(nodes, 2 * np.pi * k / bolts)
    return _free("ring", nodes, elements, chosen)


def _near(nodes: np.ndarray, angle: float) -> np.ndarray:
    """True for nodes within 0.32 rad of an angle about z."""
    off = np.arctan2(nodes[:, 1], nodes[:, 0]) - angle
    return np.abs((off + np.pi) % (2 * np.pi) - np.pi) < 0.32


def _free(name: str, nodes: np.ndarray, elements: np.ndarray, chosen: dict[str, np.ndarray]) -> FullOrder:
    """A free body with averaging nodes of the chosen nodes (N,) bool; the bore is ground."""
    stiffness, mass = hex20.assemble(nodes, elements, STEEL)
    return FullOrder(
        name=name,
        stiffness=stiffness,
        mass=mass,
        rigid=rigid_modes(nodes),
        interfaces=tuple(averaging(own, nodes, np.flatnonzero(which)) for own, which in chosen.items()),
        ground=("bore",),
        length=0.04,
        cells=elements,
        node_of_dof=np.repeat(np.arange(len(nodes)), 3),
    )


@lru_cache(maxsize=1)
def small() -> FullOrder:
    """Free ring of about a thousand unknowns, bore and two bolts: 18 rows."""
    return ring_body()


@lru_cache(maxsize=1)
def tiny() -> FullOrder:
    """A ring so small that dense matrices and full bases are cheap: a bore and two bolts."""
    return ring_body((1, 10, 1))


@lru_cache(maxsize=1)
def mounted() -> FullOrder:
    """The small ring on springs at its bore, nothing else held: no rigid modes."""
    body = small()
    mount = body.rows("bore")[:3]
    springs = sp.csr_array(mount.T @ sp.diags_array([3e8, 4e8, 5e8]) @ mount)
    turning = body.rows("bore")[3:]
    springs = springs + sp.csr_array(turning.T @ sp.diags_array([1e5, 1e5, 2e5]) @ turning)
    bore_nodes = np.unique(body.node_of_dof[np.unique(mount.indices)])
    cells = np.full((len(body.cells) + 1, max(len(bore_nodes), body.cells.shape[1])), -1)
    cells[:-1, : body.cells.shape[1]] = body.cells
    cells[-1, : len(bore_nodes)] = bore_nodes
    return replace(
        body,
        name="mounted ring",
        stiffness=sp.csr_array(body.stiffness + springs),
        rigid=np.zeros((body.size, 0)),
        interfaces=body.interfaces[1:],
        ground=(),
        cells=cells,
    )


def direct(body: FullOrder, frequency: float, damping_ratio: float) -> np.ndarray:
    """H (m, m) at one line by factorising K(1 + 2iζ) − Ω²M of the full model, ground held by constraint."""
    held = body.grounded()
    matrix = held.stiffness * (1 + 2j * damping_ratio) - (2 * np.pi * frequency) ** 2 * held.mass
    factor = spl.splu(sp.csc_matrix(matrix), "MMD_AT_PLUS_A")
    rows = sp.csr_array(sp.diags_array(held.scales()) @ held.rows())
    response = factor.solve(rows.T.toarray().astype(complex))
    if held.constraints is not None:
        reaction = factor.solve(held.constraints.T.toarray().astype(complex))
        carried = np.linalg.solve(held.constraints @ reaction, held.constraints @ response)
        response = response - reaction @ carried
    return rows @ response
