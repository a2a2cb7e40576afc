"""Engagements of one gear feel each other through what is static in it: compliance between them at every level beside
that of level full, where all stored modes are dynamic; it stays positive; and without the far part it errs."""

from __future__ import annotations

import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import SPIN, LinearModel
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stagefile.stage import load_stage

RIGID, FAST, STANDARD, FULL = 0.0, 1.0, 2.0, 3.0
TORQUE = 600.0


@pytest.fixture(scope="module")
def model() -> StageModel:
    return set_of("planetary54")


def set_of(name: str) -> StageModel:
    spec = load_stage(name)
    return assemble(spec, load_bodies(spec))


def bare_of(model: StageModel) -> bytes:
    """Its blob without the far part."""
    return write_blob({name: part for name, part in read_blob(model.blob).items() if not name.startswith("far_")})


@pytest.fixture(scope="module")
def without(model: StageModel) -> bytes:
    return bare_of(model)


def linear(blob: bytes, level: float) -> LinearModel:
    """The set at rest under TORQUE at a level."""
    kernel = Kernel(blob, {"level": level})
    kernel.set("carrier.tau", TORQUE)
    kernel.set("sun.tau", -TORQUE / 4)
    kernel.initialize()
    return kernel.linearise()


def compliance(found: LinearModel) -> dict[tuple[tuple[int, ...], tuple[int, ...]], float]:
    """m/N between contacts by their labels: everything but spins and rigid motion."""
    elastic = (found.group != SPIN) & (found.omega > 0.0)
    rows = found.rows[:, elastic] / found.omega[elastic]
    total = found.residual + found.own + rows @ rows.T
    labels = [tuple(int(k) for k in label) for label in found.label]
    contacts = [i for i, label in enumerate(labels) if label[0] >= 0]
    return {(labels[i], labels[j]): total[i, j] for i in contacts for j in contacts}


def error(blob: bytes, level: float, exact: dict) -> float:
    """Largest error of compliance between engagements, over the own compliance of a contact."""
    found = compliance(linear(blob, level))
    pairs = [(a, b) for a, b in found if a[0] != b[0] and (a, b) in exact]
    own = np.mean([value for (a, b), value in exact.items() if a == b])
    assert len(pairs) > 500
    return max(abs(found[pair] - exact[pair]) for pair in pairs) / own


@pytest.fixture(scope="module")
def exact(model: StageModel) -> dict:
    return compliance(linear(model.blob, FULL))


@pytest.mark.parametrize(
    ("level", "limit"),
    [
        pytest.param(RIGID, 5e-4, marks=pytest.mark.full),
        (FAST, 2e-4),
        pytest.param(STANDARD, 1e-4, marks=pytest.mark.full),
    ],
)
def test_engagements_feel_each_other_as_at_level_full(
    model: StageModel, without: bytes, exact: dict, level: float, limit: float
) -> None:
    found, bare = error(model.blob, level, exact), error(without, level, exact)
    print(f"level {level:g}: error {found:.1e} of own compliance, {bare:.1e} without far teeth")
    assert found < limit < bare


@pytest.mark.full
def test_so_do_those_of_helical_gears() -> None:
    helical = set_of("helical_set")
    wanted, bare = compliance(linear(helical.blob, FULL)), bare_of(helical)
    for level, limit in ((RIGID, 5e-4), (FAST, 2e-4), (STANDARD, 1e-4)):
        assert error(helical.blob, level, wanted) < limit < error(bare, level, wanted), f"level {level:g}"
