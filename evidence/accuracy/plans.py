"""Plans judged on windows that they did not see: evidence/accuracy/plans.csv.

    python -m evidence.accuracy.plans

Every scene is planned for a budget; then the chosen set and the full model run on from a state of the scene over a
window behind that of the plan, three times as long where the scene is steady. The scenes are `pair_loaded` and
`clutch_closure` with another torque, speed or stage, and a pair under alternating torques. kept: the error there is at
most the budget (and the noise of the full model where contact is lost). A part with no room behind its window is not
judged: true is nan. None of the scenes set a constant of gearfmu/planning. Rows are added as they come; one that was
made with the same kernel (`made_from`: kernel.build.fingerprint) is not made again.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from evidence.tables import told
from gearfmu.cosim.coupled import OK
from gearfmu.cosim.scene_run import stage_model
from gearfmu.kernel.build import fingerprint
from gearfmu.planning.book import Segment
from gearfmu.planning.choice import space
from gearfmu.planning.judge import FAILED, error
from gearfmu.planning.make import Job, PlanError, make
from gearfmu.planning.request import Request, request
from gearfmu.planning.trials import Task, Window, run_trial
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.study.table import read_rows, write_rows
from gearfmu.sweeps.runners import in_this_process

TABLE = Path(__file__).with_suffix(".csv")
LONGER, LONGEST = 3, 0.3  # windows; s
BUDGETS = ("1 dB", "5 %")
BAND = ("500 Hz", "5 kHz")

RATTLE = """
name = "rattle_8_12"
description = "Torques on both shafts of a pair"
duration = "0.2 s"
settle = "0.05 s"
[stage]
name = "fzg_c/stage_relief"
level = "standard"
[coupling]
step = "20 us"
[start]
input_speed = "190 rad/s"
[shaft_loads.pinion]
constant = "8 N*m"
alternating = { amplitude = "12 N*m", frequency = "83.7 Hz" }
[shaft_loads.wheel]
proportional = { torque = "12 N*m", speed = "-126.66666666666667 rad/s" }
"""


@dataclass(frozen=True)
class Row:
    """One part of a plan. error: predicted, bound, and true on the window behind, budgets; price: of the full model and
    of the scene's own level over that of the plan; default_error: of the scene's own level, budgets; cost: of planning,
    in runs of the full model's window. outcome: planned, full (nothing cheaper keeps it), or why there is no plan.
    made_from: hash of all inputs."""

    kind: str
    scene: str
    part: str
    budget: str
    outcome: str
    choice: str
    predicted: float
    bound: float
    true: float
    noise: float
    kept: bool
    times_full: float
    times_default: float
    default_error: float
    cost: float
    made_from: str


@dataclass(frozen=True)
class Case:
    """A scene of the benchmark and what is judged there."""

    kind: str
    scene: SceneSpec
    outputs: tuple[str, ...] = ("te", "bearing.pinion.fx")


def cases() -> Iterator[Case]:
    """The scenes: loaded, helical, rattling and with a clutch."""
    yield Case("loaded", _rig("loaded_150_1200", 150, 1200))
    yield Case("helical", _rig("helical_100_1500", 100, 1500, "helical_demo"))
    yield Case("rattle", _rattle())
    closing = {"start.slip": "40 rad/s", "coupling.step": "50 us", "duration": "0.2 s"}
    yield Case("clutch", load_scene("clutch_closure", closing))


def _rig(name: str, torque: float, rpm: float, stage: str = "fzg_c/stage_relief") -> SceneSpec:
    changes = {"torque": f"{torque} N*m", "speed": f"{rpm} rpm", "stage.name": stage, "name": name}
    return load_scene("pair_loaded", changes)


def _rattle() -> SceneSpec:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rattle_8_12.toml"
        path.write_text(RATTLE, encoding="utf-8")
        return load_scene(path)


def rows_of(case: Case, budget: str, made_from: str) -> Iterator[Row]:
    """A row for every part of the scene."""
    scene, model = case.scene, stage_model(case.scene)
    level, waveform = (None, budget) if budget.endswith("%") else (budget, None)
    try:
        asked = request(scene, model, case.outputs, BAND, level, waveform)
        plan = make(Job(scene, model, asked, in_this_process), scene.name)
    except PlanError as refusal:
        nothing = [float("nan")] * 4
        yield Row(case.kind, scene.name, "", budget, f"refused: {refusal}", "", *nothing, True, *nothing, made_from)
        return
    for part in plan.segments:
        true = _true(scene, asked, part)
        prices = part.price_full / part.price, part.price_default / part.price
        head = (case.kind, scene.name, part.name, budget, "planned" if part.kept else "full", part.choice.words)
        errors = (part.error, part.bound, true, part.noise)
        yield Row(*head, *errors, not true > 1.0 + part.noise, *prices, part.error_default, plan.cost, made_from)


def _true(scene: SceneSpec, asked: Request, part: Segment) -> float:
    """Error of the chosen set on the window behind, NaN where the part has no room for one."""
    start = part.window_start + part.window + part.settle
    length = min(LONGEST, LONGER * part.window) if scene.settle else min(part.window, part.end - start)
    if length < 0.4 * part.window:
        return float("nan")
    window, text = Window(start, length, part.settle), scene.model_dump_json()
    full = space(scene, stage_model(scene)).full
    found, wanted = (run_trial(Task(text, choice, window, asked)) for choice in (part.choice, full))
    return error(found.signals, wanted.signals, asked).whole if found.outcome == wanted.outcome == OK else FAILED


def main() -> None:
    """Make what is missing."""
    rows, made_from = read_rows(TABLE, Row), fingerprint()[:12]
    for budget in BUDGETS:
        for case in cases():
            known = [row for row in rows if (row.scene, row.budget) == (case.scene.name, budget)]
            if any(row.made_from == made_from for row in known):
                continue
            made = list(rows_of(case, budget, made_from))
            rows = [row for row in rows if row not in known] + made
            write_rows(TABLE, Row, rows)
            told(map(asdict, made))


if __name__ == "__main__":
    main()
