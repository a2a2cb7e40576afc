"""A whole gear of any mesh, brought to the form of a cyclic body: the mean over all its teeth.

The kernel reads rows of one tooth and a nodal diameter for each mode. Of a body that is only nearly cyclic (free mesh,
keyway, a web with other than z holes) it gets the mean of the transfer matrix over all turns by one tooth, which has
that form exactly. With r_k(j) the rows of mode k on tooth j, in that tooth's frame, and
    R_k(ν) = 1/z Σ_j r_k(j) e^{−2πiνj/z},
    1/z Σ_g r_k(i + g) r_k(j + g)ᵀ = Σ_ν R_k(ν) R_k(ν)ᴴ e^{2πiν(i−j)/z}:
mode k adds one pair with amplitude √2 R_k(ν) to every 0 < ν < z/2 and one single mode to ν = 0 and z/2. Contributions
of nearly equal frequency are gathered by their principal directions (two modes of a split pair give one pair); what is
left out as too weak goes into the static compliance, whose mean over the teeth is exact. The bore, seen from each
tooth, is treated like rows of that tooth. How far single teeth are from the mean is reported.
Source: the mean over a group of turns is the nearest block-circulant matrix: Chan, SIAM J. Sci. Stat. Comput. 9 (1988).
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter

import numpy as np
import scipy.sparse as sp

from gearfmu.geometry.plane import frames
from gearfmu.reduction.cyclic.flank import Points
from gearfmu.reduction.cyclic.frf import (
    FrfCase,
    FrfError,
    Series,
    compare,
    frf_inputs,
    port_scale,
    rigid_compliance,
    static_matrix,
)
from gearfmu.reduction.cyclic.modal import Modes, Pattern, Progress, real_modes, untold
from gearfmu.reduction.cyclic.statics import Statics, by_load, symmetric_offsets
from gearfmu.reduction.elastic import Elastic
from gearfmu.reduction.full_order import FullOrder

_WINDOW = 3e-3  # relative frequency difference within which contributions are gathered
_WEAK = 1e-3  # share of the static compliance of its cluster, all nodal diameters, below which it goes to the residual
_PURE = 1e-3  # share of the other parity's rows up to which a mode counts as symmetric or antisymmetric


@dataclass(frozen=True)
class WholeGear:
    """A gear with all its teeth: `body` with the interface "bore"; flank_rows: one (2·R·A, N) matrix a tooth, in the
    order side, roll, function; points: where the flanks are loaded."""

    body: FullOrder
    flank_rows: tuple[sp.csr_array, ...]
    points: Points

    @property
    def teeth(self) -> int:
        return len(self.flank_rows)

    @property
    def bore_rows(self) -> sp.csr_array:
        """The six rows of the bore node."""
        return self.body.rows("bore")

    @property
    def inertia(self) -> np.ndarray:
        """Mass matrix (6, 6) of the rigid body about the origin, mean over the teeth."""
        turns = frames(self.teeth)
        whole = self.body.rigid.T @ (self.body.mass @ self.body.rigid)
        return np.mean([turn.T @ whole @ turn for turn in turns], axis=0)


_Found = tuple[float, int, np.ndarray]  # of an oscillator: ω², nodal diameter, amplitude (L + 6,) with the bore last


def mean_modes(gear: WholeGear, space: Elastic, count: int, progress: Progress = untold) -> tuple[Modes, float]:
    """Modes of the mean tooth from the `count` lowest modes of the whole gear, and the share of their static compliance
    that was left to the residual."""
    progress("modes of the whole gear", 0.0)
    squared, shapes = space.modes(count)
    rows = np.stack(
        [
            np.vstack([r @ shapes, turn.T @ (gear.bore_rows @ shapes)])
            for r, turn in zip(gear.flank_rows, frames(gear.teeth), strict=True)
        ]
    )
    flank = rows.shape[1] - 6
    scale = np.ones(flank + 6)
    scale[flank:] = np.abs(rows[:, :flank]).max() / np.abs(rows[:, flank:]).max(axis=(0, 2)) / np.sqrt(flank)
    amplitude = np.fft.rfft(rows, axis=0) / gear.teeth * scale[:, None]
    nu = np.arange(len(amplitude))
    amplitude[(nu > 0) & (2 * nu < gear.teeth)] *= np.sqrt(2)
    found, left = [], 0.0
    for members in _clusters(np.sqrt(squared)):
        weighted = amplitude[:, :, members] / np.sqrt(squared[members])
        kept, lost = _directions(weighted, squared[members], gear.teeth)
        found += [(mean, diameter, part / scale) for mean, diameter, part in kept]
        left += lost
    total = float((np.abs(amplitude) ** 2 / squared).sum())
    return _as_modes(sorted(found, key=itemgetter(0)), gear, count), left / total


def _clusters(frequency: np.ndarray) -> list[np.ndarray]:
    """Runs of modes, each within `_WINDOW` of the next: a run ends at a gap."""
    ends = np.flatnonzero(np.diff(frequency) > _WINDOW * frequency[1:]) + 1
    return np.split(np.arange(len(frequency)), ends)


def _directions(weighted: np.ndarray, squared: np.ndarray, teeth: int) -> tuple[list[_Found], float]:
    """Oscillators of one cluster from its amplitudes over ω (ν, L + 6, k), and the compliance left out."""
    found, left = [], 0.0
    whole = float((np.abs(weighted) ** 2).sum())
    for nu, block in enumerate(weighted):
        single = nu == 0 or 2 * nu == teeth
        directions, sizes, mix = np.linalg.svd(block.real if single else block, full_matrices=False)
        for direction, size, share in zip(directions.T, sizes, mix, strict=True):
            if size**2 < _WEAK * whole:
                left += float(size**2)
                continue
            mean = float(1 / (np.abs(share) ** 2 / squared).sum())
            found.append((mean, nu, direction * size * np.sqrt(mean)))
    return found, left


def _as_modes(found: list[_Found], gear: WholeGear, count: int) -> Modes:
    odd = np.tile(np.arange(gear.points.functions), 2 * len(gear.points.rolls)) % 2 == 1
    patterns = []
    for squared, nu, amplitude in found:
        amplitude = _turned(amplitude, len(odd))
        flank, parity = _of_one_parity(amplitude[: len(odd)], odd)
        read = {"flank_rows": flank, "bore_rows": amplitude[len(odd) :]}
        patterns.append(Pattern(squared, nu, parity, read))
    columns, _ = real_modes(patterns, count)
    return Modes(patch_rows=np.zeros((0, len(columns["part"]))), spin=None, **columns)


def _turned(amplitude: np.ndarray, flank: int) -> np.ndarray:
    """The same pair with the phase at which its flank rows are as real as can be and the largest is positive."""
    rows = amplitude[:flank]
    turned = amplitude * np.exp(-0.5j * np.angle((rows**2).sum()))
    real = turned[:flank].real
    turned = turned * (-1.0 if real[np.abs(real).argmax()] < 0 else 1.0)
    return turned if np.iscomplexobj(amplitude) else turned.real


def _of_one_parity(flank: np.ndarray, odd: np.ndarray) -> tuple[np.ndarray, int]:
    """Rows with the weak parity about mid-width left out, and that parity; 0 when both are there."""
    share = float((np.abs(flank[odd]) ** 2).sum() / max((np.abs(flank) ** 2).sum(), 1e-300))
    if share < _PURE:
        return np.where(odd, 0.0, flank), 1
    if share > 1 - _PURE:
        return np.where(odd, flank, 0.0), -1
    return flank, 0


def mean_statics(
    gear: WholeGear, space: Elastic, picture_loads: list[int], progress: Progress = untold
) -> tuple[Statics, float]:
    """Static tables of the mean tooth, and how far teeth are from it: largest relative deviation of the compliance
    under the uniform load at mid flank. Pictures: displacement (p, N) under loads on tooth 0."""
    z, points = gear.teeth, gear.points
    size, turns = gear.flank_rows[0].shape[0], frames(z)
    bore = space.flexibility(gear.bore_rows.T.toarray())
    tables, fb, pictures, mid = np.zeros((z, size, size)), np.zeros((size, 6)), np.zeros((0, space.size)), []
    place = (len(points.rolls) // 2) * points.functions
    for tooth, rows in enumerate(gear.flank_rows):
        progress("static compliance", tooth / z)
        response = space.flexibility(rows.T.toarray())
        if tooth == 0:
            pictures = response[:, picture_loads].T.copy()
        for other, seen in enumerate(gear.flank_rows):
            tables[(tooth - other) % z] += (seen @ response) / z
        mid.append(float((rows @ response)[place, place]))
        fb += (rows @ bore) @ turns[tooth] / z
    whole = gear.bore_rows @ bore
    bb = np.mean([turn.T @ whole @ turn for turn in turns], axis=0)
    rolls, functions = len(points.rolls), points.functions
    statics = Statics(
        static_ff=by_load(symmetric_offsets(tables), points),
        static_fb=fb.reshape(2, rolls, functions, 6),
        static_bb=0.5 * (bb + bb.T),
        pictures=pictures,
    )
    return statics, float(np.abs(np.array(mid) / np.mean(mid) - 1).max())


def mean_frf(gear: WholeGear, space: Elastic, modes: Modes, statics: Statics, case: FrfCase) -> FrfError:
    """Error of the mean tooth's modes and residual against the finite elements of this gear, at its tooth 0: what the
    mean leaves out is part of the error."""
    inputs = frf_inputs(len(gear.points.rolls), gear.points.functions)
    scale = port_scale(len(inputs), case.length)
    ports = sp.csr_array(sp.vstack([gear.flank_rows[0][inputs], gear.bore_rows]))
    weight = np.outer(scale, scale)
    squared, shapes = space.modes(len(modes.frequency))
    first = space.flexibility(ports.T.toarray())
    inertia = space.mass(first)
    second = space.flexibility(inertia)
    moments = [ports @ first, first.T @ inertia, second.T @ inertia, second.T @ space.mass(second)]
    full = Series((ports @ shapes) * scale[:, None], np.sqrt(squared) / (2 * np.pi), [m * weight for m in moments])
    static = static_matrix(statics, inputs) * weight
    rows = np.vstack([modes.flank_rows[inputs], modes.bore_rows]) * scale[:, None]
    rigid = rigid_compliance(gear.flank_rows[0][inputs] @ gear.body.rigid, gear.inertia) * weight
    return compare(full, Series(rows, modes.frequency, [static]), rigid, case)
