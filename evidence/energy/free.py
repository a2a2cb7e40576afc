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

from gearfmu.kernel import Kernel
from gearfmu.stage import assemble
from gearfmu.stage.assembly.blob import GEAR_NUMBERS, gear_numbers, read_blob, write_blob
from gearfmu.stagefile.forms.expand import rewritten, with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.bodies import GearSpec
from gearfmu.stagefile.tables.connections import PortSpec

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
    changes: number of samples at which another set of tooth pairs carried load; retried_steps: steps left unsolved.
    """

    total: np.ndarray
    dissipated: np.ndarray
    kinetic: float
    changes: int
    retried_steps: int
    stored: np.ndarray = field(repr=False)

    @property
    def drift(self) -> float:
        """Largest change of the total over the larger of kinetic energy and stored energy at the start."""
        return float(np.ptp(self.total + self.dissipated) / max(self.kinetic, self.stored[0]))

    @property
    def growth(self) -> float:
        """Largest growth of the total in any one step, same scale."""
        return float(np.diff(self.total).max() / max(self.kinetic, self.stored[0]))


@dataclass(frozen=True)
class FreePair:
    """A stage with torque ports on both shafts, and its reduced bodies."""

    spec: Stage
    bodies: Sequence[Any]
    _mounted: dict[tuple[float | None, float], dict[str, Any]] = field(default_factory=dict, repr=False)

    def sections(self, start: Rattle) -> dict[str, Any]:
        """Sections of the model on the bearings of `start`."""
        key = start.bearing, start.bearing_damping
        if key not in self._mounted:
            both = zip(self.spec.written.gears, self.bodies, strict=True)
            gears = tuple(_on_bearing(gear, body.total_mass, *key) for gear, body in both)
            model = assemble(rewritten(self.spec, gears=gears), self.bodies)
            self._mounted[key] = dict(read_blob(model.blob))
        return self._mounted[key]

    def place(self, start: Rattle) -> bytes:
        """Blob of the model turned to where `start` begins."""
        shapes, sections = self.spec.written.geometry.gears, dict(self.sections(start))
        turn = 2 * math.pi * start.position
        free = start.load == 0.0 and start.play > 0
        back = (0.5 * start.play - start.offset) / shapes[0].r_b if free else 0.0
        for name, angle in (("gear0", turn / shapes[0].z - back), ("gear1", -turn / shapes[1].z)):
            numbers = dict(zip(GEAR_NUMBERS, sections[name], strict=True))
            sections[name] = gear_numbers(numbers | {"phase": numbers["phase"] + angle})
        return write_blob(sections)


def free_pair(spec: Stage, bodies: Sequence[Any]) -> FreePair:
    """The stage with torque ports on both shafts."""
    ports = {gear.name: PortSpec(kind="torque") for gear in spec.written.gears}
    return FreePair(with_ports(spec, ports), bodies)


def _on_bearing(gear: GearSpec, mass: float, stiffness: float | None, damping: float) -> GearSpec:
    """The gear on a bearing of that radial stiffness (None: its own) and damping (N·s/m)."""
    k = gear.bearing.stiffness if stiffness is None else stiffness
    bearing = gear.bearing.model_copy(update={"stiffness": k, "damping_ratio": damping / (2 * math.sqrt(k * mass))})
    return gear.model_copy(update={"bearing": bearing})


def started(
    pair: FreePair, start: Rattle, parameters: Mapping[str, float] | None = None, library: Path | None = None
) -> Kernel:
    """A kernel of the pair at its start; `parameters` go over CONSERVING. Momenta along the mesh cancel: the pair
    stays where it is."""
    geometry, inertia = pair.spec.written.geometry, pair.sections(start)["inertia"]
    r_b = [gear.r_b for gear in geometry.gears]
    mass = [inertia[i] / r_b[i] ** 2 for i in (0, 1)]
    share = [mass[1 - i] / sum(mass) for i in (0, 1)]
    names = [gear.name for gear in pair.spec.written.gears]
    speeds = {f"{names[i]}.w_start": start.speed * share[i] / r_b[i] for i in (0, 1)}
    backlash = {"backlash": start.play / math.cos(geometry.alpha_wt)}
    kernel = Kernel(pair.place(start), {**CONSERVING, **speeds, **backlash, **(parameters or {})}, library)
    for i in (0, 1):
        kernel.set(f"{names[i]}.tau", start.load * r_b[i] / r_b[0])
    kernel.initialize()
    return kernel


def energies(
    kernel: Kernel, h: float, duration: float, watched: Sequence[str] = ("mesh.pairs", "mesh.contact")
) -> Energies:
    """Steps a started kernel through `duration` (s) with communication steps h (s), which are its internal steps when
    its own h is not smaller. watched: outputs that say which tooth pairs carry."""
    names = ("energy.stored", "energy.work", "energy.dissipated", *watched)
    references = (ctypes.c_uint32 * len(names))(*(kernel.variables[name].reference for name in names))
    samples = np.empty((round(duration / h), len(names)))
    kinetic, first = kernel.get("energy.stored"), samples.ctypes.data
    for i in range(len(samples)):
        kernel.step(i * h, h)
        kernel.get_many(references, first + i * samples.strides[0])
    stored, work, dissipated = samples.T[:3]
    changes = int(np.count_nonzero(np.any(np.diff(samples[:, 3:], axis=0) != 0, axis=1)))
    return Energies(stored - work, dissipated, kinetic, changes, int(kernel.get("solver.retried_steps")), stored)
