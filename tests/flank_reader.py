"""The full tables of a gear's flanks from the sections of a model, on the even grid of rolls: a reader of its own,
beside those of the kernel and of the writer."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np

from gearfmu.stage.assembly.blob import SIZES
from gearfmu.stage.assembly.ground_part import turn_tables


def full_tables(sections: Mapping[str, np.ndarray], gear: int, rolls: int, number: int = 0) -> SimpleNamespace:
    """rows (2, R, A, n), ground (3, 2, R, A, reads) beside the rigid motion, supports (3, 2, R, A, s),
    port (2, R, A, p), residual (2, 2, 7, R, R, A, A); ground in set `number` of ground oscillators."""
    s = sections
    size, degrees = dict(zip(SIZES, s[f"size{gear}"], strict=True)), np.asarray(s["degrees"])
    points, functions, modes = int(size["points"]), len(degrees), int(size["modes"])
    spread = np.reshape(s[f"resample{gear}"], (rolls, points))

    def along(name: str, *shape: int) -> np.ndarray:
        return np.asarray(s[f"{name}{gear}"], float).reshape(*shape)

    low = along("low_rows", 2, points, functions, int(size["low"]))
    patterns = turn_tables(low, np.asarray(s[f"low_member{gear}"]))
    node = along("node", 3, 2, points, functions, 6)
    reads = len(s[f"ground_list{gear}_{number}"])
    ground = patterns @ np.reshape(s[f"low_ground{gear}_{number}"], (-1, reads))
    ground = ground + node @ np.reshape(s[f"node_ground{gear}_{number}"], (6, reads))
    return SimpleNamespace(
        rows=np.einsum("rp,fpan->fran", spread, along("rows", 2, points, functions, modes)),
        ground=np.einsum("rp,cfpan->cfran", spread, ground),
        supports=np.einsum("rp,cfpan->cfran", spread, node @ np.reshape(s[f"node_support{gear}"], (6, -1))),
        port=np.einsum("rp,fpan->fran", spread, along("port_residual", 2, points, functions, -1)),
        residual=np.einsum("ri,qj,fgmijab->fgmrqab", spread, spread, _residual(along, size, degrees), optimize=True),
    )


def _residual(along, size: Mapping[str, int], degrees: np.ndarray) -> np.ndarray:
    """(2, 2, 7, P, P, A, A)."""
    points, functions, mirrored = int(size["points"]), len(degrees), bool(size["mirrored"])
    n, flanks = points * functions, 1 if mirrored else 2
    sign = np.tile((-1.0) ** degrees, points)
    own, next_, across = (
        along("residual_own", flanks, -1),
        along("residual_next", flanks, 3, n, n),
        along("residual_across", 7, -1),
    )
    blocks = np.zeros((2, 2, 7, n, n))
    for f in range(flanks):
        blocks[f, f, 3] = _symmetric(own[f], n)
        blocks[f, f, 4:] = next_[f]
    for i, (f, m) in enumerate([(0, 0)] + [(f, m) for m in (1, 2, 3) for f in (0, 1)]):
        blocks[f, 1 - f, 3 + m] = _symmetric(across[i], n) * sign if mirrored else across[i].reshape(n, n)
    blocks[1, 0, 3] = blocks[0, 1, 3].T
    if mirrored:
        blocks[1, 1, 3:] = sign[:, None] * blocks[0, 0, 3:].transpose(0, 2, 1) * sign
    for m in (1, 2, 3):
        blocks[:, :, 3 - m] = blocks[:, :, 3 + m].transpose(1, 0, 3, 2)
    return blocks.reshape(2, 2, 7, points, functions, points, functions).transpose(0, 1, 2, 3, 5, 4, 6)


def _symmetric(half: np.ndarray, n: int) -> np.ndarray:
    full = np.zeros((n, n))
    full[np.tril_indices(n)] = half
    return full + np.tril(full, -1).T
