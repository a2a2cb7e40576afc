"""Elastic modes of a free gear body: all nodal diameters, both mid-width parities, as real mass-normalised modes.

The sector of a helical gear is not its own mirror image: there is one family for each nodal diameter, of parity 0.

A complex mode U e^{iθj} of 0 < ν < z/2 gives two real ones of the same frequency, its real and its imaginary part.

The terms of a spinning gear (`fem/spinning.py`) are Coriolis coupling, centrifugal load and stiffening, each per power
of the speed: they are numbers of the body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from gearfmu.fem.cyclic import SectorSpace
from gearfmu.fem.harmonic import Harmonic
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.fem.low_fields import LowFields, refined_modes
from gearfmu.fem.spinning import leave_axial, turn_quarter
from gearfmu.files import ROW_BITS, stored
from gearfmu.reduction.cyclic.sector import SectorBody

_SAMPLES = (0.0, 0.2, 1.0)  # nodal diameters, of the largest, that make the space of low modes
_SAMPLED = 1e-4  # residual of their modes
_BESIDE = 3  # modes of a family beyond its share that join the space
_SPACE_SHARE = 0.4  # of the time, for the space

Progress = Callable[[str, float], None]  # what is being done, share done of it


def untold(what: str, share: float) -> None:
    """Progress that nobody asks for."""


@dataclass(frozen=True)
class Spin:
    """Terms of the turning axes, n real modes: Ω turns the pair of a mode by 2Ω coupling."""

    coupling: np.ndarray = stored(
        ("n", "n"), "", "integral of density times mode k . (e_z x mode l), skew", bits=ROW_BITS
    )
    tilt: np.ndarray = stored((2, "n"), "kg1/2.m", "the same with rigid tilt about x and y: of z u_x and z u_y")
    load: np.ndarray = stored(("n",), "kg1/2.m", "centrifugal load per square of the speed")
    stiffening: np.ndarray = stored(("n",), "", "B in ω² = ω₀² + B Ω²: stresses less softening")
    growth: np.ndarray = stored(
        (2, "R", "A"), "m.s2", "flank rows of tooth 0 under centrifugal load per square of the speed"
    )
    inertia: float = stored((), "kg.m2.s2", "what that adds to the polar inertia per square of the speed")


@dataclass(frozen=True)
class FamilySpin:
    """The same of the k sector modes of one family, complex where they are pairs (weight 2): coupling (k, k), tilt (k,)
    of the x component (that of y is i times it), load, stiffening (k,)."""

    coupling: np.ndarray
    tilt: np.ndarray
    load: np.ndarray
    stiffening: np.ndarray


@dataclass(frozen=True)
class Modes:
    """n real elastic modes by ascending frequency; conventions of `body.body.Flank`.

    frequency (n,) Hz; nodal_diameter, part, parity (n,) int; flank_rows (2·R·A, n), kg^-½; bore_rows (6, n), kg^-½
    and kg^-½/m; patch_rows (3, n) of a ring, (0, n) of a gear, kg^-½; tangent_rows (2·R·A, n) or (0, n) where there are
    none, kg^-½: like flank_rows, along the profile. surface (n, P, 3) or None, kg^-½: displacement of chosen points of
    sector 0 in every mode, the second of a pair its imaginary part. spin : what they feel when the body turns; None
    where that was not made.
    """

    frequency: np.ndarray
    nodal_diameter: np.ndarray
    part: np.ndarray
    parity: np.ndarray
    flank_rows: np.ndarray
    bore_rows: np.ndarray
    patch_rows: np.ndarray
    tangent_rows: np.ndarray | None = None
    surface: np.ndarray | None = None
    spin: Spin | None = None


@dataclass(frozen=True)
class _FamilyModes:
    """Sector modes of one family: ω² (k,), rows of all loads of a tooth (m, k), bore rows (6, k), displacement (k, P,
    3) of the chosen points, complex for weight 2; what they feel when the body turns."""

    weight: int
    complete: bool
    squared: np.ndarray
    flank_rows: np.ndarray
    bore_rows: np.ndarray
    surface: np.ndarray
    spin: FamilySpin | None


@dataclass(frozen=True)
class Pattern:
    """A real mode, or two as one complex: ω², nodal diameter, parity, and by name what is read of it."""

    squared: float
    diameter: int
    parity: int
    read: dict[str, np.ndarray]

    @property
    def parts(self) -> tuple[int, ...]:
        """Numbers of its real modes: 0 single, 1 and 2 of a pair."""
        return (1, 2) if any(map(np.iscomplexobj, self.read.values())) else (0,)


def real_modes(patterns: Sequence[Pattern], count: int) -> tuple[dict[str, np.ndarray], list[int]]:
    """The first `count` real modes of patterns, as far as whole patterns go: columns of `Modes` that all bodies have,
    (n,), and what is read, by name, (…, n) of rows and (n, …) of points; and the number of every mode's pattern."""
    found: list[tuple[int, int]] = []
    for number, pattern in enumerate(patterns):
        if len(found) + len(pattern.parts) > count:
            break
        found += [(number, part) for part in pattern.parts]
    owner, part = [number for number, _ in found], np.array([part for _, part in found], int)
    mine = [patterns[number] for number in owner]
    columns = {
        "frequency": np.array([np.sqrt(own.squared) / (2 * np.pi) for own in mine]),
        "nodal_diameter": np.array([own.diameter for own in mine], int),
        "part": part,
        "parity": np.array([own.parity for own in mine], int),
    }
    for name, first in patterns[0].read.items():
        both = [own.read[name].imag if k == 2 else own.read[name].real for own, k in zip(mine, part, strict=True)]
        columns[name] = np.stack(both, 1 if first.ndim == 1 else 0)
    return columns, owner


