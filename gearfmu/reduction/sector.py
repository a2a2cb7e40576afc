"""The full-order gear body on one sector, with everything that loads it: tooth flanks and bore; of an internal gear
tooth flanks, rim (in place of the bore) and the sector's own patch of the rim, where a mount may hold it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from gearfmu.fem import hex20, surface
from gearfmu.fem.coupling import averaging_rows_at, rigid_modes, surface_moments
from gearfmu.fem.cyclic import Harmonic, Sector, SectorSpace, sector_spaces
from gearfmu.fem.spinning import growth, stress_stiffness
from gearfmu.reduction.flank import Points, ToothFlank, flank_loads


@dataclass(frozen=True)
class Family:
    """One harmonic of one mirror parity with its loads.

    harmonic : nodal diameter ν of a parity.
    columns : which loads of a tooth (flat index over side, roll, function; then the patch; then side, roll, function of
    the loads along the profile) this parity sees.
    flank : (size, c) their force on one tooth. bore : (size, 6) Fourier coefficient of the unit loads on the bore node
    (force x, y, z, moment x, y, z in the body frame): f_j = Σ_ν bore_ν e^{iθ_ν j} over ν and −ν.
    weight : 2 for 0 < ν < z/2 (ν and −ν together), else 1.
    held_flank : interior response to `flank` with both cuts held.
    """

    harmonic: Harmonic
    columns: np.ndarray
    flank: np.ndarray
    bore: np.ndarray
    held_flank: np.ndarray

    @property
    def weight(self) -> int:
        return 1 if self.harmonic.is_real else 2

    def flank_response(self) -> np.ndarray:
        """C_ν times the flank loads, (size, c)."""
        return self.harmonic.flexibility(self.flank, self.held_flank)


class SectorBody:
    """A free gear body: finite elements of one sector, flank loads of tooth 0 and the averaging node of the bore.

    mesh : FeMesh of a gear sector; one with the set "rim" instead of "bore" is an internal gear's. material : SI.
    flank : ToothFlank. points : where the flanks are loaded. rigid_bore : the surface of the bore (of a ring: of the
    rim) moves as one rigid body, as on a stiff shaft; else it deforms about its mean motion.
    Raises MeshError when cuts, flanks or bore of the mesh are not as they should be.
    """

    def __init__(
        self, mesh: Any, material: hex20.Material, flank: ToothFlank, points: Points, rigid_bore: bool = False
    ):
        self.mesh, self.flank, self.points, self.teeth = mesh, flank, points, mesh.teeth
        stiffness, self.mass_matrix = hex20.assemble(mesh.nodes, mesh.elements, material)
        self.stiffness, self.internal = stiffness, "rim" in mesh.sets
        sector = Sector(
            mesh.nodes, mesh.elements, stiffness, self.mass_matrix, mesh.teeth, mesh.cut_minus, mesh.cut_plus,
            bool(flank.base_helix_angle), np.unique(self._held_faces) if rigid_bore else None,
        )  # fmt: skip
        self.material, self.spaces = material, sector_spaces(sector)
        self._inputs = [self._space_inputs(space) for space in self.spaces]

    @cached_property
    def flank_rows(self) -> np.ndarray:
        """Unit flank loads (side, roll, function) flattened, as rows over the sector's nodes: (2·R·A, 3N)."""
        both = [flank_loads(self.mesh.nodes, self.mesh.flank[s].quads, self.flank, s, self.points) for s in (0, 1)]
        return np.stack(both).reshape(-1, self.mesh.nodes.size)

    @cached_property
    def tangent_rows(self) -> np.ndarray:
        """Unit loads along the profile, ordered like `flank_rows`: (2·R·A, 3N)."""
        both = [
            flank_loads(self.mesh.nodes, self.mesh.flank[s].quads, self.flank, s, self.points, self.flank.tangent)
            for s in (0, 1)
        ]
        return np.stack(both).reshape(-1, self.mesh.nodes.size)

    @cached_property
    def patch_rows(self) -> np.ndarray:
        """Mean displacement x, y, z of the sector's patch of the rim, (3, 3N), at `patch_point`; (0, 3N) of a gear."""
        if not self.internal:
            return np.zeros((0, self.mesh.nodes.size))
        return averaging_rows_at(self.mesh.nodes, self._held_faces, self.patch_point)[:3]

    @property
    def patch_point(self) -> np.ndarray:
        """Where the patch's displacement is read: the mean of its nodes, (3,) m."""
        return self.mesh.nodes[self.mesh.sets["rim"]].mean(axis=0)

    @cached_property
    def load_rows(self) -> np.ndarray:
        """All loads of one tooth as rows over the sector's nodes: flank rows, patch rows, tangent rows."""
        return np.concatenate([self.flank_rows, self.patch_rows, self.tangent_rows])

    @property
    def profile_loads(self) -> int:
        """Number of the first load along the profile in `load_rows`."""
        return len(self.flank_rows) + len(self.patch_rows)

    @property
    def _held_faces(self) -> np.ndarray:
        return surface.faces_within(self.mesh.elements, self.mesh.sets["rim" if self.internal else "bore"])

    @cached_property
    def bore_moments(self) -> tuple[np.ndarray, np.ndarray]:
        """One sector's share of the bore's (ring: rim's) averaging node: b (6, 3N), and g (6, 6) of all of it."""
        moments, gram = surface_moments(self.mesh.nodes, self._held_faces)
        return moments, turned_sum(gram, self.teeth)

    @cached_property
    def inertia(self) -> np.ndarray:
        """Mass matrix of the whole rigid body about the origin, (6, 6): kg, kg·m, kg·m²."""
        fields = rigid_modes(self.mesh.nodes)
        return turned_sum(fields.T @ (self.mass_matrix @ fields), self.teeth)

    @property
    def knows_stress(self) -> bool:
        """Whether stresses of the spinning body can be told from its mesh, and so what its modes feel."""
        return True

    @cached_property
    def growth(self) -> np.ndarray:
        """Displacement (3N,) of the sector under centrifugal load per square of the speed, m·s²."""
        return growth(self.spaces[0], self.mesh.nodes, self.mass_matrix)

    @cached_property
    def stress_stiffness(self) -> sp.csr_array:
        """K_σ (N, N) of the stresses of that load, kg, the same for each component."""
        return stress_stiffness(self.mesh.nodes, self.mesh.elements, self.material, self.growth)

    def rigid_rows(self) -> np.ndarray:
        """Flank rows of the six rigid motions: (2·R·A, 6)."""
        return self.flank_rows @ rigid_modes(self.mesh.nodes)

    def diameters(self) -> range:
        """Nodal diameters 0 … z/2."""
        return range(self.teeth // 2 + 1)

    def family(self, space_index: int, nodal_diameter: int) -> Family:
        """Loads and operators of one nodal diameter of one parity."""
        harmonic = self.spaces[space_index].harmonic(nodal_diameter)
        columns, loads, held, bore = self._inputs[space_index]
        spread = np.zeros((len(bore), 6), complex)
        h = np.linalg.inv(self.bore_moments[1])
        if nodal_diameter == 0:
            spread = bore[:, [2, 5]] @ h[[2, 5]]
        elif nodal_diameter == 1:
            spread = 0.5 * (bore[:, 0:2] @ _rotating(h[0:2]) + bore[:, 3:5] @ _rotating(h[3:5]))
        if harmonic.is_real:
            spread = spread.real
        return Family(harmonic, columns, harmonic.reduce(loads), harmonic.reduce(spread), held)

    def _space_inputs(self, space: SectorSpace) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        function = np.tile(np.arange(self.points.functions), 2 * len(self.points.rolls))
        odd = np.concatenate(
            [function % 2, [0, 0, 1][: len(self.patch_rows)], (function % 2)[: len(self.tangent_rows)]]
        )
        seen = {1: odd == 0, -1: odd == 1, 0: odd >= 0}[space.parity]
        columns = np.flatnonzero(seen)
        loads = space.from_nodes @ self.load_rows[columns].T
        bore = space.from_nodes @ self.bore_moments[0].T
        return columns, loads, space.solve_held(loads[: space.interior]), bore


def _rotating(h: np.ndarray) -> np.ndarray:
    """x and y components (2, 6) of body-fixed vectors as amplitudes of e^{iα} in the turning sector frames."""
    amplitude = h[0] - 1j * h[1]
    return np.stack([amplitude, 1j * amplitude])


def turned_sum(matrix: np.ndarray, teeth: int) -> np.ndarray:
    """Σ_j Q_j A Q_jᵀ of a (6, 6) matrix over the sectors."""
    total = np.zeros((6, 6))
    for angle in 2 * np.pi * np.arange(teeth) / teeth:
        c, s = np.cos(angle), np.sin(angle)
        turn = np.kron(np.eye(2), np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
        total += turn @ matrix @ turn.T
    return total
