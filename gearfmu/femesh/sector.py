"""The sector of a gear: its plane section, extruded over the face width, and of a helical gear turned with z.

The section at z is the one at mid-width turned by z·twist, mid nodes included: every node lies on its helix, the cuts
are helical surfaces one pitch apart.
"""

from __future__ import annotations

import numpy as np

from gearfmu.errors import MeshError
from gearfmu.femesh.mesh import FeMesh, FlankGrid
from gearfmu.femesh.quality import scaled_jacobian
from gearfmu.femesh.ring import ring_blocks
from gearfmu.femesh.section import Section, flank_rolls, gear_blocks, section_of
from gearfmu.geometry import GearGeometry
from gearfmu.geometry.gear import InternalGearGeometry
from gearfmu.stagefile.tables.bodies import MeshSpec


def gear_sector(geometry: GearGeometry | InternalGearGeometry, face_width: float, mesh: MeshSpec) -> FeMesh:
    """One sector of a gear: tooth 0 on +x, half a space on either side, `face_width` b (m) about z = 0; of an internal
    gear space 0 with half a tooth on either side. sets: "bore", or "rim" of an internal gear.

    Flank nodes, mid nodes included, lie on the involute of their section; the tip edge is meshed sharp. flank[0] of an
    internal gear is that of space 0 at its larger angle. The mesh of a spur gear is its own mirror image about z = 0
    and about y = 0, that of a helical gear stays as it is when turned by half a turn about x. MeshError when the
    geometry leaves no valid element.
    """
    along = mesh.scaled(mesh.flank, 2)
    roll = flank_rolls(geometry, along)
    if isinstance(geometry, InternalGearGeometry):
        held, (blocks, cut) = "rim", ring_blocks(geometry, mesh, roll)
    else:
        held, (blocks, cut) = "bore", gear_blocks(geometry, mesh, roll)
    section = section_of(blocks, cut, roll[: 2 * along + 1])
    numbers, nodes = _extruded(section, face_width, mesh.scaled(mesh.width), geometry.twist)
    result = FeMesh(
        nodes=nodes,
        elements=_hexahedra(section.quads, numbers),
        sets={held: _column(section.bore, numbers)},
        teeth=geometry.z,
        cut_minus=_column(section.cut_minus, numbers),
        cut_plus=_column(section.cut_plus, numbers),
        flank={side: _flank_grid(section, side, numbers, nodes) for side in (0, 1)},
        twist=geometry.twist,
    )
    if not (worst := float(scaled_jacobian(result).min())) > 0:
        raise MeshError(
            f"an element is folded (scaled Jacobian {worst:.2g}): use more elements, or another tooth shape or bore"
        )
    return result


def _extruded(section: Section, width: float, elements: int, twist: float) -> tuple[np.ndarray, np.ndarray]:
    """Node index (levels, N2) of a section's node at a level, −1 where a mid level has none; node positions (N, 3)."""
    levels = 2 * elements + 1
    exists = np.zeros((levels, len(section.nodes)), dtype=bool)
    exists[::2] = True
    exists[:, np.unique(section.quads[:, :4])] = True
    numbers = np.where(exists, np.cumsum(exists.ravel()).reshape(exists.shape) - 1, -1)
    z = 0.5 * width * (np.arange(levels) - elements) / elements
    level, node = np.nonzero(exists)
    x, y = section.nodes[node].T
    c, s = np.cos(twist * z[level]), np.sin(twist * z[level])
    return numbers, np.column_stack([c * x - s * y, s * x + c * y, z[level]])


def _hexahedra(quads: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    corners, middles = quads[:, :4], quads[:, 4:]
    layers = []
    for k in range(0, len(numbers) - 2, 2):
        low, level, high = numbers[k : k + 3]
        layers.append(np.hstack([low[corners], high[corners], low[middles], high[middles], level[corners]]))
    return np.concatenate(layers)


def _column(section_nodes: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """All nodes above these nodes of the section, level by level."""
    column = numbers[:, section_nodes].ravel()
    return column[column >= 0]


def _flank_grid(section: Section, side: int, numbers: np.ndarray, nodes: np.ndarray) -> FlankGrid:
    start, end, middle = section.flank[side].T
    s0, s1, sm = section.flank_roll.T
    quads, rolls = [], []
    for k in range(0, len(numbers) - 2, 2):
        low, mid, high = numbers[k], numbers[k + 1], numbers[k + 2]
        quads.append([low[start], low[end], high[end], high[start], low[middle], mid[end], high[middle], mid[start]])
        rolls.append([s0, s1, s1, s0, sm, s1, sm, s0])
    order = [0, 3, 2, 1, 7, 6, 5, 4] if side == 0 else list(range(8))
    grid = np.array(quads).transpose(2, 0, 1)[..., order]
    roll = np.array(rolls).transpose(2, 0, 1)[..., order]
    shape = grid.shape[:2]
    grid, roll = grid.reshape(-1, 8), roll.reshape(-1, 8)
    return FlankGrid(grid, roll, nodes[grid, 2], shape)