def elastic_modes(
    body: SectorBody, count: int, progress: Progress = untold, sample: sp.csr_array | None = None
) -> Modes:
    """The `count` lowest elastic modes of the free body (one less where `count` would split a pair).

    sample (P, N) : points of sector 0 from its nodes, whose displacement is kept in every mode (`Modes.surface`).

    A few families are solved first and tell, by a small space that holds their modes (`LowFields`), how many modes of
    each family are wanted, and near where they are. A family whose highest frequency does not lie above the last mode
    kept is solved again for more: no mode is missed. Raises ModesError when the eigensolver fails.
    """
    chosen = sp.csr_array((0, len(body.mesh.nodes))) if sample is None else sample
    lows = [_low_fields(body, space, count, progress) for space in body.spaces]
    families = [(s, nu) for s in range(len(body.spaces)) for nu in body.diameters()]
    wanted = _expected(body, lows, count)
    found: dict[tuple[int, int], _FamilyModes] = {}
    while True:
        open_families = [
            key
            for key in families
            if key not in found or not found[key].complete and len(found[key].squared) < wanted[key]
        ]
        number = 0
        for index, low in enumerate(lows):
            for mine in refined_modes(low, {nu: wanted[s, nu] for s, nu in open_families if s == index}):
                nu = mine[0].nodal_diameter
                done = number / len(open_families)
                progress(f"modes, nodal diameter {nu}", _SPACE_SHARE + (1 - _SPACE_SHARE) * done)
                found[index, nu] = _made(body, mine, chosen)
                number += 1
        limit = _limit(found.values(), count)
        again = [k for k in families if found[k].squared[-1] < limit and not found[k].complete]
        if not again:
            return _assembled(body, found, count)
        for key in again:
            wanted[key] = int(np.ceil(1.3 * wanted[key])) + 2


def _low_fields(body: SectorBody, space: SectorSpace, count: int, progress: Progress) -> LowFields:
    """The space of the modes of a few nodal diameters; low ones have the most modes in a band."""
    low, last = LowFields(space), body.diameters()[-1]
    diameters = sorted({round(part * last) for part in _SAMPLES})
    for number, nu in enumerate(diameters):
        progress(f"space of low modes, nodal diameter {nu}", _SPACE_SHARE * number / len(diameters))
        harmonic, wide = space.harmonic(nu), 2 - 1.5 * nu / last
        low.add(harmonic, lowest_modes(harmonic, int(wide * _share(body, count)) + _BESIDE, _SAMPLED)[1])
    return low


def _share(body: SectorBody, count: int) -> int:
    """Modes that a family has among the `count` lowest, and some more."""
    mean = count / (body.teeth * len(body.spaces))
    return int(np.ceil(mean + np.sqrt(mean))) + 1


def _expected(body: SectorBody, lows: list[LowFields], count: int) -> dict[tuple[int, int], int]:
    """How many modes of every family to look for: those among the `count` lowest and one more."""
    most, near = 2 * _share(body, count) + _BESIDE, {}
    for index, (space, low) in enumerate(zip(body.spaces, lows, strict=True)):
        for nu in body.diameters():
            squared = low.modes(space.harmonic(nu), most)[0]
            near[index, nu] = np.repeat(squared, 1 if nu == 0 or 2 * nu == body.teeth else 2), squared
    every = np.sort(np.concatenate([repeated for repeated, _ in near.values()]))
    limit = every[min(count, len(every)) - 1]
    return {key: max(1, int((squared <= limit).sum()) + 1) for key, (_, squared) in near.items()}


def _limit(found: Iterable[_FamilyModes], count: int) -> float:
    """ω² of the `count`-th real mode among those found."""
    squared = np.sort(np.concatenate([np.repeat(m.squared, m.weight) for m in found]))
    return squared[min(count, len(squared)) - 1]


