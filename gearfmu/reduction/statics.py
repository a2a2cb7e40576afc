"""Static compliance of a free gear body between tooth flanks and bore: C = Pᵀ K⁺ P, inertia relief, mean-axis gauge.

Each harmonic contributes Fᴴ C_ν F; tooth offset m is their Fourier sum. For a body that is its own mirror image about
mid-width, loads of even and odd width functions do not see each other: those entries are zero exactly. Loads along the
profile (friction) are answered on the own tooth only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearfmu.fem.cyclic import SectorSpace
from gearfmu.reduction.modal import Progress
from gearfmu.reduction.sector import Family, SectorBody


@dataclass(frozen=True)
class Statics:
    """Static compliance, conventions of `body.ReducedBody`: C_ff (2, 2, z, R, R, A, A), m/N; C_fb (2, R, A, 6), m/N and
    1/N; C_bb (6, 6), m/N … 1/(N·m). pictures : (p, z, 3N) displacement of all sectors, in sector frames, under the
    unit flank loads asked for, m/N. Of a ring also static_fp (2, z, R, A, 3), flank row of tooth 0 per unit force x, y,
    z (sector frame) on the rim patch of sector m, and static_pp (z, 3, 3), m/N; empty (last index 0) of a gear.
    static_nt, static_tt (2, 2, R, R, A, A), m/N: displacement along the normal and along the profile at (tooth 0, flank
    f, roll i, function a) per load along the profile at (tooth 0, g, j, b); None where there are no such rows."""

    static_ff: np.ndarray
    static_fb: np.ndarray
    static_bb: np.ndarray
    static_fp: np.ndarray
    static_pp: np.ndarray
    pictures: np.ndarray
    static_nt: np.ndarray | None = None
    static_tt: np.ndarray | None = None


def static_tables(body: SectorBody, picture_loads: list[int], progress: Progress | None = None) -> Statics:
    """Compliance of all flank points and the bore for every tooth offset.

    picture_loads : flat indices (side, roll, function) of loads on tooth 0 whose displacement is wanted everywhere.
    """
    size, every, z = body.profile_loads, len(body.load_rows), body.teeth
    ff, fb, bb = np.zeros((z, size, size)), np.zeros((every, 6)), np.zeros((6, 6))
    own = np.zeros((every, every))
    pictures = np.zeros((len(picture_loads), z, body.mesh.nodes.size))
    for index, space in enumerate(body.spaces):
        for nu in body.diameters():
            if progress:
                progress(f"static compliance, nodal diameter {nu}", nu / (z // 2 + 1))
            family = body.family(index, nu)
            response = family.flank_response()
            turn = np.exp(-2j * np.pi * nu * np.arange(z) / z)
            product = family.weight / z * (family.flank.conj().T @ response)
            normal = family.columns[family.columns < size]
            among = np.multiply.outer(turn, product[: len(normal), : len(normal)]).real
            ff[np.ix_(np.arange(z), normal, normal)] += among
            own[np.ix_(family.columns, family.columns)] += product.real
            _add_pictures(pictures, space, family, response, picture_loads)
            if nu <= 1:
                bore = family.harmonic.flexibility(family.bore)
                fb[family.columns] += family.weight * (family.flank.conj().T @ bore).real
                bb += z * family.weight * (family.bore.conj().T @ bore).real
    shaped = _shaped(body, ff, fb[:size], bb, pictures)
    return replace(shaped, **_along_profile(body, 0.5 * (own + own.T)))


def _along_profile(body: SectorBody, own: np.ndarray) -> dict[str, np.ndarray]:
    """Tables of loads along the profile from the compliance (every, every) of all loads of one tooth."""
    points, first = len(body.flank_rows), body.profile_loads
    if first == len(own):
        return {}
    shape = (2, len(body.points.rolls), body.points.functions)
    blocks = {"static_nt": own[:points, first:], "static_tt": own[first:, first:]}
    return {
        name: np.ascontiguousarray(block.reshape(*shape, *shape).transpose(0, 3, 1, 4, 2, 5))
        for name, block in blocks.items()
    }


def _add_pictures(
    pictures: np.ndarray, space: SectorSpace, family: Family, response: np.ndarray, loads: list[int]
) -> None:
    z, nu = space.teeth, family.harmonic.nodal_diameter
    turn = np.exp(2j * np.pi * nu * np.arange(z) / z)
    for row, load in enumerate(loads):
        column = np.flatnonzero(family.columns == load)
        if len(column):
            shape = space.to_nodes @ family.harmonic.expand(response[:, column])
            pictures[row] += family.weight / z * np.multiply.outer(turn, shape[:, 0]).real


def _shaped(body: SectorBody, ff: np.ndarray, fb: np.ndarray, bb: np.ndarray, pictures: np.ndarray) -> Statics:
    rolls, functions, z = len(body.points.rolls), body.points.functions, body.teeth
    back = ff[(-np.arange(z)) % z].transpose(0, 2, 1)
    both, flank = 0.5 * (ff + back), 2 * rolls * functions
    shaped = both[:, :flank, :flank].reshape(z, 2, rolls, functions, 2, rolls, functions)
    static_ff = np.ascontiguousarray(shaped.transpose(1, 4, 0, 2, 5, 3, 6))
    static_fp = both[:, :flank, flank:].reshape(z, 2, rolls, functions, -1).transpose(1, 0, 2, 3, 4)
    static_fb = fb[:flank].reshape(2, rolls, functions, 6)
    return Statics(static_ff, static_fb, 0.5 * (bb + bb.T), static_fp, both[:, flank:, flank:], pictures)
