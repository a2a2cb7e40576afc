"""The full-order gear body on one sector, with everything that loads it: tooth flanks and bore. An internal gear has
its rim in place of the bore, and the sector's own patch of the rim, where a mount may hold it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import averaging_rows, moved, rigid_modes, surface_moments
from gearfmu.fem.cyclic import Sector, sector_spaces
from gearfmu.fem.harmonic import Harmonic
from gearfmu.fem.spinning import growth, stress_stiffness
from gearfmu.femesh.mesh import FeMesh
from gearfmu.geometry.plane import frames
from gearfmu.reduction.cyclic.flank import Direction, Points, ToothFlank, flank_loads


class SectorBody:
    """A free gear body: finite elements of one sector, flank loads of tooth 0 and the averaging node of the bore.

    mesh : FeMesh of a gear sector; one with the set "rim" instead of "bore" is an internal gear's. elastic : material,
    SI, or ready-made stiffness (3N, 3N), N/m, and mass, kg, of the free sector.
    flank : ToothFlank. points : where the flanks are loaded. rigid_bore : the surface of the bore (of a ring: of the
    rim) moves as one rigid body, as on a stiff shaft; else it deforms about its mean motion.
    load_matrix : all loads of one tooth as rows over the sector's nodes: flank rows, patch rows, tangent rows.
    Raises MeshError when cuts, flanks or bore of the mesh are not as they should be.
    """

    def __init__(
        self,
        mesh: FeMesh,
        elastic: hex20.Material | tuple[sp.csr_array, sp.csr_array],
        flank: ToothFlank,
        points: Points,
        rigid_bore: bool = False,
    ):
        self.mesh, self.flank, self.points, self.teeth = mesh, flank, points, mesh.teeth
        self.material = None if isinstance(elastic, tuple) else elastic
        ready = elastic if isinstance(elastic, tuple) else hex20.assemble(mesh.nodes, mesh.elements, elastic)
        (self.stiffness, self.mass_matrix), self.internal = ready, "rim" in mesh.sets
        sector = Sector(
            mesh.nodes, mesh.elements, self.stiffness, self.mass_matrix, mesh.teeth, mesh.cut_minus, mesh.cut_plus,
            bool(flank.base_helix_angle), self._held_faces.nodes if rigid_bore else None,
        )  # fmt: skip
        self.spaces = sector_spaces(sector)
        loads = [self._tooth_rows(), sp.csr_array(self.patch_rows), self._tooth_rows(self.flank.tangent)]
        self.load_matrix = sp.csr_array(sp.vstack(loads))

    def _tooth_rows(self, direction: Direction | None = None) -> sp.csr_array:
        """Unit loads (side, roll, function) flattened along the flank normal or another direction: (2·R·A, 3N)."""
        both = [
            flank_loads(self.mesh.nodes, self.mesh.flank[s].quads, self.flank, s, self.points, direction)
            for s in (0, 1)
        ]
        return sp.csr_array(sp.vstack([sp.csr_array(rows.reshape(-1, self.mesh.nodes.size)) for rows in both]))

    @property
    def flank_count(self) -> int:
        """Number 2·R·A of flank loads of a tooth."""
        return 2 * len(self.points.rolls) * self.points.functions

    @cached_property
    def patch_rows(self) -> np.ndarray:
        """Mean displacement x, y, z of the sector's patch of the rim, (3, 3N), at `patch_point`; (0, 3N) of a gear."""
        if not self.internal:
            return np.zeros((0, self.mesh.nodes.size))
        return moved(averaging_rows(self.mesh.nodes, self._held_faces), self.patch_point)[:3]

    @property
    def patch_point(self) -> np.ndarray:
        """Where the patch's displacement is read: the mean of its nodes, (3,) m."""
        return self.mesh.nodes[self._held_nodes].mean(axis=0)

    @property
    def profile_loads(self) -> int:
        """Number of the first load along the profile in `load_matrix`."""
        return self.flank_count + len(self.patch_rows)

    @property
    def _held_faces(self) -> surface.Faces:
        return surface.faces_within(self.mesh.elements, self._held_nodes)

    @property
    def _held_nodes(self) -> np.ndarray:
        """Nodes of the sector on the bore, of a ring on its rim."""
        return self.mesh.sets["rim" if self.internal else "bore"]

    @cached_property
    def bore_moments(self) -> tuple[np.ndarray, np.ndarray]:
        """One sector's share of the bore's (ring: rim's) averaging node: b (6, 3N), and g (6, 6) of all of it."""
        moments, gram = surface_moments(self.mesh.nodes, self._held_faces)
        return moments, self.turned_sum(gram)

    @cached_property
    def inertia(self) -> np.ndarray:
        """Mass matrix of the whole rigid body about the origin, (6, 6): kg, kg·m, kg·m²."""
        fields = rigid_modes(self.mesh.nodes)
        return self.turned_sum(fields.T @ (self.mass_matrix @ fields))

    @property
    def knows_stress(self) -> bool:
        """Whether stresses of the spinning body follow from its mesh, and so their effect on its modes: not where
        material and elements may be another program's."""
        return self.material is not None

    @cached_property
    def growth(self) -> np.ndarray:
        """Displacement (3N,) of the sector under centrifugal load per square of the speed, m·s²."""
        return growth(self.spaces[0], self.mesh.nodes, self.mass_matrix)

    @cached_property
    def stress_stiffness(self) -> sp.csr_array:
        """K_σ (N, N) of the stresses of that load, kg, the same for each component."""
        assert self.material is not None
        return stress_stiffness(self.mesh.nodes, self.mesh.elements, self.material, self.growth)

    def rigid_rows(self) -> np.ndarray:
        """Flank rows of the six rigid motions: (2·R·A, 6)."""
        return self.load_matrix[: self.flank_count] @ rigid_modes(self.mesh.nodes)

    def diameters(self) -> range:
        """Nodal diameters 0 … z/2."""
        return range(self.teeth // 2 + 1)

    def tooth_forces(self, harmonic: Harmonic, chosen: np.ndarray) -> np.ndarray:
        """Force of some loads of one tooth on a harmonic, (size, k)."""
        return harmonic.reduce(harmonic.space.from_nodes @ self.load_matrix[chosen].toarray().T)

    def bore_forces(self, harmonic: Harmonic) -> np.ndarray:
        """Force of the unit loads on the bore node on a harmonic, (size, 6)."""
        return harmonic.reduce(harmonic.space.from_nodes @ self.bore_moments[0].T) @ self.bore_parts(harmonic)

    def bore_parts(self, harmonic: Harmonic) -> np.ndarray:
        """Fourier coefficient (6, 6) of the unit loads on the bore node (force x, y, z, moment x, y, z in the body
        frame) in the moments b of `bore_moments`: f_j = Σ_ν bᵀ parts_ν e^{iθ_ν j} over ν and −ν."""
        parts, h = np.zeros((6, 6), complex), np.linalg.inv(self.bore_moments[1])
        if harmonic.nodal_diameter == 0:
            parts[[2, 5]] = h[[2, 5]]
        elif harmonic.nodal_diameter == 1:  # x and y of body-fixed vectors are amplitudes of e^{iα} in turning sectors
            for x, y in ((0, 1), (3, 4)):
                amplitude = h[x] - 1j * h[y]
                parts[x], parts[y] = 0.5 * amplitude, 0.5 * (1j * amplitude)
        return parts.real if harmonic.is_real else parts

    def seen_loads(self, parity: int) -> np.ndarray:
        """Numbers of the loads of a tooth that fields of this parity see, in `load_matrix`."""
        function = np.tile(np.arange(self.points.functions), 2 * len(self.points.rolls))
        odd = np.concatenate([function % 2, [0, 0, 1][: len(self.patch_rows)], function % 2])
        odd = odd[: self.load_matrix.shape[0]]
        return np.flatnonzero({1: odd == 0, -1: odd == 1, 0: odd >= 0}[parity])

    def turned_sum(self, matrix: np.ndarray) -> np.ndarray:
        """Σ_j Q_j A Q_jᵀ of a (6, 6) matrix over the sectors."""
        return sum((turn @ matrix @ turn.T for turn in frames(self.teeth)), np.zeros((6, 6)))
