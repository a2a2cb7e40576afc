"""Engagements of one gear feel each other through what is static in it: compliance between them at every level beside
that of level full, where all stored modes are dynamic; it stays positive; and without the far part it errs."""

from __future__ import annotations

import numpy as np
import pytest
from driven import begun

from gearfmu.body import load_bodies
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import SPIN, LinearModel
from gearfmu.stage import assemble
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stagefile.stage import load_stage

RIGID, FAST, STANDARD, FULL = 0.0, 1.0, 2.0, 3.0
LIMITS = {RIGID: 5e-4, FAST: 2e-4, STANDARD: 1e-4}  # of the own compliance
TORQUE = 600.0


def linear(blob: bytes, level: float) -> LinearModel:
    """The set at rest under TORQUE at a level."""
    return begun(Kernel(blob, {"level": level}), {"carrier.tau": TORQUE, "sun.tau": -TORQUE / 4}).linearise()


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


QUICK = ("planetary54", FAST)
CASES = [(name, level) for name in ("planetary54", "helical_set") for level in LIMITS]


@pytest.mark.parametrize(
    ("name", "level"), [pytest.param(*case, marks=[pytest.mark.full] * (case != QUICK)) for case in CASES]
)
def test_engagements_feel_each_other_as_at_level_full(name: str, level: float) -> None:
    spec = load_stage(name)
    blob = assemble(spec, load_bodies(spec)).blob
    exact = compliance(linear(blob, FULL))
    without = write_blob({name: part for name, part in read_blob(blob).items() if not name.startswith("far_")})
    found, bare = error(blob, level, exact), error(without, level, exact)
    assert found < LIMITS[level] < bare
