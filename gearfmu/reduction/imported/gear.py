"""From a mesh file (and matrix files) to a gear body that can be reduced: checked, fitted, in the frame of the gear."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from gearfmu.errors import MeshError
from gearfmu.fem import solids
from gearfmu.fem.coupling import averaging_rows
from gearfmu.fem.surface import Faces
from gearfmu.femesh.cyclic_cut import CyclicCut, cyclic_cut, is_whole
from gearfmu.femesh.imported import ImportedMesh, repeated_cells
from gearfmu.femesh.mesh import FeMesh
from gearfmu.geometry.involute_fit import InvoluteFit
from gearfmu.reduction.couplings import full_order
from gearfmu.reduction.cyclic.flank import Direction, Points, ToothFlank, tooth_flank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.imported.files import (
    Matrices,
    elements_of,
    mesh_facts,
    naming,
    ready_matrices,
    set_coupling,
    sound_mesh,
)
from gearfmu.reduction.imported.flank import fit_flanks, tooth_loads
from gearfmu.reduction.imported.mean_tooth import WholeGear
from gearfmu.reduction.memory import MESH_COARSER, require_memory, sector_need, whole_need
from gearfmu.stagefile.forms.general import RingBody, ToothedBody
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.tables.imported import ImportSpec, RingImportSpec

BORE = "bore"
_ON_BORE = 0.02  # of the bore's radius: how far a node of the bore may lie off it (chords)
_WIDTH, _THICKNESS = 2e-3, 0.05  # relative difference of face width and base radius, of tooth thickness to the file
_HINGE = 1e-9  # of √(largest K_ii/M_ii): a lower first frequency is no vibration of a solid body


@dataclass(frozen=True)
class CheckedGear:
    """An imported gear that has been read, checked, fitted and placed: its mesh in the frame of the gear, ready-made
    matrices or None, its sector or None, plain facts, and the flank that is meant with its load points."""

    mesh: ImportedMesh
    matrices: Matrices | None
    cut: CyclicCut | None
    facts: dict[str, Any]
    flank: ToothFlank
    points: Points

    @property
    def bore_of_cut(self) -> np.ndarray:
        """Nodes of the sector on the bore, of a ring on the rim."""
        assert self.cut is not None
        return np.flatnonzero(np.isin(self.cut.of_mesh, self.mesh.sets[BORE]))


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


def checked_gear(gear: ToothedBody) -> CheckedGear:
    """Read, check, fit and place the finite elements of a gear.

    A sector mesh, and a whole mesh that is cyclic, is reduced by cyclic symmetry; a whole mesh that is not, a whole
    gear's ready-made matrices and a rigid bore by the mean tooth. MeshError lists the faults of the files.
    """
    source, (flank, points) = _source(gear), tooth_flank(gear_shape(gear), gear)
    if gear.helix_angle:
        raise MeshError(f"{source.file}: finite elements made elsewhere are read for spur gears only")
    mesh = sound_mesh(source)
    with naming(Path(source.file)):
        fit = _fit(mesh, source, gear.teeth, flank)
        placed = replace(mesh, nodes=fit.in_gear_frame(mesh.nodes))
        _same_gear(placed, fit, flank)
        placed.sets[BORE] = _bore_nodes(placed, source.bore, gear)
        matrices = ready_matrices(source, placed, fit.turn(), gear.material)
        whole, cut = is_whole(placed.nodes, gear.teeth), None
        if source.bore_coupling == "averaging" and (matrices is None or not whole):
            cut = cyclic_cut(placed.nodes, placed.elements, gear.teeth)
        if cut is None and flank.internal:
            raise MeshError(
                "a ring is taken by sectors only, for the sake of its mounts: give one sector that holds a whole tooth "
                "space, with its matrices if they are ready-made, or a whole mesh that repeats itself from space to "
                "space"
            )
        if cut is None and not whole:
            raise MeshError(
                'a sector takes the averaging bore only: write bore_coupling = "averaging", or mesh the whole gear'
            )
        method = "mean tooth" if cut is None else "cyclic"
        dofs = 3 * (len(mesh.nodes) if cut is None else gear.teeth * (len(cut.nodes) - len(cut.cut_plus)))
        facts = _facts(placed, fit) | {"method": method, "dof_sector": dofs // gear.teeth, "dof_body": dofs}
        return CheckedGear(placed, matrices, cut, facts, flank, points)


def loaded_gear(found: CheckedGear, gear: ToothedBody) -> ImportedSector | WholeGear:
    """A checked gear with the loads of its teeth, ready to be reduced, on one sector or whole. Raises MeshError."""
    source, cut = _source(gear), found.cut
    with naming(Path(source.file)):
        loads = 2 * len(found.points.rolls) * found.points.functions
        if cut is None:
            need = whole_need(found.mesh.nodes.size, gear.body.modes + 3 * loads, 1)
            require_memory(need, MESH_COARSER)
            return _whole(found, source.bore_coupling, gear)
        require_memory(sector_need(cut, gear.teeth, gear.body.modes, loads), MESH_COARSER)
        matrices = found.matrices or solids.assemble(cut.nodes, cut.elements, gear.material)
        return ImportedSector(cut, found.bore_of_cut, gear.teeth, matrices, found.flank, found.points)


def _source(gear: ToothedBody) -> ImportSpec | RingImportSpec:
    assert gear.imported is not None
    return gear.imported


def _fit(mesh: ImportedMesh, source: ImportSpec | RingImportSpec, teeth: int, flank: ToothFlank) -> InvoluteFit:
    middle = (
        mesh.nodes[mesh.node_set(source.bore)].mean(axis=0)
        if source.bore and _around(mesh, source.bore)
        else np.zeros(3)
    )
    faces = solids.boundary(mesh.elements)
    fit = fit_flanks(mesh.nodes - middle, faces, teeth, flank, source.flank_tolerance)
    return replace(fit, origin=fit.origin + middle)


def _around(mesh: ImportedMesh, name: str) -> bool:
    """Whether a set surrounds its own middle, as a whole bore does and that of a sector does not."""
    points = mesh.nodes[mesh.node_set(name)]
    around = np.sort(np.arctan2(*(points - points.mean(axis=0))[:, [1, 0]].T))
    return bool(np.diff(around, append=around[0] + 2 * np.pi).max() < np.pi / 2)


def _same_gear(mesh: ImportedMesh, fit: InvoluteFit, flank: ToothFlank) -> None:
    """MeshError when the fitted gear is not the one of the stage file."""
    radius, (low, high) = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1]), flank.radii()
    width = 2 * float(np.abs(mesh.nodes[(radius > low) & (radius < high), 2]).max())
    pairs = {
        "base radius": (fit.r_b, flank.r_b, _WIDTH),
        "half tooth thickness at the base circle": (fit.psi_b * fit.r_b, flank.psi_b * flank.r_b, _THICKNESS),
        "face width": (width, flank.face_width, _WIDTH),
    }
    wrong = [
        f"{name} {1e3 * own:.5g} mm instead of {1e3 * meant:.5g} mm"
        for name, (own, meant, slack) in pairs.items()
        if abs(own - meant) > slack * meant
    ]
    if wrong:
        raise MeshError(
            f"this is not the gear of the stage file: {', '.join(wrong)}; correct one of them, or the unit `length`"
        )


def _bore_nodes(mesh: ImportedMesh, name: str, gear: ToothedBody) -> np.ndarray:
    if name:
        return mesh.node_set(name)
    where, diameter = ("rim", gear.rim_diameter) if isinstance(gear, RingBody) else ("bore", gear.bore_diameter)
    radius = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1])
    found = np.flatnonzero(np.abs(radius - 0.5 * diameter) < _ON_BORE * (0.5 * diameter))
    faces = solids.boundary(mesh.elements).within(found)
    if len(faces.nodes) == 0:
        raise MeshError(
            f"no face lies on the {where} of {1e3 * diameter:.4g} mm: name the node set of the {where} in "
            f"`{where}`, or correct {where}_diameter"
        )
    return faces.nodes


def _facts(mesh: ImportedMesh, fit: InvoluteFit) -> dict[str, Any]:
    return mesh_facts(mesh) | {
        "teeth": fit.teeth,
        "fit": {
            "base_radius_m": fit.r_b,
            "half_tooth_angle_rad": fit.psi_b,
            "residual_rms_um": 1e6 * fit.rms,
            "residual_max_um": 1e6 * fit.worst,
            "points": len(fit.residual),
        },
    }


def _whole(found: CheckedGear, coupling: str, gear: ToothedBody) -> WholeGear:
    mesh, faces = found.mesh, solids.boundary(found.mesh.elements)
    bore = set_coupling(mesh, faces, BORE, coupling, np.zeros(3))
    elements = elements_of(mesh, found.matrices, gear.material)
    body = full_order(mesh.source.stem, elements, [bore], (BORE,), found.flank.r_b)
    angles = 2 * np.pi * np.arange(gear.teeth) / gear.teeth
    rows = [tooth_loads(mesh.nodes, faces, found.flank, found.points, angle) for angle in angles]
    if coupling == "rigid":
        kept = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.sets[BORE])
        pick = (3 * kept[:, None] + np.arange(3)).ravel()
        masters = sp.csr_array((rows[0].shape[0], body.size - len(pick)))
        rows = [sp.csr_array(sp.hstack([row[:, pick], masters])) for row in rows]
    return WholeGear(body, tuple(rows), found.points)


def hinge_problem(space: Elastic) -> str | None:
    """Why a body cannot be one solid, by its lowest elastic mode, or None. Raises FactorError and ModesError."""
    stiffest = float((space.stiffness.diagonal() / space.mass_matrix.diagonal()).max())
    if float(space.modes(1)[0][0]) > _HINGE**2 * stiffest:
        return None
    return (
        "the stiffness matrix is singular beyond the six rigid motions, as with a hinge or a loose part: connect it, "
        "or export it without mechanisms"
    )
