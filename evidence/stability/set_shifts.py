"""Scenes of shifting on the planetary set: the ring braked and let go, a clutch dropped at the carrier."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evidence.stability.case import Case, Finding
from evidence.stability.checks import at_least
from evidence.stability.motion import Constant
from evidence.stability.record import Record
from evidence.stability.set_bench import MESHES, RATIO, SPEED, Carried, SetVariant, set_finding, set_run, steady
from gearfmu.spec.tables.ports import ChainSpec, PortSpec

SHIFTS, PERIOD, CLOSED = 100, 1e-3, 0.6  # number, s, share of the period
BRAKED = SetVariant(
    ring=PortSpec(
        kind="spring",
        k=2e5,
        c=5.0,
        chain=ChainSpec(inertia=0.05, disc_inertia=2e-3, shaft_k=2e5, shaft_c=2.0),
    )
)  # the outer end stands: what the clutch of this chain closes onto is a housing on its feet
BRAKE, BRAKED_LOAD = 2000.0, 100.0  # N·m: capacity of the brake; of the load on the carrier
DUMPED = SetVariant(
    ports=(
        PortSpec(
            kind="spring",
            k=5e3,
            c=2.0,
            chain=ChainSpec(inertia=0.06, disc_inertia=6e-3, shaft_k=50e3, shaft_c=5.0),
        ),
        PortSpec(kind="spring", k=20e3, c=1.0),
    )
)
SLIP, CAPACITY, RISE, SLOWING = 30.0, 300.0, 2e-3, 0.01  # rad/s, N·m, s, s


def set_brake_shift(case: Case) -> Finding:
    """The ring on a brake that closes and opens every millisecond, 100 times, 100 N·m on a carrier at 85 rad/s: the
    ring runs away under the load, is caught, and the teeth hammer. The brake locks and slips every time."""
    drive = Carried(Constant(SPEED), steady(BRAKED_LOAD))

    def inputs(time: float) -> Mapping[str, float]:
        closed = (time / PERIOD) % 1.0 < CLOSED
        return {**drive(time), "ring.clutch.capacity": BRAKE if closed else 0.0}

    made = set_run(BRAKED, case, inputs, SHIFTS * PERIOD)
    locked = made["ring.clutch.locked"] > 0.5
    closings, openings = _turns(locked)
    facts = {"lockings": closings, "slippings": openings, "largest_slip": float(np.abs(made["ring.clutch.slip"]).max())}
    said = at_least("lockings", closings, SHIFTS - 1) + at_least("slippings", openings, SHIFTS - 1)
    said += at_least("fastest run of the ring (rad/s)", facts["largest_slip"], 1.0)
    return set_finding(BRAKED, made, said, facts)


def set_clutch_dump(case: Case) -> Finding:
    """A clutch at the carrier, its engine side 30 rad/s faster, takes full capacity, 300 N·m, within 2 ms, and the
    engine comes down within 10; the teeth stood in mid-backlash. All planets are struck and the clutch is locked in
    the end."""

    def inputs(time: float) -> Mapping[str, float]:
        slowed = min(time, SLOWING)
        return {
            "carrier.phi": SPEED * time + SLIP * slowed * (1.0 - 0.5 * slowed / SLOWING),
            "carrier.w": SPEED + SLIP * (1.0 - slowed / SLOWING),
            "sun.phi": RATIO * SPEED * time,
            "sun.w": RATIO * SPEED,
            "carrier.clutch.capacity": CAPACITY * min(time / RISE, 1.0),
        }

    made = set_run(DUMPED, case, inputs, 0.03, {"carrier.disc.w_start": SPEED})
    locked = made["carrier.clutch.locked"] > 0.5
    facts = {"locked_at_s": float(made.time[np.argmax(locked)]) if locked.any() else float("nan")}
    said = at_least("clutch locked at the end", float(locked[-1]), 1.0)
    said += at_least("fewest impacts on a planet", _fewest_impacts(made), 1.0)
    return set_finding(DUMPED, made, said, facts)


def _turns(locked: np.ndarray) -> tuple[float, float]:
    """How often a clutch locks and lets go."""
    return float(np.sum(locked[1:] & ~locked[:-1])), float(np.sum(~locked[1:] & locked[:-1]))


def _fewest_impacts(made: Record) -> float:
    """Of a planet, in both of its meshes: one of them may touch from the start."""
    return min(
        float(made[f"{sun}.impacts"][-1] + made[f"{ring}.impacts"][-1])
        for sun, ring in zip(MESHES["sun"], MESHES["ring"], strict=True)
    )
