"""Gyroscopic and Coriolis forces in the kernel: free flight of the small pair after a kick against the exponential of
its linear system, order of the step, energy, and the explicit peers."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sl
from small_model import pair_blob

from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import read_blob, write_blob

SPEED, APART = 600.0, 1.0  # rad/s of the pinion; what it lags behind the wheel by, so that teeth part
STEP = 2e-5  # s
LANES = 16  # of the states of a gear group
RATES = np.array([0.8, 0.8, -0.6, -0.6])  # of the gears' two pairs
FREE = {"effect.modal_damping": 0.0, "effect.contact_damping": 0.0, "level": 3.0}
VIBRATING = 1e-3  # m/s·√kg: some tenths of a micrometre
FEW, MANY = 2, 20  # turning pairs; many of the same oscillators are turned together (gk_crowd.c)


@cache
def spinning_blob(pairs: int) -> bytes:
    """The small pair without dashpots at its bearings; with all ground patterns of the pinion in some pairs, those of
    the gear group turning forth and back."""
    sections: dict[str, Any] = dict(read_blob(pair_blob(("torque", "torque"))))
    rng = np.random.default_rng(5)
    for s in (0, 1):
        sections[f"damper{s}"] = 0.0 * sections[f"damper{s}"]
        own = sections[f"ground_list0_{s}"]
        rows = np.zeros((pairs, 2, sections[f"omega_ground{s}"].size))
        rows[..., own] = 0.5 * rng.standard_normal((pairs, 2, own.size))
        if pairs:
            sections[f"whirl_rows{s}"] = rows
    if pairs:
        sections |= {"whirl": np.zeros(pairs, np.int32), "turn_rate0": RATES, "turn_rate1": RATES}
    return write_blob(sections)


class Flight:
    """A run in which no tooth touches: kicked, then free."""

    def __init__(self, pairs: int = FEW, speed: float = SPEED, apart: float = APART, **parameters: float) -> None:
        self.sections, self.pairs = read_blob(spinning_blob(pairs)), pairs
        start = {"pinion.w_start": speed - apart, "wheel.w_start": -speed * 16 / 24}
        self.kernel = Kernel(spinning_blob(pairs), FREE | start | parameters)
        self.kernel.prepare()
        self.kernel.initialize()
        self.steps = 0
        self.go(1)
        self.kick()

    def go(self, steps: int) -> None:
        for _ in range(steps):
            self.kernel.step(self.steps * STEP, STEP)
            self.steps += 1
            assert self.kernel.get("mesh.contact") == 0

    @property
    def bytes(self) -> np.ndarray:
        return np.frombuffer(self.kernel.save(), np.uint8).copy()

    def split(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Views on a state, q, v, f and rate of f: ground group (4, n) and the pinion's gear group (4, 2, LANES)."""
        tail = state[-(8 * 4 * 16 + 4 * 2 * 4 * 2 * LANES) :]
        ground, gears = tail[: 8 * 4 * 16].view(float), tail[8 * 4 * 16 :].view(np.float32)
        return ground.reshape(4, 16), gears.reshape(2, 4, 2, LANES)[0]

    def kick(self) -> None:
        state = self.bytes
        ground, gear = self.split(state)
        rng = np.random.default_rng(3)
        ground[1][self.omega > 0] += VIBRATING * rng.standard_normal(self.omega.size)[self.omega > 0]
        gear[1, :, :2] += VIBRATING * rng.standard_normal((2, 2))
        self.kernel.restore(state.tobytes())
        self.start = state

    @property
    def omega(self) -> np.ndarray:
        """(n,) of the ground group: rotor by rotor, each padded to quads."""
        return self.padded(self.sections["omega_ground0"])

    def padded(self, values: np.ndarray) -> np.ndarray:
        found = np.zeros((*values.shape[:-1], 16))
        for gear in (0, 1):
            own = self.sections[f"ground_list{gear}_0"]
            found[..., 8 * gear : 8 * gear + own.size] = values[..., own]
        return found

    def exact(self, time: float, known: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Speeds of the ground group and of the pinion's pairs (2, 2) after a time, of the kicked state."""
        ground, gear = self.split(self.start)
        speed = SPEED - APART
        coupling = np.zeros((16, 16))
        for x, y in self.padded(self.sections["whirl_rows0"].reshape(self.pairs, 2, -1)) if known else ():
            coupling += np.outer(y, x) - np.outer(x, y)
        low = propagate(self.omega, coupling, speed, ground[:2].ravel(), time)
        omega, turn = self.sections["omega0"], np.zeros((4, 4))
        turn[[2, 3], [0, 1]] = RATES[::2] * known
        high = propagate(omega[[0, 2, 0, 2]], turn - turn.T, speed, gear[:2, :, :2].reshape(-1).astype(float), time)
        return low[16:], high[4:].reshape(2, 2)

    def error(self, known: bool = True) -> tuple[float, float]:
        """Relative, of both groups, from the speeds of this moment."""
        have = self.split(self.bytes)
        want = self.exact((self.steps - 1) * STEP, known)
        return tuple(float(np.abs(h - w).max() / np.abs(w).max())
                     for h, w in zip((have[0][1], have[1][1, :, :2]), want, strict=True))  # fmt: skip


def propagate(omega: np.ndarray, coupling: np.ndarray, speed: float, state: np.ndarray, time: float) -> np.ndarray:
    """(2n,): q̈ + 2Ω G q̇ + ω² q = 0 from (q, v); by ωq and v the matrix is skew."""
    n, scale = omega.size, np.concatenate([np.where(omega > 0, omega, 1.0), np.ones(omega.size)])
    matrix = np.block([[np.zeros((n, n)), np.diag(omega)], [-np.diag(omega), -2 * speed * coupling]])
    return sl.expm(matrix * time) @ (scale * state) / scale


@pytest.mark.parametrize(("pairs", "least"), [(FEW, 0.2), (MANY, 0.15)], ids=[str(FEW), str(MANY)])
def test_a_kicked_pair_whirls_as_its_linear_system(pairs: int, least: float) -> None:
    """1 ms; a run that knows nothing of the whirl is off by more than `least`."""
    flight = Flight(pairs, h=2e-6)
    flight.go(50)
    with_it, without = flight.error(), flight.error(known=False)
    assert max(with_it) < 2e-4 and min(without) > least


@pytest.mark.parametrize("pairs", [FEW, MANY])
def test_the_step_is_of_second_order(pairs: int) -> None:
    errors = []
    for h in (5e-6, 2.5e-6):
        flight = Flight(pairs, h=h)
        flight.go(50)
        errors.append(flight.error()[0])
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("speed", [0.2, 20.0])
def test_turns_below_the_last_place_of_a_speed_give_no_energy(speed: float) -> None:
    """100 000 steps of free flight: the trend of the energy over that of the kick. Rounded after every turn, speeds in
    single precision gained 3e-5 at 0.2 rad/s."""
    flight = Flight(speed=speed, apart=0.05, h=5e-6, backlash=2e-3)
    ground, gear = flight.split(flight.start)
    vibrating = 0.5 * float(np.sum(ground[1] ** 2) + np.sum(gear[1].astype(float) ** 2))
    stored, begin, sample = np.empty(100), flight.steps * STEP, 5e-3
    for i in range(len(stored)):
        flight.kernel.step(begin + i * sample, sample)
        stored[i] = flight.kernel.get("energy.stored")
        assert flight.kernel.get("mesh.contact") == 0
    trend = len(stored) * np.polyfit(np.arange(len(stored)), stored, 1)[0]
    assert abs(trend) < 5e-6 * vibrating


@pytest.mark.parametrize("integrator", [2.0, 3.0])
def test_explicit_integrators_feel_them_too(integrator: float) -> None:
    flight = Flight(integrator=integrator, h=2.5e-7)
    flight.go(25)
    assert max(flight.error()) < 1e-3 < 0.03 < min(flight.error(known=False))


def test_off_is_the_pair_that_knows_nothing_of_them() -> None:
    known, unknown = Flight(**{"effect.gyroscopic": 0.0}), Flight(pairs=0)
    for flight in (known, unknown):
        flight.go(50)
    assert known.bytes[-2000:].tobytes() == unknown.bytes[-2000:].tobytes()
    assert "effect.gyroscopic" not in unknown.kernel.variables
