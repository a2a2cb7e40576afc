"""The stage linearised about a loaded position: natural frequencies of gears, bearings, shafts and ports together.

The kernel gives the model, in its own terms (`Kernel.linearise`): coordinates q are spins and oscillators, rows W are
the contacts under load and the springs of ports, S the compliance parallel to their dampers, Q all else that is
quasi-static (docs/theory.md, 8):

    x = W q,   λ = −(Q + S)⁻¹ x     ⇒     M q̈ + [diag(ω²) + Wᵀ (Q + S)⁻¹ W] q = 0                              (29)

The position is frozen; gears do not turn. Where neither meshes nor springs of ports resist a rotation of the whole
stage, that rotation is no mode: its frequency, near 0 or imaginary, is only how its loads change with its position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg as sl
from scipy.optimize import linear_sum_assignment

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.kernel.linear import GROUND, SPIN, LinearModel
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.assemble import stage_group
from gearfmu.stage.run.limits import places_of
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.turning import rolling
from gearfmu.stagefile.tables.bodies import ShaftBody

GROUPS = ("mesh", "bearings", "shafts", "bodies")
EVERY = {"level": 3.0, "h": 1e-7}  # full, at a step that resolves every oscillator
SPARE = 10  # modes followed beyond those asked for: some leave the lowest ones on their way through the pitch
RIGID = 0.5  # of a mode's kinetic energy in free rotation of the stage: beyond it the mode is that rotation


@dataclass(frozen=True)
class StageModes:
    """Natural frequencies over one pitch. torque N·m on the input; position (P,) in pitches; frequency (P, n) Hz, each
    column one mode followed over the positions, their means ascending; damping_ratio (P, n); shares (P, n, 4): of the
    strain energy in `GROUPS`; mesh_force (P, n, E): N/m, amplitude of the force of each engagement at resonance per
    amplitude of a transmission error there that drives it; meshes (E,): their names; rigid (P, d): Hz, of the free
    rotations of the whole stage, which are no modes, 0 where the position is unstable."""

    torque: float
    position: np.ndarray
    frequency: np.ndarray
    damping_ratio: np.ndarray
    shares: np.ndarray
    mesh_force: np.ndarray
    meshes: tuple[str, ...] = ("mesh",)
    rigid: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


def stage_modes(
    model: StageModel, bodies: Sequence[Body], torque: float, count: int = 20, positions: int = 12
) -> StageModes:
    """The `count` lowest natural frequencies under `torque` (N·m on the input, not 0; output held, other ports free) at
    positions i/N of one pitch, of that mesh whose pitch is longest. bodies: those that the model is made of.

    SimulationError(no_equilibrium) where the stage finds none.
    """
    position, kernel, shafts = np.arange(positions) / positions, full_kernel(model), shaft_rows(model, bodies)
    systems = [linearised(model, torque, part, kernel, shafts) for part in position]
    squared, shapes, rigid = zip(*(system.shapes(count + SPARE) for system in systems), strict=True)
    values = [system.values(*own) for system, *own in zip(systems, squared, shapes, strict=True)]
    orders = followed(systems[0].linear.mass, shapes)
    of_modes = [np.stack([own[k][order] for own, order in zip(values, orders, strict=True)]) for k in range(4)]
    lowest = np.argsort(of_modes[0].mean(axis=0), kind="stable")[:count]
    frequency, damping_ratio, shares, mesh_force = (np.take(own, lowest, axis=1) for own in of_modes)
    meshes = tuple(mesh.name for mesh in model.stage.engagements)
    most = max(own.size for own in rigid)
    turning = np.stack([np.pad(np.sqrt(np.maximum(own, 0.0)), (most - own.size, 0)) for own in rigid]) / (2 * np.pi)
    return StageModes(torque, position, frequency, damping_ratio, shares, mesh_force, meshes, turning)


def linearised(
    model: StageModel, torque: float, position: float, kernel: Kernel | None = None, shafts: np.ndarray | None = None
) -> Linearised:
    """Equation (29) at one position (in pitches) under `torque`, N·m on the input. kernel: of the model, prepared, of
    the level that decides which oscillators are dynamic (full when None); shafts: `shaft_rows`."""
    kernel = kernel or full_kernel(model)
    pitch = max((place.pitch for place in places_of(model)), key=abs)
    kernel.transmission(-position * pitch, torque)
    linear = kernel.linearise()
    return Linearised(linear, shafts, free_rotations(model.stage, linear), model.support_coupling)


def free_rotations(stage: Stage, linear: LinearModel) -> np.ndarray:
    """(n, d): rotations that neither meshes in contact, as rigid gears, nor springs of ports resist, orthonormal by the
    mass: of the whole stage, of a planet without load."""
    spins = np.flatnonzero(linear.group == SPIN)
    carrying, equations = set(linear.label[:, 0].tolist()), rolling(stage)
    equations = [own for e, own in enumerate(equations) if e >= len(stage.engagements) or e in carrying]
    rolls = np.array([[float(own.get(name, 0)) for name in stage.rotors] for own in equations])
    of_rotors = np.zeros((len(rolls), len(spins)))
    number = linear.number[spins]
    known = number < len(stage.rotors)
    of_rotors[:, known] = rolls[:, number[known]]
    springs = linear.rows[linear.label[:, 0] < 0][:, spins]
    root, found = np.sqrt(linear.mass[spins]), np.zeros((len(linear.mass), 0))
    if spins.size:
        rows = np.vstack([of_rotors, springs]) / root
        largest = np.abs(rows).max(axis=1, keepdims=True)
        free = sl.null_space(rows / np.where(largest > 0, largest, 1.0), rcond=1e-6)
        found = np.zeros((len(linear.mass), free.shape[1]))
        found[spins] = free / root[:, None]
    return found


def full_kernel(model: StageModel) -> Kernel:
    """The kernel prepared at level full."""
    kernel = model.kernel(**EVERY)
    kernel.prepare()
    return kernel


def shaft_rows(model: StageModel, bodies: Sequence[Body]) -> np.ndarray | None:
    """(k, oscillators of the ground group): √2 × the square root of the strain energy of each mode of an elastic shaft
    or of the housing, beside what its ends yield beyond them; None where the stage has no shafts."""
    if not any(isinstance(body, ShaftBody) for body in model.stage.bodies.values()):
        return None
    group, found = stage_group(model.stage, bodies), []
    for number, body in enumerate(group.layout.bodies):
        if body.flank is None:
            shapes = group.shapes[group.at[number]]
            found.append(body.omega[:, None] * shapes[len(shapes) - body.omega.size :])
    return np.vstack(found)


@dataclass(frozen=True)
class Linearised:
    """Equation (29). linear: of the kernel; shafts: `shaft_rows`, whose strain energy counts as that of shafts; free:
    `free_rotations`, none when None; coupling: `StageModel.support_coupling`."""

    linear: LinearModel
    shafts: np.ndarray | None = None
    free: np.ndarray | None = None
    coupling: np.ndarray | None = None

    @cached_property
    def compliance(self) -> np.ndarray:
        """Q + S (m, m), m/N."""
        return self.linear.residual + self.linear.own

    @property
    def stiffness(self) -> np.ndarray:
        """(n, n), N/m."""
        linear = self.linear
        coupling = linear.rows.T @ np.linalg.solve(self.compliance, linear.rows)
        return np.diag(linear.mass * linear.omega**2) + 0.5 * (coupling + coupling.T)

    def modes(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """`values` of the `count` lowest modes."""
        return self.values(*self.shapes(count)[:2])

    def values(self, squared: np.ndarray, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of modes with ω² (k,) and shapes (n, k): frequencies (k,) Hz, damping ratios, shares (k, 4) of the strain
        energy, and of each engagement (k, E) the mesh force at resonance per transmission error (N/m): Γ²/(2ζω²), Γ the
        force of a mode φ along the line of action, −τᵀ(Q + S)⁻¹Wφ, τ derivative of the gaps by the error."""
        omega = np.sqrt(squared)
        forces = np.linalg.solve(self.compliance, self.linear.rows @ shapes)
        ratio = self._loss(forces, shapes) / (2 * omega)
        mesh, te = self.linear.label[:, 0], self.linear.te
        drive = [np.where(mesh == e, te, 0.0) @ forces for e in range(self.linear.engagements)]
        mesh_force = np.stack(drive, axis=1) ** 2 / (2 * ratio * squared)[:, None]
        return omega / (2 * np.pi), ratio, self._energies(forces, shapes) / squared[:, None], mesh_force

    def shapes(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """ω² (count,) of the lowest modes, ascending, mass-normalised shapes (n, count), and ω² (d,) of the free
        rotations of the stage, which are not among them."""
        scale = 1 / np.sqrt(self.linear.mass)
        free = np.zeros((len(scale), 0)) if self.free is None else self.free
        last = min(count + free.shape[1], len(scale)) - 1
        squared, shapes = sl.eigh(scale[:, None] * self.stiffness * scale, subset_by_index=[0, last])
        shapes = scale[:, None] * shapes
        rigid = ((free.T @ (self.linear.mass[:, None] * shapes)) ** 2).sum(axis=0) > RIGID
        return squared[~rigid][:count], shapes[:, ~rigid][:, :count], squared[rigid]

    def _energies(self, forces: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """(modes, 4): twice the strain energy in each of `GROUPS`. What is neither in the rows nor in the springs of
        supports nor in the shafts' modes is in the bodies."""
        linear = self.linear
        work = forces * (linear.rows @ shapes)
        total = ((linear.omega[:, None] * shapes) ** 2).sum(axis=0) + work.sum(axis=0)
        contact = linear.label[:, 0] >= 0
        mesh, shafts = work[contact].sum(axis=0), work[~contact].sum(axis=0)
        supported = linear.support_rows @ shapes - linear.support_forces @ forces
        bearings = (linear.support_compliance[:, None] * supported**2).sum(axis=0)
        if self.coupling is not None:
            bearings = bearings + (supported * (self.coupling @ supported)).sum(axis=0)
        if self.shafts is not None:
            ground = linear.group == GROUND
            shafts = shafts + ((self.shafts[:, linear.number[ground]] @ shapes[ground]) ** 2).sum(axis=0)
        return np.stack([mesh, bearings, shafts, total - mesh - bearings - shafts], axis=1)

    def _loss(self, forces: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """2ζω of each mode, to first order: what dampers take at unit speed of it."""
        linear = self.linear
        across = linear.dashpot[:, None] * (linear.own @ forces) ** 2
        on_supports = linear.damper[:, None] * (linear.damper_rows @ shapes) ** 2
        modal = (2 * linear.zeta * linear.omega)[:, None] * shapes**2
        return across.sum(axis=0) + on_supports.sum(axis=0) + modal.sum(axis=0)


def followed(mass: np.ndarray, shapes: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Order (k,) of the modes at every position in which column j is one mode throughout: from each position to the
    next those are paired whose modal assurance criteria (MAC) add up to the most.

    mass (n,): of the coordinates; shapes: (n, k) at each position, mass-normalised.
    """
    order = [np.arange(shapes[0].shape[1])]
    for before, after in zip(shapes[:-1], shapes[1:], strict=True):
        alike = (before.T @ (mass[:, None] * after)) ** 2
        order.append(linear_sum_assignment(alike, maximize=True)[1][order[-1]])
    return order
