"""Scenes with a clutch: dropped at once, and locking and slipping again and again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evidence.stability.bench import Variant, geometry, internal_step, kernel, model
from evidence.stability.case import COMPLETED, Case, Finding
from evidence.stability.checks import Expected, at_least, finding, lost, statistics
from evidence.stability.record import NAMES, Record, Stopped, run
from gearfmu.cosim.coupled import OK
from gearfmu.cosim.scene_run import run as run_scene
from gearfmu.cosim.scene_run import stage_model
from gearfmu.spec.scene import load_scene
from gearfmu.spec.tables.ports import ChainSpec, PortSpec

DUMP = "clutch_dump"  # the shipped scene
LOCKINGS, PERIOD = 100, 5e-3  # number, s
CLUTCHED = PortSpec(
    kind="spring",
    k=573.0,
    c=1.0,
    chain=ChainSpec(inertia=0.06, disc_inertia=0.006, shaft_k=23900.0, shaft_c=0.5),
)  # the passenger car's (docs/drivetrain.md)
DUMPED = {"open_share": Expected(0.0406, 0.002), "coast_share": Expected(0.3336, 0.005)}  # as in loads.py
LOCKED = {"open_share": Expected(0.2915, 0.01), "impact_rate": Expected(1148.0, 50.0)}
OUTPUT = PortSpec(kind="spring", k=25200.0, c=0.6)


def clutch_dump(case: Case) -> Finding:
    """The shipped scene through the coupling: full capacity in 2 ms, the teeth hammer through the backlash.
    Contact-loss share and share of contact on the coast flanks repeat; the clutch is locked at the end."""
    scene = load_scene(DUMP)
    h = internal_step(stage_model(scene), case)
    scene = scene.model_copy(update={"stage": scene.stage.model_copy(update={"level": case.level, "h": h})})
    trace = run_scene(scene, unit="kernel")
    speeds = np.stack([trace["drive.pinion.w"], trace["drive.wheel.w"]])
    torques = np.stack([trace["pinion.tau_mean"], trace["wheel.tau_mean"]])
    power = np.abs(torques * speeds).sum(axis=0)
    passed = np.concatenate([[0.0], np.cumsum(power[1:] * np.diff(trace.time))])
    outcome = COMPLETED if trace.meta["outcome"] == OK else str(trace.meta["outcome"])
    names = {name: np.asarray(trace[name], float) for name in NAMES}
    made = Record(trace.time, names, passed, outcome, float(trace.meta["cpu_s"]))
    if outcome != COMPLETED:
        raise Stopped(made)
    locked = trace["pinion.clutch.locked"]
    facts = {"locked_at_s": float(trace.time[np.argmax(locked)]) if locked.any() else float("nan")}
    facts["coast_share"] = float(np.mean(made["mesh.contact"] < 0))
    said = at_least("share of contact on the coast flanks", facts["coast_share"], 0.01)
    said += at_least("impacts", made["mesh.impacts"][-1], 10)
    said += at_least("clutch locked at the end", float(locked[-1]), 1)
    return finding(made, geometry(Variant()), said + statistics(facts | lost(made), DUMPED), facts)


def clutch_hundred_times(case: Case) -> Finding:
    """Capacity on and off every 2.5 ms, engine side 5 rad/s faster: the clutch locks and slips 100 times,
    the teeth rattle meanwhile: contact-loss share and impact rate repeat."""
    variant = Variant(ports=(CLUTCHED, OUTPUT))
    duration, speed, slip = (LOCKINGS + 1) * PERIOD, 150.0, 5.0

    def inputs(time: float) -> Mapping[str, float]:
        closed = (time / PERIOD) % 1.0 < 0.5
        return {
            "pinion.phi": (speed + slip) * time,
            "pinion.w": speed + slip,
            "wheel.phi": -speed * 16 / 24 * time,
            "wheel.w": -speed * 16 / 24,
            "pinion.clutch.capacity": 60.0 if closed else 0.0,
        }

    going = kernel(model(variant), case, {"pinion.disc.w_start": speed})
    made = run(going, inputs, duration, 5e-5)
    locked = made["pinion.clutch.locked"] > 0.5
    count = int(np.sum(locked[1:] & ~locked[:-1])), int(np.sum(~locked[1:] & locked[:-1]))
    said = at_least("lockings", count[0], LOCKINGS) + at_least("slippings", count[1], LOCKINGS)
    facts = {"lockings": float(count[0]), "slippings": float(count[1])}
    said += statistics(lost(made), LOCKED)
    return finding(made, geometry(variant), said, facts)
