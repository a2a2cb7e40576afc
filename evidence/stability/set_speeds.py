"""Scenes of speed on the planetary set: through the resonances of the ring up and down, far above its largest speed."""

from __future__ import annotations

import numpy as np

from evidence.stability.case import Case, Finding
from evidence.stability.checks import at_least
from evidence.stability.motion import RPM, Constant, UpAndDown
from evidence.stability.record import Record
from evidence.stability.set_bench import (
    NOMINAL,
    PLAIN_SET,
    RATIO,
    Carried,
    carries,
    set_finding,
    set_run,
    steady,
)

LOW, HIGH, DURATION = 150.0, 560.0, 0.03  # rad/s of the carrier (mesh 1.3 … 4.8 kHz), rad/s, s
TORQUE = 150.0  # N·m
BINS = 20
FASTEST = 20000 * RPM / RATIO  # rad/s of the carrier


def set_run_up_and_down(case: Case) -> Finding:
    """The carrier from 150 to 560 rad/s in 30 ms and back under 150 N·m: the mesh frequency, 1.3 to 4.8 kHz, and its
    multiples pass the ring's modes on its mounts. In its resonance the ring's ripple is 1.5 times the median one or
    more, on the way up and down."""
    made = set_run(PLAIN_SET, case, Carried(UpAndDown(LOW, HIGH, DURATION), steady(TORQUE)), 2 * DURATION)
    said, facts = carries(made, TORQUE, 0.5 * DURATION, 0.1)
    for name, part in (("up", made.time < DURATION), ("down", made.time >= DURATION)):
        ripple = _ripple(made, part)
        if not ripple.size:
            continue
        facts[f"ripple_{name}"] = float(ripple.max() / np.median(ripple))
        facts[f"largest_{name}_rad_s"] = LOW + (HIGH - LOW) * (int(ripple.argmax()) + 0.5) / BINS
        said += at_least(f"largest ripple of the ring over the median one, {name}", facts[f"ripple_{name}"], 1.5)
    return set_finding(PLAIN_SET, made, said, facts)


def set_high_speed(case: Case) -> Finding:
    """The sun at 20 000 rpm, the carrier at 524 rad/s, 1.7 times its largest speed, under 600 N·m: the meshes carry
    the torque to 2 %."""
    made = set_run(PLAIN_SET, case, Carried(Constant(FASTEST), steady(NOMINAL)), 0.022)
    said, facts = carries(made, NOMINAL, 0.012)
    facts["sun_rpm"] = float(made["sun.w"][-1] / RPM)
    return set_finding(PLAIN_SET, made, said, facts)


def _ripple(record: Record, part: np.ndarray) -> np.ndarray:
    """(BINS,) rms of what alternates in the ring's place, in equal parts of the run; rising speed."""
    if not part.any():
        return np.empty(0)
    bins = [np.array_split(record[f"ring.gear.{axis}"][part], BINS) for axis in "xy"]
    found = np.array([np.hypot(x.std(), y.std()) for x, y in zip(*bins, strict=True)])
    return found if record.time[part][0] < DURATION else found[::-1]
