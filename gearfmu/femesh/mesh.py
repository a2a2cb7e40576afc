"""The finite-element mesh of a gear or of one cyclic sector of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gearfmu.geometry.plane import about_z


@dataclass(frozen=True)
class LabelledMesh:
    """A mesh in the node numbers of its file: labels (N,), ascending, and nodes (N, 3) in its unit of length; cells:
    kind (names of meshio) → (E, k) labels in VTK order; sets: name → labels."""

    labels: np.ndarray
    nodes: np.ndarray
    cells: dict[str, np.ndarray]
    sets: dict[str, np.ndarray]


@dataclass(frozen=True)
class FlankGrid:
    """One flank of tooth 0 between root form and tip form point, as element faces.

    quads: (Q, 8) node indices, VTK_QUADRATIC_QUAD, normal by the right-hand rule out of the tooth; roll: (Q, 8)
    analytic roll s (m) of these nodes in the section at their z; z: (Q, 8) their face-width coordinate (m). Rows run
    along the flank (outer) and across the width (inner): shape = (along, across). All elements have the same length
    along the involute and their mid nodes halve it: s² is linear in the element's natural coordinate.
    """

    quads: np.ndarray
    roll: np.ndarray
    z: np.ndarray
    shape: tuple[int, int]


@dataclass(frozen=True)
class FeMesh:
    """Quadratic hexahedra.

    nodes: (N, 3) m. elements: (E, 20) node indices, VTK_QUADRATIC_HEXAHEDRON. sets: named node indices ("bore").
    teeth: number of equal sectors of the whole body (1: this is the whole body). cut_minus, cut_plus: (C,) node
    indices of the sector's faces at angle −π/z and +π/z (at z = 0 of a helical gear); cut_plus[i] is cut_minus[i]
    turned by 2π/z. flank: index 0 ↔ sg = +1, 1 ↔ sg = −1. twist: angle by which the transverse section turns about +z
    per metre of face width (rad/m, positive: right-handed).
    """

    nodes: np.ndarray
    elements: np.ndarray
    sets: dict[str, np.ndarray]
    teeth: int = 1
    cut_minus: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    cut_plus: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    flank: dict[int, FlankGrid] = field(default_factory=dict)
    twist: float = 0.0

    def sector_nodes(self, sector: int) -> np.ndarray:
        """(N,) indices in `full().nodes` of this sector's nodes turned by `sector` teeth."""
        owned = np.ones(len(self.nodes), dtype=bool)
        owned[self.cut_plus] = False
        local = np.cumsum(owned) - 1
        per_sector = int(owned.sum())
        index = local + per_sector * (sector % self.teeth)
        index[self.cut_plus] = local[self.cut_minus] + per_sector * ((sector + 1) % self.teeth)
        return index

    def full(self) -> FeMesh:
        """The whole body: all sectors joined at their cuts, node numbers sector by sector; flank grids of tooth 0."""
        if self.teeth == 1:
            return self
        owned = np.setdiff1d(np.arange(len(self.nodes)), self.cut_plus)
        index = [self.sector_nodes(k) for k in range(self.teeth)]
        angles = 2 * np.pi * np.arange(self.teeth) / self.teeth
        return FeMesh(
            nodes=np.concatenate([rotated(self.nodes[owned], angle) for angle in angles]),
            elements=np.concatenate([numbers[self.elements] for numbers in index]),
            sets={
                name: np.unique(np.concatenate([numbers[nodes] for numbers in index]))
                for name, nodes in self.sets.items()
            },
            flank={side: replace(grid, quads=index[0][grid.quads]) for side, grid in self.flank.items()},
            twist=self.twist,
        )


def rotated(points: np.ndarray, angle: float) -> np.ndarray:
    """Points (N, 3) turned about +z by `angle` (rad)."""
    return points @ about_z(-angle)
