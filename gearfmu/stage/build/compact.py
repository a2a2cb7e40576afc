"""Tables of a gear's flanks as the model blob stores them: on the points of the body's own, which the kernel spreads
over the even grid of rolls, and nothing twice.

With n = P·A places (points × width functions, place i·A + a), B_m[f, g] (n, n) is the compliance of a tooth's flank g
by a load on flank f of the tooth m before it. B_−m[g, f] is its transpose. Half a turn about the middle line of tooth 0
makes a gear of equal sectors that is alike on both sides of mid-width its own image, flank 0 flank 1: with the signs
s_a = (−1)^degree of the width functions B_m[1, 1] = s B_m[0, 0]ᵀ s, and B_m[f, g] s is symmetric for f ≠ g. Such gears
are called mirrored; it is checked, not assumed.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gearfmu.stage.build.ground_part import PartFlank, products, read_tables, turn_tables
from gearfmu.stage.build.groups import Group, node_directions
from gearfmu.stage.build.tables import OFFSETS

EQUAL = 1e-6  # of the largest compliance: what may part the flanks of a mirrored gear, whose tables are rounded
FURTHER = range(1, max(OFFSETS) + 1)
ACROSS = [(0, 1, 0)] + [(f, 1 - f, m) for m in FURTHER for f in (0, 1)]  # from flank, to flank, offset


def is_mirrored(flank: PartFlank, degrees: np.ndarray) -> bool:
    """Whether flank 1 of a gear is the image of its flank 0."""
    along = flank.along
    tables = [flank.residual] + ([along.normal[:, :, None], along.own[:, :, None]] if along else [])
    return all(_is_own_image(table, degrees) for table in tables)


def flank_tables(index: int, flank: PartFlank, degrees: np.ndarray) -> dict[str, np.ndarray]:
    """Sections of gear `index` that its body alone decides."""
    along, mirrored = flank.along, is_mirrored(flank, degrees)
    found = {
        f"rows{index}": flank.turning,
        f"low_rows{index}": read_tables(flank.patterns, 0.0),
        f"low_member{index}": flank.low_member.astype(np.int32),
        f"node{index}": flank.node,
    } | residual_sections(index, flank.residual, degrees, mirrored)
    if along is None:
        return found
    return (
        found
        | {f"along_rows{index}": along.turning, f"along_low{index}": read_tables(along.patterns, 0.0)}
        | along_sections(index, along.normal, along.own, degrees, mirrored)
    )


def ground_tables(index: int, number: int, group: Group, read: np.ndarray) -> dict[str, np.ndarray]:
    """Sections of gear `index` in a set of ground oscillators, of which it reads `read`."""
    layout = group.layout
    sides = node_directions(layout, index)
    shapes = group.shapes[group.at[index]][len(layout.freedoms(index)) :]
    return {
        f"ground_list{index}_{number}": read.astype(np.int32),
        f"centre{index}_{number}": group.rigid(index)[:, read],
        f"low_ground{index}_{number}": shapes[:, read],
        f"node_ground{index}_{number}": -products(sides.T @ group.kappa, group.support_rows[:, read].T),
    }


def residual_sections(
    index: int, residual: np.ndarray, degrees: np.ndarray, mirrored: bool = False
) -> dict[str, np.ndarray]:
    """Sections of a residual (2, 2, 7, P, P, A, A), m/N."""
    blocks, flanks = _Blocks(residual, degrees), (0,) if mirrored else (0, 1)
    return {
        f"residual_own{index}": np.stack([blocks.half(f, f, 0) for f in flanks]),
        f"residual_next{index}": np.stack([[blocks.whole(f, f, m) for m in FURTHER] for f in flanks]),
        f"residual_across{index}": np.stack([blocks.across(*of, mirrored) for of in ACROSS]),
    }


def along_sections(
    index: int, normal: np.ndarray, own: np.ndarray, degrees: np.ndarray, mirrored: bool
) -> dict[str, np.ndarray]:
    """Sections of compliances (2, 2, P, P, A, A) of one tooth per force along the profile, m/N."""
    blocks, turned = _Blocks(normal[:, :, None], degrees), _Blocks(own[:, :, None], degrees)
    flanks = (0,) if mirrored else (0, 1)
    return {
        f"along_normal{index}": np.stack([[blocks.whole(f, g, 0) for g in (0, 1)] for f in flanks]),
        f"along_own{index}": np.stack([turned.half(f, f, 0) for f in flanks]),
        f"along_across{index}": turned.across(0, 1, 0, mirrored),
    }


def ground_rows(index: int, number: int, sections: Mapping[str, np.ndarray]) -> np.ndarray:
    """(3, 2, P, A, reads) kg^-½: outward normal displacement of a tooth by ground oscillators beside the rigid motion
    of the gear, as c₀, c_c, c_s, from the sections of `flank_tables` and `ground_tables`."""
    patterns = turn_tables(sections[f"low_rows{index}"], sections[f"low_member{index}"])
    moved = products(patterns, sections[f"low_ground{index}_{number}"].T)
    return moved + products(sections[f"node{index}"], sections[f"node_ground{index}_{number}"].T)


class _Blocks:
    """Blocks (n, n) of a table (2, 2, offsets, P, P, A, A), offsets −m … m."""

    def __init__(self, table: np.ndarray, degrees: np.ndarray):
        self.table, self.zero = table, table.shape[2] // 2
        self.size = table.shape[3] * table.shape[5]
        self.sign = np.tile((-1.0) ** np.asarray(degrees), table.shape[3])

    def whole(self, f: int, g: int, m: int) -> np.ndarray:
        return self.table[f, g, self.zero + m].transpose(0, 2, 1, 3).reshape(self.size, self.size)

    def half(self, f: int, g: int, m: int) -> np.ndarray:
        """Lower triangle, row by row."""
        return self.whole(f, g, m)[np.tril_indices(self.size)]

    def across(self, f: int, g: int, m: int, mirrored: bool) -> np.ndarray:
        block = self.whole(f, g, m)
        return (block * self.sign)[np.tril_indices(self.size)] if mirrored else block.ravel()


def _is_own_image(table: np.ndarray, degrees: np.ndarray) -> bool:
    sign = (-1.0) ** np.asarray(degrees)
    image = table[::-1, ::-1, ::-1] * sign[:, None] * sign
    return bool(np.abs(table - image).max() <= EQUAL * np.abs(table).max())
