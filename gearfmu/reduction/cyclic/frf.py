"""How well the reduced body follows its own finite elements: relative Frobenius error over frequency (paper eq. 3).

Compared are transfer matrices H(f) (m/N) between twelve flank loads of tooth 0 (both flanks, three roll points, width
functions P_0 and P_1) and the bore's averaging node with its rotations multiplied, and its moments divided, by the
reference radius:
    reduced    rigid body + modes below `cut` + static residual (C minus the static part of those modes),
    reference  the finite elements of all sectors: rigid body + stored modes + the Taylor series of all other modes in
               s = Ω² up to s³ from C, C M C, C M C M C, …; the neglected share of order (f/f_n)⁸ is below 1e-6 as long
               as f stays under a fifth of the highest stored frequency f_n.
Both have structural damping, K (1 + 2iζ), which is modal damping ζ at resonance and exact for both.
`error` is with the bore node held (all six), because free rigid motion hides errors; `error_free` is that of the free
body's elastic part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearfmu.fem.harmonic import Harmonic, flexibilities
from gearfmu.files import stored
from gearfmu.reduction.cyclic.modal import Modes, Progress, untold
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import Statics

BAND = (50.0, 10e3)
TRUSTED_ERROR = 0.01
_HIGHEST = 20e3
_LINES = 80
_AT_ONCE = 5  # nodal diameters whose loads the interior answers together


@dataclass(frozen=True)
class FrfError:
    """Relative Frobenius error of a reduced body with the nodes `ground` held. Of a gear also error_free; cut and size:
    which modes were dynamic."""

    frequency: np.ndarray = stored(("F",), "Hz", "frequency lines")
    error: np.ndarray = stored(("F",), "", "relative Frobenius error with the ground held (paper eq. 3)")
    band: tuple[float, float] = stored((2,), "Hz", "band of max_error")
    max_error: float = stored((), "", "largest error (ground held) in the band")
    trusted_to: float = stored((), "Hz", "the error stays below 1 % up to this frequency")
    length: float = stored((), "m", "length by which rotations are multiplied")
    ground: tuple[str, ...] = ()
    error_free: np.ndarray | None = stored(
        ("F",), "", "error of the free body's elastic part, with bore ports", optional=True
    )
    cut: float | None = stored(
        (), "Hz", "modes below this were dynamic in the comparison, the others static", optional=True
    )
    size: int | None = stored((), "", "number of modes below the cut", "i8", optional=True)

    @classmethod
    def of(
        cls, frequency: np.ndarray, error: np.ndarray, band: tuple[float, float], length: float, ground: Sequence[str]
    ) -> FrfError:
        """The error over frequency, summed up."""
        inside = (frequency >= band[0]) & (frequency <= band[1] * (1 + 1e-12))
        bad = np.flatnonzero(error > TRUSTED_ERROR)
        trusted = frequency[-1] if len(bad) == 0 else frequency[max(bad[0] - 1, 0)]
        return cls(frequency, error, band, float(error[inside].max()), float(trusted), length, tuple(ground))


@dataclass(frozen=True)
class FrfCase:
    """Damping ratio ζ, wished cut in Hz (moved into the widest gap between 0.9 and 1.1 of it) and length scale in m."""

    damping_ratio: float
    cut: float
    length: float


@dataclass(frozen=True)
class Series:
    """Transfer matrix of the elastic part between m ports as modes and a Taylor series of all that is not in them.

    rows : (m, n) kg^-½ of the modes, frequency (n,) Hz. moments : (m, m) each, Fᵀ C (M C)^j F for j = 0, 1, …, m/N ·
    s^2j. The last six ports are the bore; rotations are lengths.
    """

    rows: np.ndarray
    frequency: np.ndarray
    moments: list[np.ndarray]


def frf_error(body: SectorBody, modes: Modes, statics: Statics, case: FrfCase, progress: Progress = untold) -> FrfError:
    """Relative error of modes below the cut + static residual against the finite elements (see the head of this
    file)."""
    inputs = frf_inputs(len(body.points.rolls), body.points.functions)
    scale = port_scale(len(inputs), case.length)
    static = static_matrix(statics, inputs)
    moments = [m * np.outer(scale, scale) for m in [static, *_moments(body, inputs, progress)]]
    rows = np.vstack([modes.flank_rows[inputs], modes.bore_rows]) * scale[:, None]
    full = Series(rows, modes.frequency, moments)
    rigid = rigid_compliance(body.rigid_rows()[inputs], body.inertia) * np.outer(scale, scale)
    return compare(full, Series(rows, modes.frequency, moments[:1]), rigid, case)


def compare(full: Series, reduced: Series, rigid: np.ndarray, case: FrfCase) -> FrfError:
    """Relative error of `reduced`, cut at the wish of the case, against `full`; rigid (m, m): −Ω² times the rigid
    body's transfer matrix, 1/kg."""
    cut = _cut_in_gap(reduced.frequency, case.cut)
    kept = reduced.frequency < cut
    frequency = np.geomspace(BAND[0], _HIGHEST, _LINES)
    held, free = [], []
    for f in frequency:
        squared = (2 * np.pi * f) ** 2
        s = squared / (1 + 2j * case.damping_ratio)
        exact = _transfer(full.rows, full.frequency, full.moments, s) * s / squared
        ours = _transfer(reduced.rows[:, kept], reduced.frequency[kept], reduced.moments, s) * s / squared
        free.append(_relative(exact, ours))
        held.append(_relative(_bore_held(exact - rigid / squared), _bore_held(ours - rigid / squared)))
    found = FrfError.of(frequency, np.array(held), BAND, case.length, ("bore",))
    return replace(found, error_free=np.array(free), cut=cut, size=int(kept.sum()))


