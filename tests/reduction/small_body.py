"""A small ring with a bore and four bolts as a FullOrder: averaging nodes, one bolt-like master by elimination."""

from __future__ import annotations

import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import hex20
from gearfmu.fem.coupling import averaging_rows_uniform, rigid_modes
from gearfmu.reduction.full_order import COMPONENTS, FullOrder, Interface

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fem"))
from blocks import STEEL, ring  # noqa: E402

INNER, OUTER, HEIGHT = 0.02, 0.05, 0.012


def averaging(name: str, nodes: np.ndarray, chosen: np.ndarray) -> Interface:
    """Averaging node of the chosen nodes at their middle."""
    point = nodes[chosen].mean(axis=0)
    rows = averaging_rows_uniform(nodes - point, chosen)
    return Interface(name, sp.csr_array(rows), COMPONENTS, point, "averaging")


def ring_body(cells: tuple[int, int, int] = (2, 12, 1), bolts: int = 2, outer: float = OUTER) -> FullOrder:
    """A free ring; the bore is ground, `bolts` patches on the outer half of one face are loaded."""
    nodes, elements = ring(cells, INNER, outer, HEIGHT)
    stiffness, mass = hex20.assemble(nodes, elements, STEEL)
    radius, angle = np.hypot(nodes[:, 0], nodes[:, 1]), np.arctan2(nodes[:, 1], nodes[:, 0])
    interfaces = [averaging("bore", nodes, np.flatnonzero(radius < INNER * 1.0001))]
    for k in range(bolts):
        near = np.abs((angle - 2 * np.pi * k / bolts + np.pi) % (2 * np.pi) - np.pi) < 0.3
        patch = near & (nodes[:, 2] > 0.49 * HEIGHT) & (radius > 0.6 * INNER + 0.4 * outer)
        interfaces.append(averaging(f"bolt_{k + 1}", nodes, np.flatnonzero(patch)))
    return FullOrder(
        name="ring",
        stiffness=stiffness,
        mass=mass,
        rigid=rigid_modes(nodes),
        interfaces=tuple(interfaces),
        ground=("bore",),
        length=0.04,
        cells=elements,
        node_of_dof=np.repeat(np.arange(len(nodes)), 3),
    )


@lru_cache(maxsize=1)
def small() -> FullOrder:
    """Free ring of about a thousand unknowns, bore and two bolts: 18 rows."""
    return ring_body()
