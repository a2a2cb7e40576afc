"""A body before reduction, whatever it came from: matrices, rigid fields and the interfaces at which it is loaded.

M q̈ + K q = Σ Bᵢᵀ fᵢ − Cᵀ λ,  C q = 0,  uᵢ = Bᵢ q. Unknowns q are nodal displacements; a rigid coupling (RBE2) has
replaced those of its surface by the six of its master node, an averaging coupling (RBE3) adds none: the motion of its
node is a mean.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from gearfmu.fem.repeated import Parts

COMPONENTS = ("ux", "uy", "uz", "rx", "ry", "rz")


@dataclass(frozen=True)
class Interface:
    """Where a body is loaded and read: rows B (k, N), the motion of its node (m, rad); Bᵀ spreads N and N·m.

    components : names of the rows, for a master node `COMPONENTS`. point : (3,) m, where the node lies.
    kind : "rigid" (RBE2), "averaging" (RBE3), "nodes" (displacements of a node) or "strip" (load strip of a flank).
    """

    name: str
    rows: sp.csr_array
    components: tuple[str, ...]
    point: np.ndarray
    kind: str


@dataclass(frozen=True, eq=False)
class FullOrder:
    """Finite elements of one body with everything that loads it; nothing is reduced yet.

    stiffness, mass : (N, N) symmetric; a body on elastic mounts carries them in its stiffness.
    rigid : (N, r) rigid-body fields, the kernel of K: six columns for a free body (translation x, y, z, rotation x, y,
    z about the origin), none for a mounted one. interfaces : in the order of the transfer matrix.
    ground : names of the interfaces that are held when the reduction is judged; they are no inputs then.
    length : m, rotations are multiplied by it (and moments divided) in the transfer matrix.
    cells, node_of_dof : (E, k) node numbers of each element (−1: none) and (N,) the node of each unknown, for
    `fem.factor.Factor`: two unknowns may be coupled only if their nodes share a cell (a rigid coupling is one cell).
    constraints : (c, N) rows C of what is held, None for nothing; `rigid` stays the kernel of K.
    parts : the equal parts about z that K and M consist of; None where there are none.
    """

    name: str
    stiffness: sp.csr_array
    mass: sp.csr_array
    rigid: np.ndarray
    interfaces: tuple[Interface, ...]
    ground: tuple[str, ...]
    length: float
    cells: np.ndarray
    node_of_dof: np.ndarray
    constraints: sp.csr_array | None = None
    parts: Parts | None = None

    @property
    def size(self) -> int:
        """Number N of unknowns."""
        return self.stiffness.shape[0]

    def rows(self, *names: str) -> sp.csr_array:
        """Rows of the named interfaces (all of them without a name), one below the other: (m, N)."""
        chosen = [i for i in self.interfaces if not names or i.name in names]
        return sp.csr_array(sp.vstack([i.rows for i in chosen]))

    def scales(self) -> np.ndarray:
        """Factors that make rotations of the interfaces lengths: `length` for rx, ry, rz, else 1; (m,)."""
        turning = [component in COMPONENTS[3:] for i in self.interfaces for component in i.components]
        return np.where(turning, self.length, 1.0)

    def held(self, rows: sp.csr_array) -> FullOrder:
        """The same body with `rows` q = 0 besides what is held already."""
        before = [] if self.constraints is None else [self.constraints]
        return replace(self, constraints=sp.csr_array(sp.vstack([*before, rows])))

    def grounded(self) -> FullOrder:
        """The body with its ground interfaces held; they are no interfaces any more. Itself when it has none."""
        if not self.ground:
            return self
        others = tuple(i for i in self.interfaces if i.name not in self.ground)
        return replace(self.held(self.rows(*self.ground)), interfaces=others, ground=())
