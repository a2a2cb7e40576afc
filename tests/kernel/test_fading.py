"""Motion that fades: of a pair that has lost its load nothing becomes denormal, which many processors compute two to
three times as slowly. The kernel does so by its own arithmetic and leaves the processor's control word alone."""

from __future__ import annotations

import ctypes
import platform

import numpy as np
import pytest
from driven import begun, give
from small_model import pair_blob

from gearfmu.kernel import Kernel

FAST, FULL = 1.0, 3.0
UNDERFLOW, ALL = 0x10, 0x3D  # of <fenv.h> on x86-64
STEP = 1e-3  # s, 200 internal ones


def fading(level: float, speed: float) -> Kernel:
    """A pair that springs apart: under torque at the start, which ends with the first step."""
    speeds = {"pinion.w_start": speed, "wheel.w_start": -speed * 16 / 24}
    kernel = Kernel(pair_blob(("torque", "torque")), {"level": level, "h": 5e-6, "backlash": 2e-3, **speeds})
    begun(kernel, {"pinion.tau": 2.0, "wheel.tau": 3.0})
    give(kernel, {"pinion.tau": 0.0, "wheel.tau": 0.0})
    return kernel


@pytest.mark.skipif(platform.machine() not in ("x86_64",) or platform.system() != "Linux", reason="flags of x86-64")
@pytest.mark.parametrize("speed", [0.0, 200.0])
@pytest.mark.parametrize("level", [FAST, FULL])
def test_no_result_of_a_step_is_denormal(level: float, speed: float) -> None:
    """While it rings down and long after: modes in single precision used to stay at 1e-40 for ever, as did products
    with them. The processor's own flag tells, of every operation of 250 ms."""
    flags, kernel = ctypes.CDLL("libm.so.6"), fading(level, speed)
    stored = []
    for i in range(250):
        flags.feclearexcept(ALL)
        kernel.step(i * STEP, STEP)
        assert not flags.fetestexcept(UNDERFLOW), f"step {i}"
        stored.append(kernel.get("energy.stored"))
    assert kernel.get("mesh.contact") == 0 and np.ptp(stored) > 1e-9


@pytest.mark.skipif(platform.machine() not in ("x86_64",) or platform.system() != "Linux", reason="layout of fenv_t")
def test_the_control_word_of_the_host_is_left_alone() -> None:
    """Rounding direction, masks and modes; the flags below them say what was computed."""
    libm, before, after = ctypes.CDLL("libm.so.6"), (ctypes.c_uint32 * 8)(), (ctypes.c_uint32 * 8)()
    kernel = fading(FAST, 200.0)
    libm.fegetenv(before)
    kernel.step(0.0, STEP)
    libm.fegetenv(after)
    assert before[7] & ~0x3F == after[7] & ~0x3F
