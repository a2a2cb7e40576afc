"""Shapes of a gear's modes, made again from its finite elements: one sector, unfolded to all teeth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearfmu.body import ReducedBody
from gearfmu.body.reduce import full_order_body
from gearfmu.errors import BodyError
from gearfmu.fem import surface
from gearfmu.femesh import FeMesh
from gearfmu.geometry import GearGeometry
from gearfmu.modes.shapes import BodyModes, Mode, energy_shares
from gearfmu.reduction.modal import Modes, elastic_modes
from gearfmu.reduction.sector import SectorBody
from gearfmu.spec.stage import StageSpec

AGREEMENT = 1e-6  # relative: frequencies made again against those of the file

Progress = Callable[[str, float], None]


def gear_modes(
    spec: StageSpec, gear_index: int, stored: ReducedBody, count: int, progress: Progress | None = None
) -> BodyModes:
    """The `count` lowest elastic modes of a gear (one more where that would split a pair).

    stored : the gear's reduced body, whose frequencies they must have: BodyError where they differ (a file made by
    another program version).
    """
    gear = spec.gears[gear_index]
    body = full_order_body(GearGeometry.of(gear, spec.pair), gear)
    count = whole_pairs(stored, count)
    modes = elastic_modes(body, count, progress, shapes=count)
    difference = np.abs(modes.frequency / stored.frequency[:count] - 1).max()
    if difference > AGREEMENT:
        raise BodyError(
            f"{gear.name}: frequencies made from the finite elements differ by {difference:.1e} from those of the "
            "stored body; make it again with 'gearfmu reduce --force STAGE'"
        )
    faces = outer_faces(body.mesh)
    index = [body.mesh.sector_nodes(tooth) for tooth in range(body.teeth)]
    used, local = np.unique(np.concatenate([numbers[faces] for numbers in index]), return_inverse=True)
    return BodyModes(
        gear.name,
        body.mesh.full().nodes[used],
        local.reshape(-1, 8),
        tuple(
            _mode(body, modes, k, stored.damping_ratio[k], unfolded(modes.shapes[k], int(modes.nodal_diameter[k]), index)[:, used])
            for k in np.flatnonzero(modes.part != 2)
        ),
    )


def whole_pairs(stored: ReducedBody, count: int) -> int:
    """`count`, at most as many modes as are stored, and one more where it would split a pair."""
    count = min(count, stored.modes)
    return count + int(count < stored.modes and stored.part[count] == 2)


def outer_faces(mesh: FeMesh) -> np.ndarray:
    """Faces (F, 8) of a sector that lie on the surface of the whole body, normals outward."""
    faces = surface.boundary_faces(mesh.elements)
    on_cut = np.isin(faces, mesh.cut_minus).all(axis=1) | np.isin(faces, mesh.cut_plus).all(axis=1)
    return faces[~on_cut]


def unfolded(shape: np.ndarray, nodal_diameter: int, index: list[np.ndarray]) -> np.ndarray:
    """Displacement (1 or 2, N, 3) of all nodes of the whole body from the sector's shape (3N,); two for a complex one:
    its real and its imaginary part. index : `sector_nodes` of every sector."""
    teeth, parts = len(index), 2 if np.iscomplexobj(shape) else 1
    total = np.empty((parts, max(numbers.max() for numbers in index) + 1, 3))
    for tooth, numbers in enumerate(index):
        angle = 2 * np.pi * tooth / teeth
        c, s = np.cos(angle), np.sin(angle)
        here = shape.reshape(-1, 3) * np.exp(1j * nodal_diameter * angle)
        here = here @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        total[:, numbers] = np.stack([here.real, here.imag][:parts])
    return total


def _mode(body: SectorBody, modes: Modes, k: int, damping_ratio: float, shape: np.ndarray) -> Mode:
    scalar_mass = body.mass_matrix[::3, ::3]
    return Mode(
        numbers=(int(k) + 1, int(k) + 2) if modes.part[k] else (int(k) + 1,),
        frequency=float(modes.frequency[k]),
        damping_ratio=float(damping_ratio),
        parity=int(modes.parity[k]),
        nodal_diameter=int(modes.nodal_diameter[k]),
        harmonic_share=1.0,
        energy=energy_shares(body.mesh.nodes, scalar_mass, modes.shapes[k].reshape(-1, 3)),
        shape=shape,
    )
