"""The hard cases themselves: at level fast and the default step in every test run, the others under make test-full."""

from __future__ import annotations

import pytest

from gearfmu.stability.case import LEVELS, STEPS, Case
from gearfmu.stability.scenes import SCENES
from gearfmu.stability.suite import Row, Task, judge

QUICK = ("fast", "default")
SLOW = [(level, step) for level in LEVELS for step in STEPS if (level, step) != QUICK]


def found(scene: str, level: str, step: str) -> Row:
    case = Case(level, step)
    finding = judge(Task(scene, case))
    print(f"{scene} {level} h = {finding.h:.3g} s: {finding.outcome}, energy {finding.energy_residual:.1e}")
    print(dict(finding.facts))
    return Row(scene, case, finding, "")


@pytest.mark.parametrize("scene", list(SCENES))
def test_every_scene_runs_through_at_level_fast(scene: str) -> None:
    row = found(scene, *QUICK)
    assert not row.failed, row.finding


@pytest.mark.full
@pytest.mark.parametrize("scene", list(SCENES))
@pytest.mark.parametrize("level, step", SLOW)
def test_every_scene_at_every_level_and_step(scene: str, level: str, step: str) -> None:
    row = found(scene, level, step)
    assert not row.failed, row.finding
