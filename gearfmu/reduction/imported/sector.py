"""A gear sector made elsewhere, reduced like our own: the same harmonics, tables and errors on its mesh."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows
from gearfmu.fem.surface import Faces
from gearfmu.femesh.cyclic_cut import CyclicCut
from gearfmu.femesh.imported import repeated_cells
from gearfmu.femesh.mesh import FeMesh
from gearfmu.reduction.cyclic.flank import Direction, Points, ToothFlank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.imported.couplings import Matrices
from gearfmu.reduction.imported.flank import tooth_loads


class ImportedSector(SectorBody):
    """`SectorBody` on a cut of an imported mesh.

    cut : the sector in the gear's frame. bore : its nodes on the bore (of a ring: on the rim). matrices : stiffness
    (N/m) and mass (kg) of the free sector. Raises MeshError when flanks or bore of the mesh are not as they should be.
    """

    def __init__(
        self, cut: CyclicCut, bore: np.ndarray, teeth: int, matrices: Matrices, flank: ToothFlank, points: Points
    ):
        self.faces = solids.boundary(cut.elements)
        sets = {"rim" if flank.internal else "bore": bore}
        mesh = FeMesh(cut.nodes, repeated_cells(cut.elements), sets, teeth, cut.cut_minus, cut.cut_plus)
        super().__init__(mesh, matrices, flank, points)

    def _tooth_rows(self, direction: Direction | None = None) -> sp.csr_array:
        return tooth_loads(self.mesh.nodes, self.faces, self.flank, self.points, direction=direction)

    @cached_property
    def patch_rows(self) -> np.ndarray:
        """Mean displacement x, y, z of the sector's patch of the rim, (3, 3N), at `patch_point`; (0, 3N) of a gear."""
        if not self.internal:
            return np.zeros((0, self.mesh.nodes.size))
        return averaging_rows(self.mesh.nodes - self.patch_point, self._held_faces)[:3]

    @property
    def _held_faces(self) -> Faces:
        return self.faces.within(self._held_nodes)
