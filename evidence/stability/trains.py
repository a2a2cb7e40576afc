"""Scenes on the shipped train, whose two engagements, three shafts and six bearings answer together: a torque that
comes in two milliseconds, a reversal through both backlashes, a closing clutch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from evidence.stability.bench import internal_step, kernel
from evidence.stability.case import COMPLETED, Case, Finding
from evidence.stability.checks import at_least, deep, judged, near
from evidence.stability.motion import RPM, Step
from evidence.stability.record import Record, Stopped, Watched, run
from gearfmu.body import load_bodies
from gearfmu.cosim.coupled import OK
from gearfmu.cosim.scene_run import run as run_scene
from gearfmu.cosim.scene_run import stage_model
from gearfmu.kernel import Kernel
from gearfmu.spec.forms.shapes import mesh_shape
from gearfmu.spec.scene import load_scene
from gearfmu.spec.stage import load_stage
from gearfmu.stage import StageModel, Steady, assemble, loaded_te

TRAIN, CLOSING = "two_stage", "clutch_closure_train"  # shipped stage and scene
WATCHED = Watched(("stage1", "stage2"), ("input", "output"))
PORT_OF = {"stage1": ("input", 0), "stage2": ("output", 1)}  # port that shares a shaft with gear A (0) or B (1)
H = 2e-5  # s, communication step
SPEED = 1500 * RPM  # of the input
LIGHT, NOMINAL, LARGEST = 20.0, 150.0, 300.0  # N·m on the input; torque_max of the first mesh
MARGIN = 1.25  # of the softest place at rest: inertia of what lies between mesh and ports
CLOSURE = 0.08  # s: the first part of the shipped scene, the clutch is at its full capacity from 50 ms on


@lru_cache(maxsize=1)
def train() -> StageModel:
    """The shipped train, assembled."""
    spec = load_stage(TRAIN)
    return assemble(spec, load_bodies(spec))


@dataclass(frozen=True)
class Winding:
    """Inputs of the train at constant speed whose ends are wound up against each other by `steps`, one after the other,
    each from one torque (N·m on the input) to another."""

    steps: tuple[Step, ...]

    @cached_property
    def _ends(self) -> dict[float, tuple[float, float]]:
        """Angles of the outer ends (rad) that carry a torque at rest, by torque."""
        torques = {torque for step in self.steps for torque in (step.before, step.after)}
        return {torque: _wound(torque) for torque in torques}

    def __call__(self, time: float) -> Mapping[str, float]:
        step = next((step for step in self.steps if time < step.end), self.steps[-1])
        part = replace(step, before=0.0, after=1.0)(time)
        values: dict[str, float] = {}
        for port, turn, before, after in zip(
            WATCHED.ports,
            (1.0, 1.0 / train().shafts.ratio),
            self._ends[step.before],
            self._ends[step.after],
            strict=True,
        ):
            values[f"{port}.phi"] = before + (after - before) * part.phi + SPEED * turn * time
            values[f"{port}.w"] = (after - before) * part.w + SPEED * turn
            values[f"{port}.a"] = (after - before) * part.a
        return values


@lru_cache(maxsize=8)
def _wound(torque: float) -> tuple[float, float]:
    at_rest = Steady(train(), 0.0, torque)(0.0)
    return at_rest["input.phi"], at_rest["output.phi"]


def train_torque_step(case: Case) -> Finding:
    """The train at 1500 rpm: from 20 to 300 N·m on the input within 2 ms. Both meshes ring and stay whole; in the end
    they carry the torque to 2 %."""
    going, load = kernel(train(), case), Winding((Step(0.01, 0.012, LIGHT, LARGEST),))
    return _judge(_run(going, load, 0.05), LARGEST, 0.035)


def train_reversal(case: Case) -> Finding:
    """The train at 1500 rpm: ±150 N·m within 5 ms through both backlashes and back. Impacts in both meshes, and the
    torque carried to 2 % at the end."""
    load = Winding((Step(0.01, 0.015, NOMINAL, -NOMINAL), Step(0.035, 0.04, -NOMINAL, NOMINAL)))
    made = _run(kernel(train(), case), load, 0.075)
    said = [line for mesh in WATCHED.meshes for line in at_least(f"impacts in {mesh}", made[f"{mesh}.impacts"][-1], 2)]
    return _judge(made, NOMINAL, 0.06, said)


def train_closing_clutch(case: Case) -> Finding:
    """The first 80 ms of the shipped scene `clutch_closure_train` through the coupling: slip 52 rad/s, capacity 0 to
    250 N·m in 50 ms. The clutch locks within the capacity's rise, and the teeth hammer through the backlash."""
    scene = load_scene(CLOSING)
    h = internal_step(stage_model(scene), case)
    stage = scene.stage.model_copy(update={"level": case.level, "h": h})
    trace = run_scene(scene.model_copy(update={"stage": stage, "duration": CLOSURE}), unit="kernel")
    taken = (*WATCHED.names, "input.tau_mean", "output.tau_mean")
    names = {name: np.asarray(trace[name], float) for name in taken}
    speeds = np.stack([trace["drive.input.w"], trace["drive.output.w"]])
    power = np.abs(np.stack([trace["input.tau_mean"], trace["output.tau_mean"]]) * speeds).sum(axis=0)
    passed = np.concatenate([[0.0], np.cumsum(power[1:] * np.diff(trace.time))])
    outcome = COMPLETED if trace.meta["outcome"] == OK else str(trace.meta["outcome"])
    made = Record(trace.time, names, passed, outcome, float(trace.meta["cpu_s"]))
    locked = trace["input.clutch.locked"]
    said = at_least("samples with the clutch locked", float(locked.sum()), 1)
    said += at_least("impacts in stage1", made["stage1.impacts"][-1], 1)
    facts = {"locked_at_s": float(trace.time[np.argmax(locked)]) if locked.any() else float("nan")}
    return _finding(made, said, facts)