def frf_inputs(rolls: int, functions: int) -> np.ndarray:
    """The flank loads that are compared, as flat indices (side, roll, function)."""
    flat = np.arange(2 * rolls * functions).reshape(2, rolls, functions)
    return flat[:, sorted({rolls // 8, rolls // 2, rolls - 1 - rolls // 8})][:, :, : min(2, functions)].ravel()


def port_scale(flank_ports: int, length: float) -> np.ndarray:
    """Factors that make rotations of the bore lengths, all ports."""
    return np.concatenate([np.ones(flank_ports + 3), np.full(3, length)])


def rigid_compliance(flank: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Rows of the six rigid motions at flank ports (k, 6) and the rigid mass matrix (6, 6) → (k + 6, k + 6), 1/kg."""
    rows = np.vstack([flank, np.eye(6)])
    return rows @ np.linalg.solve(inertia, rows.T)


def static_matrix(statics: Statics, inputs: np.ndarray) -> np.ndarray:
    """Static compliance between chosen flank loads of tooth 0, flat indices (k,), and the bore: (k + 6, k + 6)."""
    size = statics.static_fb[..., 0].size
    flank = statics.static_ff[:, :, 0].transpose(0, 2, 4, 1, 3, 5).reshape(size, size)[np.ix_(inputs, inputs)]
    bore = statics.static_fb.reshape(size, 6)[inputs]
    return np.block([[flank, bore], [bore.T, statics.static_bb]])


def _moments(body: SectorBody, inputs: np.ndarray, progress: Progress) -> list[np.ndarray]:
    """Fᵀ C (M C)^j F for j = 1, 2, 3 over the whole body, flank loads on tooth 0 and bore loads."""
    size = len(inputs) + 6
    total = [np.zeros((size, size)) for _ in range(3)]
    diameters = body.diameters()
    for space in body.spaces:
        for start in range(0, len(diameters), _AT_ONCE):
            progress(f"frequency response, nodal diameter {start}", start / len(diameters))
            harmonics = [space.harmonic(nu) for nu in diameters[start : start + _AT_ONCE]]
            _add_moments(total, body, harmonics, inputs)
    return total


def _add_moments(total: list[np.ndarray], body: SectorBody, harmonics: list[Harmonic], inputs: np.ndarray) -> None:
    ports, loads = [], []
    for harmonic in harmonics:
        seen = np.flatnonzero(np.isin(inputs, body.seen_loads(harmonic.space.parity)))
        own = [body.tooth_forces(harmonic, inputs[seen]) / body.teeth]
        if harmonic.nodal_diameter <= 1:  # no other moves the bore's node
            own.append(body.bore_forces(harmonic))
        loads.append(np.hstack(own).astype(harmonic.dtype))
        bore = range(len(inputs), len(inputs) + 6 * (len(own) - 1))
        ports.append(np.ix_(*2 * [np.concatenate([seen, bore]).astype(int)]))
    first = flexibilities(harmonics, loads)
    inertia = [harmonic.mass(u) for harmonic, u in zip(harmonics, first, strict=True)]
    second = flexibilities(harmonics, inertia)
    for harmonic, at, u, mu, v in zip(harmonics, ports, first, inertia, second, strict=True):
        factor = body.teeth * harmonic.weight
        products = (u.conj().T @ mu, v.conj().T @ mu, v.conj().T @ harmonic.mass(v))
        for matrix, product in zip(total, products, strict=True):
            matrix[at] += factor * product.real


def _cut_in_gap(frequency: np.ndarray, wish: float) -> float:
    """Middle of the widest relative gap between modes within 10 % of the wish; above all modes if they end before."""
    near = frequency[(frequency > 0.9 * wish) & (frequency < 1.1 * wish)]
    if frequency[-1] < wish or len(near) < 2:
        return float(min(wish, 1.0000001 * frequency[-1]) if frequency[-1] < wish else wish)
    widest = np.argmax(np.diff(near))
    return float(0.5 * (near[widest] + near[widest + 1]))


def _transfer(rows: np.ndarray, frequency: np.ndarray, moments: list[np.ndarray], s: complex) -> np.ndarray:
    """Σ N Nᵀ/(ω² − s) + Σ_j s^j (moment_j − Σ N Nᵀ/ω^{2j+2})."""
    squared = (2 * np.pi * frequency) ** 2
    total = (rows / (squared - s)) @ rows.T
    for power, moment in enumerate(moments):
        total = total + s**power * (moment - (rows / squared ** (power + 1)) @ rows.T)
    return total


def _bore_held(h: np.ndarray) -> np.ndarray:
    flank, bore = slice(0, -6), slice(-6, None)
    return h[flank, flank] - h[flank, bore] @ np.linalg.solve(h[bore, bore], h[bore, flank])


def _relative(reference: np.ndarray, approximation: np.ndarray) -> float:
    return float(np.linalg.norm(reference - approximation) / np.linalg.norm(reference))
