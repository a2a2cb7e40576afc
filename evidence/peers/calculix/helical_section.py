"""Whole helical gears for a contact solution: the section of section.py at every level of the width, turned by the
helix, its fine zones moving along the flanks with the slanting line of contact.

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
    Plane,
    edges,
    half_tooth,
    joined,
    lengths,
    quadrilaterals,
    surface,
    turning,
)
from evidence.peers.calculix.solid import Solid, bore_nodes, faces_over
from gearfmu.geometry import GearGeometry, involute

BESIDE = 0.12e-3  # m of flank that is left beside a fine zone


@dataclass(frozen=True)
class Zone:
    """Elements along a touched flank: in the fine zone, below and above it."""

    inner: int = 6
    below: int = 3
    above: int = 3


@dataclass(frozen=True)
class Twisted:
    """solid: its `flank` and `patch` are (layers, F, 2) element and face numbers by tooth. section: of mid-width."""

    solid: Solid
    section: Plane


def zone_stations(gear: GearGeometry, roll: float, fine: Fineness, zone: Zone) -> np.ndarray:
    """Arc lengths (2F + 1,) of surface nodes with the fine zone around `roll` (m), or as near as the flank allows; the
    last element is the tip edge."""
    flank, total = lengths(gear)
    form = float(involute.arc_length(gear.s_form, gear.r_b))
    middle = float(involute.arc_length(max(roll, gear.s_form), gear.r_b)) - form
    low = min(max(middle - fine.patch, BESIDE), flank - BESIDE - 2 * fine.patch)
    down = low * (1 - _growing(zone.below, fine.growth)[::-1])
    up = low + 2 * fine.patch + (flank - low - 2 * fine.patch) * _growing(zone.above, fine.growth)
    inner = np.linspace(low, low + 2 * fine.patch, zone.inner + 1)
    corners = np.concatenate([down[:-1], inner, up[1:], [total]])
    return np.interp(np.arange(2 * len(corners) - 1) / 2, np.arange(len(corners)), corners)


def _growing(count: int, growth: float) -> np.ndarray:
    """Shares 0 … 1 of a length divided into `count` growing elements."""
    sizes = growth ** np.arange(count)
    return np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()


@dataclass(frozen=True)
class _Cells:
    """Coordinates of a level in an order that all levels share."""

    quads: np.ndarray
    bore: np.ndarray
    flank: dict[int, np.ndarray]


def _level(gear: GearGeometry, rolls: Mapping[int, float], fine: Fineness, zone: Zone) -> _Cells:
    """The section with its zones around `rolls` (m) by tooth."""
    cells, bore, flank = [], [], {}
    for tooth in range(-(gear.z // 2), gear.z - gear.z // 2):
        near = min(abs((tooth - k + gear.z // 2) % gear.z - gear.z // 2) for k in rolls) <= fine.toothed
        along = _along(gear, rolls.get(tooth), fine, zone)
        blocks = half_tooth(gear, along, fine.root if tooth in rolls else fine.far_root, fine)
        half = np.concatenate([quadrilaterals(block) for block in blocks[0 if near else 1 :]])
        turn = turning(2 * math.pi * tooth / gear.z)
        cells += [half @ turn, (half * [1, -1])[:, [0, 3, 2, 1, 7, 6, 5, 4]] @ turn]
        edge = edges(blocks[2][-1])
        bore += [edge @ turn, (edge * [1, -1]) @ turn]
        if tooth in rolls:
            flank[tooth] = edges(surface(gear, along)) @ turn
    return _Cells(np.concatenate(cells), np.concatenate(bore), flank)


def _along(gear: GearGeometry, roll: float | None, fine: Fineness, zone: Zone) -> np.ndarray:
    if roll is not None:
        return zone_stations(gear, roll, fine, zone)
    flank, total = lengths(gear)
    corners = np.append(np.linspace(0, flank, fine.far_flank + 1), total)
    return np.interp(np.arange(2 * len(corners) - 1) / 2, np.arange(len(corners)), corners)


def twisted(gear: GearGeometry, rolls: Mapping[int, float], levels: np.ndarray, fine: Fineness, zone: Zone) -> Twisted:
    """The whole gear between the corner levels z (L + 1,) m; rolls (m) at mid-width by touched tooth; sg = +1."""
    z = np.interp(np.arange(2 * len(levels) - 1) / 2, np.arange(len(levels)), levels)
    slope = math.tan(gear.beta_b)
    cells = [_level(gear, {k: s + slope * height for k, s in rolls.items()}, fine, zone) for height in z]
    first = cells[0]
    nodes, (quads, bore, *flanks) = joined(first.quads, first.bore, *first.flank.values())
    plane = Plane(nodes, quads, bore, dict(zip(first.flank, flanks, strict=True)), {})
    where = np.zeros(len(nodes), int)
    where[quads.ravel()] = np.arange(quads.size)  # a place of every node in the cells of any level
    exists = np.zeros((len(z), len(nodes)), dtype=bool)
    exists[::2] = True
    exists[:, np.unique(quads[:, :4])] = True
    number = np.where(exists, np.cumsum(exists.ravel()).reshape(exists.shape) - 1, -1)
    turns = [turning(height * gear.twist) for height in z]
    points = [
        np.column_stack([(level.quads.reshape(-1, 2)[where] @ turn), np.full(len(nodes), height)])[there]
        for level, turn, height, there in zip(cells, turns, z, exists, strict=True)
    ]
    corner, middle = quads[:, :4], quads[:, 4:]
    elements = [
        np.hstack([number[k][corner], number[k + 2][corner], number[k][middle], number[k + 2][middle],
                   number[k + 1][corner]])
        for k in range(0, len(z) - 2, 2)
    ]  # fmt: skip
    layers = len(levels) - 1
    flank = {tooth: faces_over(plane, line, layers).reshape(layers, -1, 2) for tooth, line in plane.flank.items()}
    inside = slice(zone.below, zone.below + zone.inner)
    used, weights = bore_nodes(plane, number, z)
    solid = Solid(
        nodes=np.concatenate(points),
        elements=np.concatenate(elements),
        bore=used,
        weights=weights,
        low=number[0][number[0] >= 0],
        high=number[-1][number[-1] >= 0],
        flank=flank,
        patch={tooth: faces[:, inside] for tooth, faces in flank.items()},
    )
    return Twisted(solid, plane)
