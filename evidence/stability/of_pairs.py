"""Events that only pairs meet: faulty teeth, clutches; and the closing clutch of the train."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evidence.stability.bench import run_shipped
from evidence.stability.case import Case, Finding
from evidence.stability.checks import Expected, at_least, locking, lost, statistics
from evidence.stability.motion import RPM, Constant, Step
from evidence.stability.pair import Pair
from evidence.stability.train import Train
from gearfmu.stagefile.tables.connections import ChainSpec, PortSpec

LOCKINGS, PERIOD = 100, 5e-3  # number, s
CLUTCHED = (
    PortSpec(
        kind="spring",
        k=573.0,
        c=1.0,
        chain=ChainSpec(inertia=0.06, disc_inertia=0.006, shaft_k=23900.0, shaft_c=0.5),
    ),  # the passenger car's (docs/drivetrain.md)
    PortSpec(kind="spring", k=25200.0, c=0.6),
)
# means over levels and steps down to 0.7 µs; limits: some three times what those runs differ (standard deviation)
DUMPED = {"open_share": Expected(0.0406, 0.002), "coast_share": Expected(0.3336, 0.005)}
LOCKED = {"open_share": Expected(0.2915, 0.01), "impact_rate": Expected(1148.0, 50.0)}


def tip_contact(bench: Pair, case: Case, torque: float) -> Finding:
    """The largest torque without relief: two pairs carry for longer than the contact ratio says, since tips reach in
    early."""
    made = bench.loaded(case, Constant(1000 * RPM), torque)
    double = float(np.mean(made.after(bench.settled[1])["mesh.pairs"] >= 2))
    said, facts = bench.carries(made, torque, bench.settled[1])
    said += at_least("share of two pairs", double, bench.geometry.contact_ratio - 1 + 0.1)
    return bench.finding(made, said, facts | {"share_of_two_pairs": double})


def pitch_error(bench: Pair, case: Case) -> Finding:
    """One pinion tooth 50 µm out of its place: once a revolution it holds the pinion back by 20 µm or more, four
    turns long."""
    made = bench.loaded(case, Constant(1500 * RPM), bench.nominal, 0.2)
    turns = np.array_split(made.after(0.04)["mesh.te"], 4)
    dip = 1e6 * min(float(np.median(turn) - turn.min()) for turn in turns)
    said = at_least("smallest dip of the transmission error in a turn (µm)", dip, 20.0)
    return bench.finding(made, said, {"dip_um": dip})


def flank_deviations(bench: Pair, case: Case) -> Finding:
    """Gears of class 9 of ISO 1328-1, eccentric by 40 µm, wobbling, crowned, with slopes: 302 N·m through the backlash
    and back; the shaft's order of the transmission error is larger than that of the mesh, and the mesh carries the
    torque to 10 % where it is steady: shafts are wound up by the transmission error of one pitch."""
    load = bench.nominal
    back = (Step(0.05, 0.06, load, -load), Step(0.08, 0.09, -load, load))
    made = bench.run(case, bench.turning(Constant(1500 * RPM), back), 0.2)
    te = made.after(0.12)["mesh.te"]
    lines = np.abs(np.fft.rfft(te - te.mean()))
    order = float(lines[2] / lines[2 * bench.geometry.gears[0].z])
    said, facts = bench.carries(made, load, 0.12, 0.1)
    said += at_least("order of the shaft over that of the mesh", order, 1.0)
    return bench.finding(made, said, facts | {"shaft_over_mesh_order": order})


def clutch_dump(bench: Pair, case: Case) -> Finding:
    """The shipped scene through the coupling: full capacity in 2 ms, the teeth hammer through the backlash.
    Contact-loss share and share of contact on the coast flanks repeat; the clutch is locked at the end."""
    made, _ = run_shipped(bench, "clutch_dump", case)
    locked, facts = locking(made, "pinion")
    facts["coast_share"] = float(np.mean(made["mesh.contact"] < 0))
    said = at_least("share of contact on the coast flanks", facts["coast_share"], 0.01)
    said += at_least("impacts", made["mesh.impacts"][-1], 10)
    said += at_least("clutch locked at the end", float(locked[-1]), 1)
    return bench.finding(made, said + statistics(facts | lost(made), DUMPED), facts)


def closing_clutch(bench: Train, case: Case, duration: float) -> Finding:
    """The beginning of the shipped scene `clutch_closure_train` through the coupling: slip 52 rad/s, capacity 0 to
    250 N·m in 50 ms. The clutch locks within the capacity's rise, and the teeth hammer through the backlash."""
    made, _ = run_shipped(bench, "clutch_closure_train", case, duration=duration)
    locked, facts = locking(made, "input")
    said = at_least("samples with the clutch locked", float(locked.sum()), 1)
    said += at_least("impacts in stage1", made["stage1.impacts"][-1], 1)
    return bench.finding(made, said, facts)


def clutch_hundred_times(bench: Pair, case: Case) -> Finding:
    """Capacity on and off every 2.5 ms, engine side 5 rad/s faster: the clutch locks and slips 100 times,
    the teeth rattle meanwhile: contact-loss share and impact rate repeat."""
    duration, speed, slip = (LOCKINGS + 1) * PERIOD, 150.0, 5.0

    def inputs(time: float) -> Mapping[str, float]:
        closed = (time / PERIOD) % 1.0 < 0.5
        return {
            "pinion.phi": (speed + slip) * time,
            "pinion.w": speed + slip,
            "wheel.phi": bench.ratio * speed * time,
            "wheel.w": bench.ratio * speed,
            "pinion.clutch.capacity": 60.0 if closed else 0.0,
        }

    made = bench.run(case, inputs, duration, {"pinion.disc.w_start": speed}, 5e-5)
    locked = made["pinion.clutch.locked"] > 0.5
    count = turns_of(locked)
    said = at_least("lockings", count[0], LOCKINGS) + at_least("slippings", count[1], LOCKINGS)
    facts = {"lockings": count[0], "slippings": count[1]}
    return bench.finding(made, said + statistics(lost(made), LOCKED), facts)


def turns_of(locked: np.ndarray) -> tuple[float, float]:
    """How often a clutch locks and lets go."""
    return float(np.sum(locked[1:] & ~locked[:-1])), float(np.sum(~locked[1:] & locked[:-1]))
