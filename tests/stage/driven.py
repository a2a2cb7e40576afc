"""Kernels started under given inputs, and their outputs step by step."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gearfmu.kernel import Kernel


def begun(kernel: Kernel, inputs: Mapping[str, float]) -> Kernel:
    """The kernel in static equilibrium under its inputs."""
    give(kernel, inputs)
    kernel.initialize()
    return kernel


def give(kernel: Kernel, inputs: Mapping[str, float]) -> None:
    for name, value in inputs.items():
        kernel.set(name, value)


def stepped(
    kernel: Kernel, count: int, h: float, *names: str, before: Callable[[int], object] = lambda i: None
) -> np.ndarray:
    """(count, names): outputs after each of so many communication steps of h (s), under inputs that stay or that
    `before` sets, called with the number of the step."""
    found, start = np.empty((count, len(names))), kernel.time
    for i in range(count):
        before(i)
        kernel.step(start + i * h, h)
        found[i] = [kernel.get(name) for name in names]
    return found
