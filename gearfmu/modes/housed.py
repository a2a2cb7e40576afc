"""A housing under a finished run of a stage on rigid ground: forces on its seats, motion, accelerations, mounts.

The run gives the forces f₀ of the bearings on rigid seats (blocked forces). Seats of receptance Y yield by u = Y f and
change them by the dynamic stiffness D of the linearised stage at its outer rings (`rings`), so

    f = f₀ − D u = (I + D Y)⁻¹ f₀                                                                        for each ω

Exact for a linear stage, both ways; a run on rigid ground without D errs by 10 dB and more. Source: D. de Klerk et al.,
AIAA J. 46 (2008) 1169 (substructuring by frequency response; blocked forces).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearfmu.modes.rings import Rings

CHUNK = 256  # lines solved together
RAMP = 0.05  # part of the record over which forces fade in and out


@dataclass(frozen=True)
class Housing:
    """A free elastic body on feet. mass (6, 6): of its rigid motion; omega, zeta (n,) of its modes, mass-normalised;
    seats (s, 6 + n), in the order and directions of the rings' forces, feet (f, 6 + n), sensors (r, 6 + n): motion per
    coordinate, rigid ones first; residual (s + f + r, s + f) m/N: their static motion beyond the modes per force on
    seats and feet; foot, foot_loss (f,): N/m and N·s/m of the springs to the ground, none for a free housing."""

    mass: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    seats: np.ndarray
    feet: np.ndarray
    sensors: np.ndarray
    residual: np.ndarray
    foot: np.ndarray
    foot_loss: np.ndarray

    def free(self, omega: np.ndarray) -> np.ndarray:
        """(L, 6 + n, 6 + n): coordinates per generalised force, without feet, at ω (L,) > 0."""
        n = len(self.omega)
        found = np.zeros((len(omega), 6 + n, 6 + n), dtype=complex)
        found[:, :6, :6] = -np.linalg.inv(self.mass) / omega[:, None, None] ** 2
        w = omega[:, None]
        own = np.arange(6, 6 + n)
        found[:, own, own] = 1 / (self.omega**2 + 2j * self.zeta * self.omega * w - w**2)
        return found

    def answers(self, omega: np.ndarray) -> Answers:
        """Of the housing on its feet at ω (L,) > 0 rad/s."""
        s, rows = len(self.seats), np.vstack([self.seats, self.feet])
        free = self.free(omega)
        compliance = rows @ free @ rows.T + self.residual[: len(rows)]
        spring = self.foot + 1j * omega[:, None] * self.foot_loss
        held = compliance[:, s:, s:] + np.eye(len(self.foot)) / spring[:, None, :]
        reaction = -np.linalg.solve(held, compliance[:, s:, :s])
        seats = compliance[:, :s, :s] + compliance[:, :s, s:] @ reaction
        coordinates = free @ (self.seats.T + self.feet.T @ reaction)
        static = self.residual[len(rows) :]
        sensors = self.sensors @ coordinates + static[:, :s] + static[:, s:] @ reaction
        return Answers(seats, coordinates, sensors, -reaction)


@dataclass(frozen=True)
class Answers:
    """Per unit force on each of s seats, at L lines: receptance of the seats Y (L, s, s), coordinates (L, 6 + n, s),
    displacement of the sensors (L, r, s), forces on the ground at the feet (L, f, s)."""

    seats: np.ndarray
    coordinates: np.ndarray
    sensors: np.ndarray
    mounts: np.ndarray


@dataclass(frozen=True)
class Housed:
    """Of T samples, without their mean: force (T, s) N on the seats, coordinates (T, 6 + n) and their velocity, sensor
    (T, r) m/s² and mount (T, f) N on the ground. Nothing above the band."""

    force: np.ndarray
    coordinates: np.ndarray
    velocity: np.ndarray
    sensor: np.ndarray
    mount: np.ndarray


def seat_forces(rings: Rings, answers: Answers, omega: np.ndarray, blocked: np.ndarray) -> np.ndarray:
    """(L, s, 1): forces on seats that yield, from those on rigid ones, blocked (L, s), at ω (L,) > 0 rad/s."""
    yielding = np.eye(len(rings.names)) + rings.dynamic_stiffness(omega) @ answers.seats
    return np.linalg.solve(yielding, blocked[:, :, None])


def housed(rings: Rings, housing: Housing, forces: np.ndarray, step: float, highest: float) -> Housed:
    """The housing under forces (T, s) N that a run on rigid ground recorded every `step` (s), up to `highest` (Hz).

    Forces fade in and out over RAMP of the record; its length is doubled with zeros, so that the housing can ring."""
    count = len(forces)
    size = 2 * count
    spectrum = np.fft.rfft(_faded(forces - forces.mean(axis=0)), size, axis=0)
    omega = 2 * np.pi * np.fft.rfftfreq(size, step)
    last = int(np.searchsorted(omega, 2 * np.pi * highest, side="right"))
    found = {name: np.zeros((len(omega), width), dtype=complex) for name, width in _widths(housing).items()}
    for begin in range(1, last, CHUNK):
        lines = slice(begin, min(begin + CHUNK, last))
        _solve(rings, housing, omega[lines], spectrum[lines], {name: own[lines] for name, own in found.items()})
    return Housed(**{name: np.fft.irfft(own, size, axis=0)[:count] for name, own in found.items()})


def _widths(housing: Housing) -> dict[str, int]:
    n = 6 + len(housing.omega)
    sizes = (len(housing.seats), n, n, len(housing.sensors), len(housing.feet))
    return dict(zip(("force", "coordinates", "velocity", "sensor", "mount"), sizes, strict=True))


def _solve(
    rings: Rings, housing: Housing, omega: np.ndarray, blocked: np.ndarray, found: dict[str, np.ndarray]
) -> None:
    """Fill `found` at some lines."""
    answers = housing.answers(omega)
    force = seat_forces(rings, answers, omega, blocked)
    moved = (answers.coordinates @ force)[:, :, 0]
    found["force"][:], found["mount"][:] = force[:, :, 0], (answers.mounts @ force)[:, :, 0]
    found["coordinates"][:], found["velocity"][:] = moved, 1j * omega[:, None] * moved
    found["sensor"][:] = -(omega[:, None] ** 2) * (answers.sensors @ force)[:, :, 0]


def _faded(values: np.ndarray) -> np.ndarray:
    """Values with the ends of the record brought to 0 by half a cosine."""
    ramp = max(1, int(RAMP * len(values)))
    window = np.ones(len(values))
    window[:ramp] = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    window[-ramp:] = window[:ramp][::-1]
    return values * window[:, None]


def paths(housing: Housing, omega: np.ndarray, force: np.ndarray, sensor: int) -> np.ndarray:
    """(…, L, s): acceleration at one sensor row by each seat direction under its force (…, L, s) at ω (L,) > 0 rad/s;
    their complex sum is that of the sensor."""
    found = [housing.answers(omega[begin : begin + CHUNK]).sensors[:, sensor] for begin in range(0, len(omega), CHUNK)]
    return -(omega[:, None] ** 2) * np.concatenate(found) * force
