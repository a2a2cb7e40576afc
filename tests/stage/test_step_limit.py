"""The limit of the step on the shipped pair: runs on both sides of μ′ = 1, the default step by its rule, γ lowered with
a warning, refusal with the step to use."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from driven import begun
from inner import Inner

from gearfmu.errors import ModelError, SimulationError
from gearfmu.stage import StageModel, Steady

LOAD = 302.0  # N·m
LEVELS = {"rigid": 0, "fast": 1, "standard": 2, "full": 3}
UNDAMPED = {"effect.hertz": 0.0, "effect.contact_damping": 0.0, "effect.modal_damping": 0.0}
LADDER = np.array([0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 7.5]) * 1e-6  # s: the steps the kernel looks at
MU = 0.9  # of the default step, and of any other by γ
STEPS = 1500


def standing(inner_library: Path, model: StageModel, level: int, h: float) -> tuple[str, np.ndarray]:
    """Outcome and transmission error of a standing pair under load, undamped, γ = 1 whatever the limit says, after a
    millionth of the load is added."""
    inner, calm = Inner(inner_library, model.blob, {"level": level, "h": h, **UNDAMPED}), Steady(model, 0.0, LOAD)(0.0)
    kernel = begun(inner.kernel, calm)
    inner.force_gamma(1.0)
    kernel.set("pinion.phi", calm["pinion.phi"] * (1 + 1e-6))
    te = []
    try:
        for k in range(STEPS):
            kernel.step(k * h, h)
            te.append(kernel.get("mesh.te"))
    except SimulationError as error:
        return error.outcome, np.array(te)
    return "ok", np.array(te)


@pytest.mark.parametrize("level", ["fast", "standard"])
def test_both_sides_of_the_limit(inner_library: Path, relieved: StageModel, level: str) -> None:
    """μ′ is the worst over the pitch: where the pair stands the limit may lie some way beyond 1. Beyond it a knock that
    dies out below grows a thousandfold: until the run is stopped, or contacts that let go bound the swing."""
    number = LEVELS[level]
    probe = Inner(inner_library, relieved.blob, {"level": number, **UNDAMPED})
    steps = np.arange(15e-6, 60e-6, 0.5e-6)
    mu = np.array([probe.mu(h) for h in steps])
    below, above = steps[np.flatnonzero(mu < 0.95)[-1]], steps[np.flatnonzero(mu > 1.5)[0]]
    outcome, te = standing(inner_library, relieved, number, below)
    assert outcome == "ok" and np.ptp(te[-200:]) <= np.ptp(te[:200]) < 1e-8
    outcome, te = standing(inner_library, relieved, number, above)
    swing = np.ptp(te[-200:]) if len(te) else np.inf
    assert outcome != "ok" or swing > 1e-6, f"μ′ = 1.5 at {1e6 * above:.1f} µs did not grow: {swing:.1e} m"


@pytest.mark.parametrize("level", LEVELS)
def test_default_step_is_the_largest_that_meets_the_limit(
    inner_library: Path, relieved: StageModel, level: str
) -> None:
    probe = Inner(inner_library, relieved.blob, {"level": LEVELS[level]})
    good = np.array([probe.mu(h) <= MU for h in LADDER])
    wanted = LADDER[np.flatnonzero(good)[-1]]
    kernel = begun(relieved.kernel(level=LEVELS[level]), Steady(relieved, 0.0, LOAD)(0.0))
    kernel.step(0.0, 1e-3)
    used = kernel.get("solver.h")
    assert 1e-3 / used == pytest.approx(np.ceil(1e-3 / wanted - 1e-9)), f"{used:.3g} s, rule: {wanted:.3g} s"
    assert kernel.get("solver.status") == 0 and not kernel.warning


def test_a_larger_step_lowers_gamma_with_a_warning_and_keeps_the_limit(
    inner_library: Path, relieved: StageModel
) -> None:
    told = []
    for h in (40e-6, 50e-6, 60e-6, 70e-6):
        inner = Inner(inner_library, relieved.blob, {"level": LEVELS["fast"], "h": h})
        found = re.search(r"gamma lowered to (\d\.\d+)", inner.kernel.warning)
        assert found and "needs no lower gamma" in inner.kernel.warning
        told.append(float(found[1]))
        assert inner.mu(h, 1.0) > MU and inner.mu(h, told[-1] - 0.01) <= MU
    assert all(0 <= b < a < 0.7 for a, b in zip(told, told[1:], strict=False))


def test_too_large_a_step_is_refused_with_the_step_to_use(relieved: StageModel) -> None:
    """An eighth of the mesh period at speed_max: 16 teeth at 6000 rpm."""
    allowed = 60 / 6000 / 16 / 8
    kernel = relieved.kernel(level=LEVELS["fast"], h=1.01 * allowed)
    with pytest.raises(ModelError, match=f"use h <= {allowed:.3g}"):
        kernel.prepare()
    relieved.kernel(level=LEVELS["fast"], h=0.99 * allowed).prepare()
