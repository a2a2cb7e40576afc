"""Whole helical gears for a contact solution, in 20-node hexahedra: the section of section.py at every level of the
width, turned by the helix, its fine zones moving along the flanks with the slanting line of contact.

All levels have one topology: the zone keeps its length and its count of elements, and stays on the flank where the line
of contact has left it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evidence.peers.calculix.section import (
    Fineness,
    edges,
    half_tooth,
    joined,
    lengths,
    quadrilaterals,
    surface,
    turning,
)
from gearfmu.geometry import GearGeometry, involute

BESIDE = 0.12e-3  # m of flank that is left beside a fine zone
FACE_OF_EDGE = np.array([3, 4, 5, 6])  # CalculiX's face number over edge k of the section's quadrilateral


@dataclass(frozen=True)
class Solid:
    """20-node hexahedra in VTK (= Abaqus) order. nodes (N, 3) m, in the body frame. bore: its nodes. flank: per touched
    tooth (layers, F, 2) element and face number of its sg = +1 surface from root form point to tip edge."""

    nodes: np.ndarray
    elements: np.ndarray
    bore: np.ndarray
    flank: dict[int, np.ndarray]


def between(corners: np.ndarray) -> np.ndarray:
    """Corner and mid places (2n + 1,) of n elements between corners (n + 1,)."""
    return np.interp(np.arange(2 * len(corners) - 1) / 2, np.arange(len(corners)), corners)


def zone_stations(gear: GearGeometry, roll: float, fine: Fineness) -> np.ndarray:
    """Arc lengths (2F + 1,) of surface nodes with the fine zone around `roll` (m), or as near as the flank allows; the
    last element is the tip edge."""
    flank, total = lengths(gear)
    form = float(involute.arc_length(gear.s_form, gear.r_b))
    middle = float(involute.arc_length(max(roll, gear.s_form), gear.r_b)) - form
    low = min(max(middle - fine.patch, BESIDE), flank - BESIDE - 2 * fine.patch)
    down = low * (1 - _growing(fine.below, fine.growth)[::-1])
    up = low + 2 * fine.patch + (flank - low - 2 * fine.patch) * _growing(fine.above, fine.growth)
    inner = np.linspace(low, low + 2 * fine.patch, fine.inner + 1)
    return between(np.concatenate([down[:-1], inner, up[1:], [total]]))


def _growing(count: int, growth: float) -> np.ndarray:
    """Shares 0 … 1 of a length divided into `count` growing elements."""
    sizes = growth ** np.arange(count)
    return np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()


def far_stations(gear: GearGeometry, fine: Fineness) -> np.ndarray:
    """Those of a tooth that is not touched: equal elements and the tip edge."""
    flank, total = lengths(gear)
    return between(np.append(np.linspace(0, flank, fine.far_flank + 1), total))


@dataclass(frozen=True)
class _Cells:
    """Coordinates of a level in an order that all levels share: quads (E, 8, 2), edges (·, 3, 2) of bore and flanks."""

    quads: np.ndarray
    bore: np.ndarray
    flank: dict[int, np.ndarray]


def _level(gear: GearGeometry, rolls: Mapping[int, float], fine: Fineness) -> _Cells:
    """The section with its zones around `rolls` (m) by tooth."""
    cells, bore, flank = [], [], {}
    for tooth in range(-(gear.z // 2), gear.z - gear.z // 2):
        near = min(abs((tooth - k + gear.z // 2) % gear.z - gear.z // 2) for k in rolls) <= fine.toothed
        along = zone_stations(gear, rolls[tooth], fine) if tooth in rolls else far_stations(gear, fine)
        blocks = half_tooth(gear, along, fine.root if tooth in rolls else fine.far_root, fine)
        half = np.concatenate([quadrilaterals(block) for block in blocks[0 if near else 1 :]])
        turn = turning(2 * math.pi * tooth / gear.z)
        cells += [half @ turn, (half * [1, -1])[:, [0, 3, 2, 1, 7, 6, 5, 4]] @ turn]
        edge = edges(blocks[2][-1])
        bore += [edge @ turn, (edge * [1, -1]) @ turn]
        if tooth in rolls:
            flank[tooth] = edges(surface(gear, along)) @ turn
    return _Cells(np.concatenate(cells), np.concatenate(bore), flank)


def twisted(gear: GearGeometry, rolls: Mapping[int, float], levels: np.ndarray, fine: Fineness) -> Solid:
    """The whole gear between the corner levels z (L + 1,) m; rolls (m) at mid-width by touched tooth; sg = +1."""
    z, slope = between(levels), math.tan(gear.beta_b)
    cells = [_level(gear, {k: s + slope * height for k, s in rolls.items()}, fine) for height in z]
    first = cells[0]
    nodes, (quads, bore, *flanks) = joined([first.quads, first.bore, *first.flank.values()])
    where = np.zeros(len(nodes), int)
    where[quads.ravel()] = np.arange(quads.size)  # a place of every node in the cells of any level
    exists = np.zeros((len(z), len(nodes)), dtype=bool)
    exists[::2] = True
    exists[:, np.unique(quads[:, :4])] = True
    number = np.where(exists, np.cumsum(exists.ravel()).reshape(exists.shape) - 1, -1)
    points = []
    for level, height, there in zip(cells, z, exists, strict=True):
        turned = level.quads.reshape(-1, 2)[where] @ turning(height * gear.twist)
        points.append(np.column_stack([turned, np.full(len(nodes), height)])[there])
    corner, middle = quads[:, :4], quads[:, 4:]
    elements = [
        np.hstack([number[k][corner], number[k + 2][corner], number[k][middle], number[k + 2][middle],
                   number[k + 1][corner]])
        for k in range(0, len(z) - 2, 2)
    ]  # fmt: skip
    in_bore = number[:, np.unique(bore)]
    return Solid(
        nodes=np.concatenate(points),
        elements=np.concatenate(elements),
        bore=np.sort(in_bore[in_bore >= 0]),
        flank={
            tooth: _faces_over(quads, line, len(levels) - 1) for tooth, line in zip(first.flank, flanks, strict=True)
        },
    )


def _faces_over(quads: np.ndarray, line: np.ndarray, layers: int) -> np.ndarray:
    """(layers, F, 2) element and face numbers over section edges."""
    wanted = {tuple(sorted(pair)) for pair in line[:, :2].tolist()}
    found = [
        (element, FACE_OF_EDGE[k])
        for element, quad in enumerate(quads.tolist())
        for k in range(4)
        if tuple(sorted((quad[k], quad[(k + 1) % 4]))) in wanted
    ]
    assert len(found) == len(line)
    return np.array([np.array(found) + [layer * len(quads), 0] for layer in range(layers)])