def _made(body: SectorBody, modes: tuple[Harmonic, np.ndarray, np.ndarray], sample: sp.csr_array) -> _FamilyModes:
    harmonic, squared, shapes = modes
    weight, seen = harmonic.weight, body.seen_loads(harmonic.space.parity)
    shapes = shapes * np.sqrt(weight / body.teeth)
    fields = harmonic.space.to_nodes @ harmonic.expand(shapes)
    flank = np.zeros((body.load_matrix.shape[0], len(squared)), shapes.dtype)
    flank[seen] = body.load_matrix[seen] @ fields
    gauge = _phases(flank[: body.profile_loads])
    fields, flank = fields * gauge, flank * gauge
    bore = body.teeth * (body.bore_parts(harmonic).conj().T @ (body.bore_moments[0] @ fields))
    surface = np.zeros((len(squared), sample.shape[0], 3), shapes.dtype)
    for k in range(len(squared) if sample.shape[0] else 0):
        surface[k] = sample @ fields[:, k].reshape(-1, 3)
    spin = family_spin(body, harmonic.nodal_diameter, weight, fields) if body.knows_stress else None
    return _FamilyModes(weight, len(squared) >= harmonic.elastic, squared, flank, bore, surface, spin)


def _phases(rows: np.ndarray) -> np.ndarray:
    """Factors that fix the free sign, or the free phase of a pair: the real part dominates the flank rows, its largest
    entry is positive. Modes that leave the flanks at rest keep their sign."""
    square = (rows**2).sum(axis=0)
    moving = np.abs(square) > 1e-20 * (np.abs(rows) ** 2).sum(axis=0).max(initial=1e-300)
    turn = np.where(moving, np.exp(-0.5j * np.angle(square)), 1.0)
    turned = (rows * turn).real
    largest = turned[np.abs(turned).argmax(axis=0), np.arange(rows.shape[1])]
    turn = turn * np.where(largest < 0, -1.0, 1.0)
    return turn if np.iscomplexobj(rows) else turn.real.round()


def _assembled(body: SectorBody, found: dict[tuple[int, int], _FamilyModes], count: int) -> Modes:
    entries = [(m.squared[k], key, k) for key, m in found.items() for k in range(len(m.squared))]
    entries.sort(key=lambda entry: entry[0])
    patterns = []
    for squared, (index, nu), k in entries:
        m = found[index, nu]
        read = {"all_rows": m.flank_rows[:, k], "bore_rows": m.bore_rows[:, k], "surface": m.surface[k]}
        patterns.append(Pattern(squared, nu, body.spaces[index].parity, read))
    columns, owner = real_modes(patterns, count)
    flank, patch, tangent = np.split(columns.pop("all_rows"), [body.flank_count, body.profile_loads])
    spins = []  # none where the body does not know them
    for (_, key, k), part in zip((entries[number] for number in owner), columns["part"].tolist(), strict=True):
        if (spin := found[key].spin) is not None:
            spins.append((spin, k, part))
    joined = _joined_spin(body, spins) if spins else None
    return Modes(flank_rows=flank, patch_rows=patch, tangent_rows=tangent, spin=joined, **columns)


def family_spin(body: SectorBody, diameter: int, weight: int, shapes: np.ndarray) -> FamilySpin:
    """shapes (3N, k) of the sector, of unit mass over the whole body."""
    scale, nodes = body.teeth / weight, body.mesh.nodes
    mass = body.mass_matrix @ shapes
    own = mass.conj().T
    high = np.zeros_like(nodes)
    high[:, 0] = nodes[:, 2]
    along_x = high.ravel() @ mass
    along_y = turn_quarter(high.ravel()) @ mass
    stress = (body.stress_stiffness @ shapes.reshape(len(nodes), -1)).reshape(shapes.shape)
    square = (shapes.conj() * (stress - body.mass_matrix @ leave_axial(shapes))).sum(axis=0).real
    radial = leave_axial(nodes.ravel()) @ mass
    return FamilySpin(
        coupling=scale * (own @ turn_quarter(shapes)),
        tilt=scale * (along_x - 1j * along_y) * (diameter == 1),
        load=scale * radial.real * (diameter == 0),
        stiffening=scale * square,
    )


def _joined_spin(body: SectorBody, entries: Sequence[tuple[FamilySpin, int, int]]) -> Spin:
    """entries: of every real mode its family, its number there, and its part (0 single, 1 and 2 of a pair)."""
    n = len(entries)
    coupling, tilt, load, stiffening = np.zeros((n, n)), np.zeros((2, n)), np.zeros(n), np.zeros(n)
    for i, (family, k, part) in enumerate(entries):
        rotated = family.tilt[k] * (-1j if part == 2 else 1)
        tilt[:, i] = rotated.real, (1j * rotated).real
        load[i], stiffening[i] = family.load[k], family.stiffening[k]
        for j, (other, m, there) in enumerate(entries):
            if other is family:
                turned = family.coupling[k, m] * (1j if part == 2 else 1) * (-1j if there == 2 else 1)
                coupling[i, j] = turned.real
    rows = body.load_matrix[: body.flank_count] @ body.growth
    shape = (2, len(body.points.rolls), body.points.functions)
    radial = leave_axial(body.mesh.nodes.ravel()) @ (body.mass_matrix @ body.growth)
    return Spin(
        0.5 * (coupling - coupling.T), tilt, load, stiffening, rows.reshape(shape), float(2 * body.teeth * radial)
    )
