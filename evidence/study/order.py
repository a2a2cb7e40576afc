"""Observed order of the integrators: for constant stiffness against the exact motion, in a gear mesh against a
reference of the same model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.study.flat import FlatPair, contact_frequencies, exact_force
from gearfmu.kernel import Kernel
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.bench import Point, measure, models_for
from gearfmu.study.ladder import fitting
from gearfmu.study.norm import errors

INTEGRATORS = ("dg4", "em", "rk45")
CONSTANT, IMPACT, MESH = "constant stiffness", "after an impact", "gear mesh"
EXPECTED = {CONSTANT: {"dg4": 4, "em": 2}, IMPACT: {"dg4": 2, "em": 2}}
EXPECTED[MESH] = EXPECTED[IMPACT]
FULL_LEVEL = 3
END, COUNTS = 576e-6, (12, 16, 20, 28)  # s and steps: closed contact, errors above the rounding of rows
LEVELS = ("rigid", "fast")
MESH_STEPS, MESH_REFERENCE = (10e-6, 5e-6, 2.5e-6, 1.25e-6, 0.625e-6), 0.625e-6 / 3  # s


@dataclass(frozen=True)
class OrderRow:
    """Error of one integrator at step h_s, and the order seen between this step and the one before it.

    case "constant stiffness": relative rms of what is left of the contact force when harmonics of the exact contact
    frequencies are taken out; "after an impact": largest difference from the exact force over its largest value, the
    motion begins with a speed in contact; "gear mesh": transmission error in the scene. expected: order of the scheme,
    0 for rk45, whose error is set by its tolerance and not by h.
    """

    scene: str
    case: str
    integrator: str
    h_s: float
    error: float
    order: float
    expected: int


def constant_stiffness(pair: FlatPair | None = None, counts: Sequence[int] = COUNTS) -> list[OrderRow]:
    """Two bodies pressed together over two slices by their own speed, all modes exponential.

    The schemes hold the velocity that belongs to their sampled motion, which is ẋ + (h²/12)·x⃛: a motion that begins
    with a speed and a changing force starts with an error of second order, once, and goes on with that of the scheme.
    Both are shown.
    """
    pair, rows = pair or FlatPair(), []
    for index, name in enumerate(INTEGRATORS):
        found = [(END / n, *_force_errors(pair, index, END / n, n)) for n in counts]
        rows += _ordered(("flat_pair", CONSTANT), name, [(h, own) for h, own, _ in found])
        rows += _ordered(("flat_pair", IMPACT), name, [(h, whole) for h, _, whole in found])
    return sorted(rows, key=lambda row: row.case == IMPACT)


def _force_errors(pair: FlatPair, integrator: int, h: float, count: int) -> tuple[float, float]:
    """Errors of the contact force without and with that of the start."""
    parameters = {"left.w_start": pair.speed, "h": h, "integrator": integrator, "level": FULL_LEVEL}
    kernel = Kernel(pair.blob(), parameters | {"effect.hertz": 0, "slices": pair.slices})
    kernel.initialize()
    found = np.empty(count)
    for k in range(count):
        kernel.step(k * h, h)
        found[k] = kernel.get("mesh.force")
    time = h * np.arange(1, count + 1)
    wanted = exact_force(pair, time)
    assert kernel.get("solver.retried_steps") == 0 and min(wanted.min(), found.min()) > 0, "contact must stay closed"
    angle = np.outer(time, contact_frequencies(pair))
    basis = np.hstack([np.sin(angle), np.cos(angle)])
    left = found - basis @ np.linalg.lstsq(basis, found, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2) / np.mean(found**2))), float(np.abs(found - wanted).max() / wanted.max())


def gear_mesh(
    scene: SceneSpec,
    levels: Sequence[str] = LEVELS,
    steps: Sequence[float] = MESH_STEPS,
    progress: Callable[..., None] | None = None,
) -> list[OrderRow]:
    """The integrators on a test rig, by level, as it is and without the dashpots of contact, bearings and shafts;
    reference: dg4 with MESH_REFERENCE. ModelError for a scene with a clutch: rk45 does not know it."""
    tell, rows = progress or (lambda fraction, text="": None), []
    cases = [(level, *dashpots) for level in levels for dashpots in (("", scene, {}), _without_dashpots(scene))]
    for k, (level, text, one, changes) in enumerate(cases):
        model, slices = models_for(one, **changes), scene.stage.slices
        reference = measure(one, model, Point(level, "dg4", MESH_REFERENCE, slices)).signals
        for name in INTEGRATORS:
            tell(k / len(cases), f"{level}, {name}")
            wished = [fitting(scene.coupling.step, h) for h in steps]
            runs = [measure(one, model, Point(level, name, h, slices)) for h in wished]
            found = [(h, errors(run.signals, reference).te) for h, run in zip(wished, runs, strict=True)]
            rows += _ordered((scene.name, f"{MESH}, {level}{text}"), name, found)
    return rows


def _without_dashpots(scene: SceneSpec) -> tuple[str, SceneSpec, dict[str, Any]]:
    """What to call it, the scene on shafts without damping, changes of the stage that take the other dashpots away."""
    rig, spec = scene.test_rig, load_stage(scene.stage.name)
    gears = [
        g.model_copy(update={"bearing": g.bearing.model_copy(update={"damping_ratio": 0.0})})
        for g in spec.written.gears
    ]
    changes = {"gears": tuple(gears), "contact": spec.written.contact.model_copy(update={"damping": 0.0})}
    if rig is not None:
        rig = rig.model_copy(update={"pinion_shaft_damping": 0.0, "wheel_shaft_damping": 0.0})
    return ", no dashpots", scene.model_copy(update={"test_rig": rig}), changes


def _ordered(place: tuple[str, str], name: str, found: list[tuple[float, float]]) -> list[OrderRow]:
    rows, expected = [], EXPECTED[place[1].split(",")[0]].get(name, 0)
    for k, (h, error) in enumerate(found):
        before = found[k - 1] if k else (h, float("nan"))
        order = float(np.log(before[1] / error) / np.log(before[0] / h)) if k else float("nan")
        rows.append(OrderRow(*place, name, h, error, order, expected))
    return rows
