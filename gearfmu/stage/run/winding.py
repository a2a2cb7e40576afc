"""Winding of a stage under a torque and its loss to friction: statics of a run with given parameters."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from gearfmu.errors import SimulationError
from gearfmu.kernel import Kernel
from gearfmu.kernel.instance import Recording

SECANT = 0.01  # of the torque


def mean_winding(
    blob: bytes, parameters: Mapping[str, float], torque: float, angles: tuple[float, ...], ratio: float
) -> tuple[float, float]:
    """Mean angle of the input (rad) under a torque on it (N·m), less its rotation by the output's angles (rad), and its
    growth with the torque at the first of them, rad/(N·m); with these parameters of the kernel."""
    return _mean_winding(blob, tuple(sorted(at_rest(blob, parameters).items())), torque, angles, ratio)


@lru_cache(maxsize=8)
def _mean_winding(
    blob: bytes, parameters: tuple[tuple[str, float], ...], torque: float, angles: tuple[float, ...], ratio: float
) -> tuple[float, float]:
    kernel = Kernel(blob, dict(parameters))
    kernel.prepare()
    found = [kernel.transmission(at, torque, keep=i > 0).phi - ratio * at for i, at in enumerate(angles)]
    less = kernel.transmission(angles[0], (1.0 - SECANT) * torque).phi - ratio * angles[0]
    return float(np.mean(found)), (found[0] - less) / (SECANT * torque) if torque else 0.0


def at_rest(blob: bytes, parameters: Mapping[str, float]) -> dict[str, float]:
    """Parameters for the statics of a run with these, which do not depend on level, integrator and step: level rigid.
    But level paper and contact by nodes have less compliance and their own statics."""
    kernel = Kernel(blob, parameters)
    level, contact = (kernel.variables[name].items[int(kernel.get(name))] for name in ("level", "contact"))
    own = level == "paper" or contact == "nodal"
    return {**parameters, **({} if own else {"level": 0.0, "integrator": 0.0, "h": 0.0})}


def rubbed_away(
    blob: bytes, parameters: Mapping[str, float], inputs: Mapping[str, np.ndarray], step: float, port: str
) -> float:
    """Part of the work of the port `port` that friction of the flanks takes in the second half of a run from
    equilibrium; 0 where that fails. inputs: by name, (n,) one for every communication step (s)."""
    kernel = Kernel(blob, at_rest(blob, parameters))
    rubbed = [name for name in kernel.variables if name.endswith(".friction_loss")]
    for name, values in inputs.items():
        kernel.set(name, float(values[0]))
    kernel.initialize()
    steps = len(inputs[f"{port}.w"])
    record = Recording(kernel, [*rubbed, f"{port}.tau_mean"], steps, step)
    try:
        record.advance(steps, inputs)
    except SimulationError:  # the run itself reports it
        return 0.0
    half = steps // 2
    work = step * np.sum(record.rows[half + 1 :, -1] * inputs[f"{port}.w"][half:])
    return float(np.sum(record.rows[-1, :-1] - record.rows[half, :-1]) / abs(work))