def _run(going: Kernel, load: Winding, duration: float) -> Record:
    """The run, or what there is of it."""
    try:
        return run(going, load, duration, H, WATCHED)
    except Stopped as stop:
        return stop.record


def _judge(made: Record, torque: float, since: float, said: list[str] | None = None) -> Finding:
    """Finding of a run that in the end, from `since` (s) on, carries `torque` (N·m on the input)."""
    late = made.time >= since
    carried = {"input": torque, "output": torque * train().shafts.ratio}
    said, facts = list(said or []), {}
    for port, wanted in carried.items() if late.any() else ():
        facts[f"{port}_torque_Nm"] = float(np.abs(made[f"{port}.tau_mean"][late].mean()))
        said += near(f"mean torque on the {port}", facts[f"{port}_torque_Nm"], wanted, 0.02)
    return _finding(made, said, facts)


def _finding(made: Record, said: list[str], facts: Mapping[str, float]) -> Finding:
    """With the depth of the flanks of both meshes: their transmission error beyond the touch of drive or coast flanks,
    which holds the twist of shafts and what bearings give too. It may be no deeper than the largest load of the run
    presses it at rest."""
    deepest, complaints = 0.0, []
    for mesh, (port, gear) in PORT_OF.items():
        rest, yields, backlash, radii = _at_rest(mesh)
        depth = _depth(made[f"{mesh}.te"], backlash)
        largest = max(made[f"{mesh}.force_max"].max(), np.abs(made[f"{port}.tau_mean"]).max() / radii[gear])
        pressed = np.full(depth.size, rest + MARGIN * yields * largest)
        complaints += deep(made, depth, pressed, f"flanks of {mesh}")
        deepest = max(deepest, float(depth.max()))
    return judged(made, deepest, [*complaints, *said], facts)


@lru_cache(maxsize=2)
def _at_rest(mesh: str) -> tuple[float, float, float, tuple[float, float]]:
    """Of an engagement: largest depth without load (m), depth per mesh force where it is softest (m/N), backlash along
    the line of action and base radii (m)."""
    stage = train().stage
    found = loaded_te(train(), [0.0, LIGHT, LARGEST], 8, mesh=mesh)
    engagement = next(m for m in stage.engagements if m.name == mesh)
    shape = mesh_shape(stage, engagement)
    backlash = float(engagement.backlash * np.cos(shape.alpha_wt))
    deepest, yields = float(_depth(found.te[0], backlash).max()), float(1.0 / found.stage_stiffness.min())
    return deepest, yields, backlash, (shape.gears[0].r_b, shape.gears[1].r_b)


def _depth(te: np.ndarray, backlash: float) -> np.ndarray:
    """(n,) m: by how much gear A has turned beyond the touch of drive or coast flanks."""
    return np.maximum(te, -te - backlash)
