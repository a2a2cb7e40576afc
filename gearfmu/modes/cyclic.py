"""Modes of a free body with equal sectors from the finite elements of one of them: gears, ring, bare carrier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearfmu.fem import hex20, surface
from gearfmu.fem.cyclic import Sector, SectorSpace, sector_spaces
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.femesh.mesh import FeMesh
from gearfmu.geometry.plane import about_z
from gearfmu.modes.shapes import BodyModes, Mode, cylindrical, energy_shares, main_harmonic

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class _Family:
    """Lowest modes of one parity and cyclic index: ω² (k,), shapes (size, k), and whether there are no more."""

    space: SectorSpace
    index: int
    pair: bool
    squared: np.ndarray
    shapes: np.ndarray
    complete: bool


def cyclic_modes(
    name: str,
    mesh: FeMesh,
    material: hex20.Material,
    count: int,
    progress: Progress | None = None,
    rigid: np.ndarray | None = None,
) -> BodyModes:
    """The `count` lowest elastic modes of the free body (one more where that would split a pair); damping is NaN.

    mesh : one sector. rigid : nodes of a surface that moves as one rigid body. The cyclic index of a mode is its nodal
    diameter, unless there are so few sectors that another diameter with the same index (ν ± kN) carries more of its
    energy. Raises MeshError when the cuts do not match, and ModesError.
    """
    stiffness, mass = hex20.assemble(mesh.nodes, mesh.elements, material)
    if progress:
        progress("finite elements", 0.2)
    spaces = sector_spaces(
        Sector(
            mesh.nodes, mesh.elements, stiffness, mass, mesh.teeth, mesh.cut_minus, mesh.cut_plus, bool(mesh.twist),
            rigid,
        )
    )  # fmt: skip
    faces = surface.outer_faces(mesh.elements, mesh.cut_minus, mesh.cut_plus)
    index = [mesh.sector_nodes(tooth) for tooth in range(mesh.teeth)]
    used, local = np.unique(np.concatenate([numbers[faces] for numbers in index]), return_inverse=True)
    nodes, scalar_mass = mesh.full().nodes, mass[::3, ::3]
    modes, number = [], 1
    for family, k in _lowest(_families(spaces, mesh.teeth, count, progress), count):
        harmonic = family.space.harmonic(family.index)
        shape = family.space.to_nodes @ harmonic.expand(family.shapes[:, [k]])[:, 0] / np.sqrt(mesh.teeth)
        energy = energy_shares(mesh.nodes, scalar_mass, shape.reshape(-1, 3))
        shape = _turned(mesh.nodes, shape, int(np.argmax(energy)))
        whole = unfolded(shape * np.sqrt(2.0 if family.pair else 1.0), family.index, index)[:, used]
        diameter, share = main_harmonic(nodes[used], whole[0], family.index, mesh.teeth)
        numbers = (number, number + 1) if family.pair else (number,)
        number += len(numbers)
        modes.append(
            Mode(
                numbers=numbers,
                frequency=float(np.sqrt(family.squared[k]) / (2 * np.pi)),
                damping_ratio=float("nan"),
                parity=family.space.parity,
                nodal_diameter=diameter,
                harmonic_share=share,
                energy=energy,
                shape=whole,
            )
        )
    return BodyModes(name, nodes[used], local.reshape(-1, 8), tuple(modes))


def _turned(nodes: np.ndarray, shape: np.ndarray, component: int) -> np.ndarray:
    """The shape (3N,) with its free sign, or the free phase of a pair, such that the mean of its main cylindrical
    component over sector 0 is real and positive: a lobe on tooth 0 where there is one."""
    mean = cylindrical(nodes, shape.reshape(-1, 3))[:, component].sum()
    return shape * (np.conj(mean) / abs(mean) if mean else 1.0)


def unfolded(shape: np.ndarray, cyclic_index: int, index: list[np.ndarray]) -> np.ndarray:
    """Displacement (1 or 2, N, 3) of all nodes of the whole body from the sector's shape (3N,); two for a complex one:
    its real and its imaginary part. index : `sector_nodes` of every sector."""
    sectors, parts = len(index), 2 if np.iscomplexobj(shape) else 1
    total = np.empty((parts, max(numbers.max() for numbers in index) + 1, 3))
    for sector, numbers in enumerate(index):
        angle = 2 * np.pi * sector / sectors
        here = shape.reshape(-1, 3) * np.exp(1j * cyclic_index * angle)
        here = here @ about_z(-angle)
        total[:, numbers] = np.stack([here.real, here.imag][:parts])
    return total


def _families(spaces: list[SectorSpace], sectors: int, count: int, progress: Progress | None) -> list[_Family]:
    """Every family solved until its highest frequency lies above the `count`-th of all: none is missed."""
    keys = [(space, index) for space in range(len(spaces)) for index in range(sectors // 2 + 1)]
    wanted = dict.fromkeys(keys, max(2, -(-count // len(keys)) + 1))
    found: dict[tuple[int, int], _Family] = {}
    todo = keys
    while todo:
        for done, key in enumerate(todo):
            if progress:
                progress(f"nodal diameter {key[1]}", done / len(todo))
            space, index = spaces[key[0]], key[1]
            harmonic = space.harmonic(index)
            squared, shapes = lowest_modes(harmonic, wanted[key])
            complete = len(squared) >= harmonic.elastic
            found[key] = _Family(space, index, not harmonic.is_real, squared, shapes, complete)
        squared = np.sort(np.concatenate([np.repeat(f.squared, 2 if f.pair else 1) for f in found.values()]))
        limit = squared[min(count, len(squared)) - 1]
        todo = [key for key in keys if found[key].squared[-1] < limit and not found[key].complete]
        for key in todo:
            wanted[key] = 2 * wanted[key]
    return list(found.values())


def _lowest(families: list[_Family], count: int) -> list[tuple[_Family, int]]:
    """Families and positions in them of the lowest `count` modes, ascending, pairs whole."""
    entries = sorted((squared, number, k) for number, f in enumerate(families) for k, squared in enumerate(f.squared))
    chosen, modes = [], 0
    for _, number, k in entries:
        if modes >= count:
            break
        chosen.append((families[number], k))
        modes += 2 if families[number].pair else 1
    return chosen
