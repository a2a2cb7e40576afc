"""R1 within a step: where friction is at its limits does not depend on which contacts are tried first.

A step has one solution of its contacts and its friction: another way to it ends at the same forces. The other kernel
begins with every contact below its limit, the shipped one where speeds put them. Both are in double: in single
precision a step is solved to 3·10⁻⁷ of its gaps, which hides a difference (docs/decisions/kernel.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builds import double_library, edited_library
from kinds import KINDS, Kind, at_level, family, loaded, some

from gearfmu.kernel import Kernel

OTHER_WAY = {r"glide->limit\[i\] = first_limit\(glide, s, i\);": "(void)first_limit, glide->limit[i] = 0;"}
STEPS, H = 40, 1e-5  # number; s
UNSOLVED = 4  # bit of solver.status
TOLERANCE = 5e-6  # of the largest force: found up to 7e-7; the scalar of a step is solved to 1e-9 of the energy


def started(kind: Kind, library: Path) -> Kernel:
    model, inputs = kind.model().driven_by_springs(), loaded(kind)
    kernel = Kernel(model.blob, at_level(model, h=H) | {"effect.friction": 1.0}, library=library)
    for name, value in inputs(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    return kernel


@pytest.mark.parametrize("kind", some(["pair"], KINDS.keys() - {"pair"}))
def test_a_step_with_friction_has_one_solution(kind: Kind) -> None:
    shipped, other = started(kind, double_library()), started(kind, edited_library("any_way", OTHER_WAY, "double"))
    forces = [name for name in shipped.variables if family(name) in ("slice", "friction_force")]
    worst, largest = 0.0, 0.0
    for i in range(STEPS):
        other.restore(shipped.save())
        for kernel in (shipped, other):
            for key, value in loaded(kind)(i * H).items():
                kernel.set(key, value)
            kernel.step(i * H, H)
        found = np.array([[kernel.get(force) for force in forces] for kernel in (shipped, other)])
        largest = max(largest, float(np.abs(found[0]).max()))
        worst = max(worst, float(np.abs(found[1] - found[0]).max()))
    assert worst < TOLERANCE * largest
    assert not any(int(kernel.get("solver.status")) & UNSOLVED for kernel in (shipped, other))
