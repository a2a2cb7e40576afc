"""Scenes on the shipped planetary set, whose eight meshes, pins and ring answer together: an alternating torque."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from evidence.stability.bench import internal_step
from evidence.stability.case import COMPLETED, Case, Finding
from evidence.stability.checks import CLEARANCE, Expected, at_least, at_most, deep, judged, statistics
from evidence.stability.record import Record, Watched
from gearfmu.cosim.coupled import OK, Result
from gearfmu.cosim.scene_run import run_once, stage_model
from gearfmu.cosim.source import Source
from gearfmu.spec.forms.expand import as_general
from gearfmu.spec.forms.shapes import mesh_shape
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel

BACKFIRE = "planetary_backfire"  # the shipped scene
PLANETS, CENTRALS, SHAFTS = 4, ("sun", "ring"), ("carrier", "sun")
MESHES = {central: tuple(f"{central}_planet{k + 1}" for k in range(PLANETS)) for central in CENTRALS}
WATCHED = Watched(tuple(mesh for own in MESHES.values() for mesh in own), SHAFTS)
SOFTNESS = {"sun": 11.4e-9, "ring": 17.4e-9}  # m/N: transmission error beyond the touch, at rest under 1774 N a mesh
MARGIN = 1.5  # of that: inertia of planets between mesh and pin, softer flanks near their tips
# of level fast at 2.5 to 5 µs, where shares of the sun's meshes scatter by 0.013 about these; limits: twice the
# scatter, for the sun's more: 0.27 at levels standard and full at the default step, 0.026 on its drive flanks at 1.8 µs
EXPECTED = {
    "carrier_speed": Expected(98.07, 0.1),
    "sun_open_share": Expected(0.302, 0.045),
    "ring_open_share": Expected(0.168, 0.008),
    "sun_drive_share": Expected(0.016, 0.012),
    "ring_drive_share": Expected(0.5345, 0.005),
}
ALIKE = 0.005  # contact-loss shares of planets opposite each other


@lru_cache(maxsize=1)
def planetary() -> StageModel:
    """The shipped set with the ports of the scene, assembled."""
    return stage_model(load_scene(BACKFIRE))


def planetary_backfire(case: Case) -> Finding:
    """The shipped scene: an alternating torque on the carrier, six times its mean. Every planet leaves sun and ring
    and hammers on both flanks; shares of lost contact and of contact on the other flank repeat, and planets opposite
    each other do the same."""
    scene = load_scene(BACKFIRE)
    as_shipped = (case.level, case.step, case.h) == (scene.stage.level, "default", 0.0)
    h = scene.stage.h if as_shipped else internal_step(planetary(), case)
    stage = scene.stage.model_copy(update={"level": case.level, "h": h})
    made, turned = _record(run_once(scene.model_copy(update={"stage": stage}), Source(planetary())))
    said, facts = [], {"carrier_speed": turned}
    for central, meshes in MESHES.items():
        side = {mesh: float(np.mean(made[f"{mesh}.contact"] > 0)) for mesh in meshes}
        for mesh in meshes:
            said += at_least(f"impacts in {mesh}", made[f"{mesh}.impacts"][-1], 4)
            for what, share in (("drive", side[mesh]), ("coast", float(np.mean(made[f"{mesh}.contact"] < 0)))):
                said += at_least(f"share of contact on the {what} flanks of {mesh}", share, 0.002)
        open_shares = [made.open_share(mesh) for mesh in meshes]
        for a, b in zip(meshes[:2], meshes[2:], strict=True):
            apart = abs(made.open_share(a) - made.open_share(b))
            said += at_most(f"difference of the contact-loss shares of {a} and {b}", apart, ALIKE)
        facts[f"{central}_open_share"] = float(np.mean(open_shares))
        facts[f"{central}_drive_share"] = float(np.mean(list(side.values())))
    return _finding(made, said + statistics(facts, EXPECTED), facts)


def _record(result: Result) -> tuple[Record, float]:
    """The record of a run, and the mean speed of the carrier, rad/s."""
    trace = result.trace
    values = {name: np.asarray(trace[name], float) for name in WATCHED.names}
    power = np.abs([trace[f"drive.{shaft}.tau"] * trace[f"{shaft}.w"] for shaft in SHAFTS]).sum(axis=0)
    passed = np.concatenate([[0.0], np.cumsum(power[1:] * np.diff(trace.time))])
    outcome = COMPLETED if result.outcome == OK else result.outcome
    mean = float(np.mean(trace["carrier.w"]))
    return Record(trace.time, values, passed, outcome, result.cpu_s), mean


def _finding(made: Record, said: list[str], facts: dict[str, float]) -> Finding:
    """With the depth of the flanks: their transmission error beyond the touch of drive or coast flanks, which holds
    what pins, bolts and bores give too. It may be no deeper than the largest force of the run presses it at rest."""
    stage, deepest, complaints = as_general(load_stage(planetary().name)), 0.0, []
    for central, meshes in MESHES.items():
        largest = max(made[f"{mesh}.force_max"].max() for mesh in meshes)
        for mesh in meshes:
            engagement = next(m for m in stage.engagements if m.name == mesh)
            backlash = float(engagement.backlash * np.cos(mesh_shape(stage, engagement).alpha_wt))
            depth = np.maximum(made[f"{mesh}.te"], -made[f"{mesh}.te"] - backlash)
            pressed = np.full(depth.size, CLEARANCE + MARGIN * SOFTNESS[central] * largest)
            complaints += deep(made, depth, pressed, f"flanks of {mesh}")
            deepest = max(deepest, float(depth.max()))
    return judged(made, deepest, [*complaints, *said], facts)
