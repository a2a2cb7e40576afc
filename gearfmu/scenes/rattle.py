"""Free rattle of a pair at one place of its mesh: the scene of the conservation tests, and its energy.

Both shafts are free (torque ports). By default nothing is damped and the mesh position is frozen
(effect.roll_motion off), so that the invariant of the time step (docs/theory.md, eq. 11) must not change at all.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.spec.stage import PortSpec, StageSpec
from gearfmu.stage import StageModel, assemble
from gearfmu.stage.blob import read_blob, write_blob

PHASE, BEARING_K, BEARING_C = 5, 16, 17  # places among the numbers of a gear in the blob
CONSERVING = {"effect.contact_damping": 0.0, "effect.modal_damping": 0.0, "effect.roll_motion": 0.0}


@dataclass(frozen=True)
class Rattle:
    """How the free pair is put together and started.

    position: of the mesh, in pitches; offset: along the line of action from the middle of the backlash, m;
    speed: closing speed of the drive flanks along the line of action, m/s; play: backlash along the line of action, m
    (negative: jammed); load: torque on the pinion that presses the drive flanks together, N·m, balanced at the wheel;
    bearing: stiffness of all bearings, N/m, None: the stage's; bearing_damping: of all bearings, N·s/m.
    """

    position: float = 0.0
    offset: float = 0.0
    speed: float = 0.1
    play: float = 60e-6
    load: float = 0.0
    bearing: float | None = None
    bearing_damping: float = 0.0


@dataclass(frozen=True)
class Energies:
    """Of one run, sampled at every internal step from the first one on.

    total (n,): stored energy minus work of the ports, J; dissipated (n,), J; kinetic: at the start, J;
    changes: number of samples at which another set of tooth pairs carried load; trouble: steps the solver had trouble
    with; gamma_lowered: whether the step was above the accuracy limit.
    """

    total: np.ndarray
    dissipated: np.ndarray
    kinetic: float
    changes: int
    trouble: int
    gamma_lowered: bool
    stored: np.ndarray = field(repr=False)

    @property
    def drift(self) -> float:
        """Largest change of the total over the larger of kinetic energy and stored energy at the start."""
        return float(np.ptp(self.total + self.dissipated) / max(self.kinetic, self.stored[0]))

    @property
    def growth(self) -> float:
        """Largest growth of the total in any one step, same scale."""
        return float(np.diff(self.total).max() / max(self.kinetic, self.stored[0]))


def free_pair(spec: StageSpec, bodies: Sequence[Any]) -> StageModel:
    """The stage with torque ports on both shafts and undamped bearings."""
    ports = {gear.name: PortSpec(kind="torque") for gear in spec.gears}
    return assemble(spec.model_copy(update={"ports": ports}), bodies)


def placed(model: StageModel, start: Rattle) -> bytes:
    """Blob of a `free_pair` turned to the place where `start` begins, with its bearings."""
    geometry = PairGeometry.of(model.spec)
    sections = dict(read_blob(model.blob))
    turn = 2 * math.pi * start.position
    back = (0.5 * start.play - start.offset) / geometry.gears[0].r_b if start.load == 0.0 and start.play > 0 else 0.0
    for name, angle in (("gear0", turn / geometry.gears[0].z - back), ("gear1", -turn / geometry.gears[1].z)):
        numbers = np.array(sections[name])
        numbers[PHASE] += angle
        numbers[BEARING_C] = start.bearing_damping
        if start.bearing is not None:
            numbers[BEARING_K] = start.bearing
        sections[name] = numbers
    return write_blob(sections)


def started(
    model: StageModel, start: Rattle, parameters: Mapping[str, float] | None = None, library: Path | None = None
) -> Kernel:
    """A kernel of the pair at its start; `parameters` go over CONSERVING. Momenta along the mesh cancel: the pair
    stays where it is."""
    geometry = PairGeometry.of(model.spec)
    inertia, r_b = ([numbers[i] for numbers in map(read_blob(model.blob).get, ("gear0", "gear1"))] for i in (7, 1))
    mass = [inertia[i] / r_b[i] ** 2 for i in (0, 1)]
    share = [mass[1 - i] / sum(mass) for i in (0, 1)]
    names = [gear.name for gear in model.spec.gears]
    speeds = {f"{names[i]}.w_start": start.speed * share[i] / r_b[i] for i in (0, 1)}
    backlash = {"backlash": start.play / math.cos(geometry.alpha_wt)}
    kernel = Kernel(placed(model, start), {**CONSERVING, **speeds, **backlash, **(parameters or {})}, library)
    for i in (0, 1):
        kernel.set(f"{names[i]}.tau", start.load * r_b[i] / r_b[0])
    kernel.initialize()
    return kernel


def energies(kernel: Kernel, h: float, duration: float) -> Energies:
    """Steps a started kernel through `duration` (s) with communication steps h (s), which are its internal steps when
    its own h is not smaller."""
    names = ("energy.stored", "energy.work", "energy.dissipated", "mesh.pairs", "mesh.contact")
    references = (ctypes.c_uint32 * len(names))(*(kernel.variables[name].reference for name in names))
    samples = np.empty((round(duration / h), len(names)))
    kinetic, first = kernel.get("energy.stored"), samples.ctypes.data
    for i in range(len(samples)):
        kernel.step(i * h, h)
        kernel.get_many(references, first + i * samples.strides[0])
    stored, work, dissipated, pairs, contact = samples.T
    changes = int(np.count_nonzero((np.diff(pairs) != 0) | (np.diff(contact) != 0)))
    return Energies(
        stored - work,
        dissipated,
        kinetic,
        changes,
        int(kernel.get("solver.trouble")),
        bool(int(kernel.get("solver.status")) & 8),
        stored,
    )
