"""A gear sector made elsewhere, reduced like our own: the same harmonics, tables and errors on its mesh."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.fem.hex20 import Material
from gearfmu.fem.surface import Faces
from gearfmu.femesh.cyclic_cut import CyclicCut
from gearfmu.femesh.imported import repeated_cells
from gearfmu.femesh.mesh import FeMesh
from gearfmu.reduction.cyclic.flank import Direction, Points, ToothFlank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.imported.flank import tooth_loads


class ImportedSector(SectorBody):
    """`SectorBody` on a cut of an imported mesh.

    cut : the sector in the gear's frame. bore : its nodes on the bore (of a ring: on the rim). elastic : a material,
    or ready-made stiffness (N/m) and mass (kg) of the free sector. Raises MeshError when flanks or bore of the mesh
    are not as they should be.
    """

    def __init__(
        self,
        cut: CyclicCut,
        bore: np.ndarray,
        teeth: int,
        elastic: Material | tuple[sp.csr_array, sp.csr_array],
        flank: tuple[ToothFlank, Points],
    ):
        self.cut, self.teeth = cut, teeth
        self.flank, self.points = flank
        self.internal = self.flank.internal
        sets = {"rim" if self.internal else "bore": bore}
        self.mesh = FeMesh(cut.nodes, repeated_cells(cut.elements), sets, teeth, cut.cut_minus, cut.cut_plus)
        self.faces = solids.boundary(cut.elements)
        matrices = elastic if isinstance(elastic, tuple) else solids.assemble(cut.nodes, cut.elements, elastic)
        self.stiffness, self.mass_matrix = matrices
        self.spaces = sector_spaces(
            Sector(cut.nodes, self.mesh.elements, self.stiffness, self.mass_matrix, teeth, cut.cut_minus, cut.cut_plus)
        )
        self.load_matrix = self._all_loads()

    def _tooth_rows(self, direction: Direction | None = None) -> sp.csr_array:
        return tooth_loads(self.cut.nodes, self.faces, self.flank, self.points, direction=direction)

    @cached_property
    def patch_rows(self) -> np.ndarray:
        """Mean displacement x, y, z of the sector's patch of the rim, (3, 3N), at `patch_point`; (0, 3N) of a gear."""
        if not self.internal:
            return np.zeros((0, self.cut.nodes.size))
        return averaging_rows(self.cut.nodes - self.patch_point, self._held_faces)[:3]

    @property
    def _held_faces(self) -> Faces:
        return self.faces.within(self._held_nodes)

    @property
    def knows_stress(self) -> bool:
        """No: material and elements may be another program's."""
        return False
