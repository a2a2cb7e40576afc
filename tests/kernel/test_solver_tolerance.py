"""How well a step is solved: rigid gears have no numbers in single precision, so that the product differs from the
double build by the tolerance of its solver alone (1e-7 of the last move instead of 1e-11)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from driven import begun, stepped
from small_model import pair_blob

from gearfmu.kernel import Kernel

STEP, STEPS, EM = 7e-6, 6, 1
RIGID = {"level": 0, "slices": 1, "integrator": EM, "effect.elastic": 0, "effect.bearings": 0}


def after_a_jump(library: Path | None, torques: tuple[float, float], damping: float) -> np.ndarray:
    """Mesh force (N) and transmission error (m) of every step after a jump of the torque (N·m)."""
    kernel = Kernel(pair_blob(("torque", "fixed")), {**RIGID, "contact_damping": damping}, library)
    begun(kernel, {"pinion.tau": torques[0]}).set("pinion.tau", torques[1])
    return stepped(kernel, STEPS, STEP, "mesh.force", "mesh.te")


@pytest.mark.parametrize("damping", [0.0, 2e4])
@pytest.mark.parametrize("torques", [(1.0, 100.0), (10.0, 300.0), (100.0, 300.0), (300.0, 10.0)])
def test_the_product_solves_its_steps_as_well_as_the_double_build(
    double_library: Path, torques: tuple[float, float], damping: float
) -> None:
    """Worst of the cases: 2.4e-8; with a tolerance of 1e-5 7e-7, of 1e-3 1e-4."""
    found, wanted = (after_a_jump(library, torques, damping) for library in (None, double_library))
    error = np.abs(found - wanted).max(axis=0) / np.abs(wanted).max(axis=0)
    assert error.max() < 1e-7
