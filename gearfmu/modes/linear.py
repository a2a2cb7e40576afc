"""The stage linearised about a loaded position: natural frequencies of pair, bearings, shafts and bodies together.

Unknowns q are those of the kernel at level full: x, y, φ of either gear's mean-axis frame and its stored modes, and the
inertia of a chain in a port. Everything that couples them acts through rows R with flexibility of its own D and what
the bodies yield beyond their stored modes, C_res (docs/theory.md eq. 2):

    u = R q + C_res f,   f = −D⁻¹ u     ⇒     M q̈ + [diag(0, ω²) + Rᵀ (D + C_res)⁻¹ R] q = 0                    (29)

Rows: how far each loaded slice closes (D: tangent of the local law, eq. 8, at the force of `te`), the bore in its
bearing (D = 1/k), the bore's angle against port spring or chain. The position is frozen; gears do not turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
from numpy.polynomial.legendre import Legendre

from gearfmu.body import ReducedBody
from gearfmu.errors import ModelError
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.spec.ports import PortSpec
from gearfmu.spec.stage import StageSpec
from gearfmu.stage import StageModel
from gearfmu.stage.assembly import FIXED_K
from gearfmu.stage.tables import BORE, excited_modes, resampling, symmetric_functions
from gearfmu.stage.te import statics_of

GROUPS = ("mesh", "bearings", "shafts", "bodies")
DRIVE = 0
LEAST_HALF_WIDTH = 5e-6  # m: below it the local law is a parabola (docs/theory.md 2.4)
RIGID_HZ = 1.0  # below it a mode is rigid rotation of the stage


@dataclass(frozen=True)
class StageModes:
    """Natural frequencies over one pitch. torque N·m; position (P,) in pitches; frequency (P, n) Hz, ascending at each
    position, none rigid; damping_ratio (P, n); shares (P, n, 4): of the strain energy in `GROUPS`; mesh_force (P, n):
    N/m, amplitude of the mesh force at resonance per amplitude of a transmission error that drives it."""

    torque: float
    position: np.ndarray
    frequency: np.ndarray
    damping_ratio: np.ndarray
    shares: np.ndarray
    mesh_force: np.ndarray


def stage_modes(
    model: StageModel, bodies: Sequence[ReducedBody], torque: float, count: int = 20, positions: int = 12
) -> StageModes:
    """The `count` lowest natural frequencies at positions i/N of one pitch under `torque` (N·m on the pinion, > 0).

    SimulationError(no_equilibrium) where the pair finds none, ModelError for a helical pair.
    """
    position, kernel = np.arange(positions) / positions, statics_of(model)
    found = [linearised(model, bodies, torque, part, kernel).modes(count) for part in position]
    return StageModes(torque, position, *(np.stack(part) for part in zip(*found, strict=True)))


def linearised(
    model: StageModel, bodies: Sequence[ReducedBody], torque: float, position: float, kernel: Kernel | None = None
) -> Linearised:
    """Equation (29) at one position (in pitches) under `torque`, N·m on the pinion. kernel: of the model, prepared for
    statics; made here when None."""
    if model.pair.pair.helix_angle:
        raise ModelError(f"{model.name} is helical: the linearised stage knows spur pairs; modes --body takes any gear")
    contacts = loaded_contacts(model.pair, kernel or statics_of(model), torque, position)
    gears = [_gear(model.pair, bodies, index, position, contacts) for index in (0, 1)]
    return _coupled(model.pair, gears, contacts)


@dataclass(frozen=True)
class Contact:
    """A loaded slice: tooth numbers of pinion and wheel, its number across the width, rolls (m) on both gears, force
    (N)."""

    teeth: tuple[int, int]
    slice: int
    rolls: tuple[float, float]
    force: float


def loaded_contacts(spec: StageSpec, kernel: Kernel, torque: float, position: float) -> list[Contact]:
    """The slices that carry load at a position, wheel held, by the static contact routine."""
    pair = PairGeometry.of(spec)
    pinion, wheel = pair.gears
    forces = kernel.transmission(-position * 2 * math.pi / wheel.z, torque).forces
    found = []
    for (flank, tooth), slices in forces.items():
        if flank != DRIVE:
            continue
        roll = pinion.r_b * (2 * math.pi * (position + tooth) / pinion.z + pinion.psi_b + pair.alpha_wt)
        rolls = (float(np.clip(roll, pinion.s_form, pinion.s_tip)),
                 float(np.clip(pair.length - roll, wheel.s_form, wheel.s_tip)))  # fmt: skip
        found += [Contact((tooth, -tooth), k, rolls, force) for k, force in enumerate(slices) if force > 0]
    return found


@dataclass(frozen=True)
class _Gear:
    """One gear's part of (29). mass (n,) of its unknowns x, y, φ, modes; omega (n,) rad/s, 0 for the rigid ones; rows
    (c + 3, n): contacts, then the bore's x, y, φ; residual (c + 3, c + 3) m/N."""

    mass: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    rows: np.ndarray
    residual: np.ndarray


def _gear(
    spec: StageSpec, bodies: Sequence[ReducedBody], index: int, position: float, contacts: Sequence[Contact]
) -> _Gear:
    pair, body = PairGeometry.of(spec), bodies[index]
    shape, side = pair.gears[index], (1.0, -1.0)[index]
    degrees = symmetric_functions(min(b.width_functions for b in bodies))
    chosen = excited_modes(body, degrees)
    angle = (0.0, pair.wheel_phase)[index] + side * 2 * math.pi * position / shape.z
    direction = math.pi / 2 - pair.alpha_wt - angle  # of the line of action in the body's frame
    rigid = np.array([side * math.cos(direction), side * math.sin(direction), shape.r_b])
    weights = slice_weights(spec.contact.slices, degrees)
    places = [(c.teeth[index], resampling(body.roll, c.rolls[index], c.rolls[index], 1)[0]) for c in contacts]
    flank = [
        _on_tooth(np.einsum("r,a,ran->n", place, weights[c.slice], body.flank_rows[DRIVE][:, degrees][..., chosen]),
                  body, chosen, tooth)
        for (tooth, place), c in zip(places, contacts, strict=True)
    ]  # fmt: skip
    modal = np.vstack([*flank, body.bore_rows[np.ix_(np.array(BORE), chosen)]])
    rows = np.hstack([np.vstack([np.tile(rigid, (len(contacts), 1)), np.eye(3)]), modal])
    omega = 2 * np.pi * body.frequency[chosen]
    static = _static(body, degrees, places, weights[[c.slice for c in contacts]])
    return _Gear(
        mass=np.concatenate([[body.mass, body.mass, body.inertia[2, 2]], np.ones(len(chosen))]),
        omega=np.concatenate([np.zeros(3), omega]),
        zeta=np.concatenate([np.zeros(3), body.damping_ratio[chosen]]),
        rows=rows,
        residual=static - (modal / omega) @ (modal / omega).T,
    )


def slice_weights(slices: int, degrees: np.ndarray) -> np.ndarray:
    """(slices, A): (2a + 1) × mean of P_a over each slice of the face width, for loading and reading."""
    edges = np.linspace(-1, 1, slices + 1)
    columns = []
    for a in degrees:
        integral = Legendre.basis(int(a)).integ()(edges)
        columns.append((2 * a + 1) * np.diff(integral) / np.diff(edges))
    return np.stack(columns, axis=1)


def _on_tooth(row: np.ndarray, body: ReducedBody, chosen: np.ndarray, tooth: int) -> np.ndarray:
    """Row (n,) of tooth 0 on another tooth (docs/theory.md eq. 3)."""
    theta = 2 * np.pi * body.nodal_diameter[chosen] * tooth / body.teeth
    first, second = np.flatnonzero(body.part[chosen] == 1), np.flatnonzero(body.part[chosen] == 2)
    result = row * np.cos(theta)
    result[first] -= row[second] * np.sin(theta[first])
    result[second] += row[first] * np.sin(theta[first])
    return result


def _static(
    body: ReducedBody, degrees: np.ndarray, places: Sequence[tuple[int, np.ndarray]], weights: np.ndarray
) -> np.ndarray:
    """C_static (c + 3, c + 3) of contacts at `places` (tooth, weights of the roll points) and of the bore."""
    count = len(places)
    total = np.zeros((count + 3, count + 3))
    bore = np.ix_(BORE, BORE)
    total[count:, count:] = body.static_bb[bore]
    for i, (tooth, place) in enumerate(places):
        for j, (other, there) in enumerate(places):
            block = body.static_ff[DRIVE, DRIVE, other - tooth][..., degrees, :][..., degrees]
            total[i, j] = np.einsum("r,s,a,b,rsab->", place, there, weights[i], weights[j], block)
        x, y, turn = np.einsum("r,a,rak->k", place, weights[i], body.static_fb[DRIVE][:, degrees])[list(BORE)]
        theta = 2 * np.pi * tooth / body.teeth
        c, s = math.cos(theta), math.sin(theta)
        total[i, count:] = total[count:, i] = [c * x - s * y, s * x + c * y, turn]
    return total


@dataclass(frozen=True)
class Linearised:
    """Equation (29). mass (n,), omega (n,), zeta (n,) of the unknowns; rows R (m, n); own D (m,) m/N, residual C_res
    (m, m); group (m,) index into GROUPS; dashpot (m,) N·s/m across a row's own path (a contact's includes the residual
    of its tooth pair, `tooth` (m,) numbering those, −1 elsewhere)."""

    mass: np.ndarray
    omega: np.ndarray
    zeta: np.ndarray
    rows: np.ndarray
    own: np.ndarray
    residual: np.ndarray
    group: np.ndarray
    dashpot: np.ndarray
    tooth: np.ndarray

    @property
    def stiffness(self) -> np.ndarray:
        """(n, n), N/m."""
        coupling = self.rows.T @ np.linalg.solve(np.diag(self.own) + self.residual, self.rows)
        return np.diag(self.mass * self.omega**2) + 0.5 * (coupling + coupling.T)

    def modes(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Frequencies (count,) Hz above `RIGID_HZ`, ascending, damping ratios, shares (count, 4) of the strain energy,
        and the mesh force at resonance per transmission error (N/m): Γ²/(2ζω²), Γ = 1ᵀ(D + C_res)⁻¹ R φ over the
        contacts."""
        scale = 1 / np.sqrt(self.mass)
        last = min(count + 1, len(scale)) - 1  # at most one mode is rigid: two shafts and a mesh
        squared, shapes = sl.eigh(scale[:, None] * self.stiffness * scale, subset_by_index=[0, last])
        shapes = scale[:, None] * shapes
        first = int(np.searchsorted(squared, (2 * np.pi * RIGID_HZ) ** 2))
        squared, shapes = squared[first : first + count], shapes[:, first : first + count]
        omega = np.sqrt(squared)
        forces = np.linalg.solve(np.diag(self.own) + self.residual, self.rows @ shapes)
        bodies = self.mass[:, None] * (self.omega[:, None] * shapes) ** 2
        work = forces * (self.rows @ shapes)
        shares = np.stack([work[self.group == g].sum(axis=0) for g in range(3)] + [bodies.sum(axis=0)], axis=1)
        ratio = self._loss(forces, bodies, omega) / (2 * squared)
        drive = forces[self.group == 0].sum(axis=0)
        return omega / (2 * np.pi), ratio, shares / squared[:, None], drive**2 / (2 * ratio * squared)

    def _loss(self, forces: np.ndarray, bodies: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Σ η U·2 of each mode: what dampers take of it, to first order. A dashpot c beside a flexibility p has the
        loss factor η = ωcp."""
        path = np.diag(self.own) + self.residual * (self.tooth[:, None] == self.tooth) * (self.tooth >= 0)
        moved = path @ forces
        lost = omega * (self.dashpot[:, None] * moved**2).sum(axis=0)
        elastic = self.omega > 0
        return lost + (2 * self.zeta[elastic, None] * bodies[elastic] * omega / self.omega[elastic, None]).sum(axis=0)


def _coupled(spec: StageSpec, gears: Sequence[_Gear], contacts: Sequence[Contact]) -> Linearised:
    """Both gears with their contacts, bearings and ports."""
    first, second = gears
    c = len(contacts)
    rows = sl.block_diag(first.rows, second.rows)
    residual = sl.block_diag(first.residual, second.residual)
    fold = np.zeros((c + 6, 2 * c + 6))  # a contact closes by what both gears do
    fold[:c, :c] = fold[:c, c + 3 : 2 * c + 3] = np.eye(c)
    fold[c : c + 3, c : c + 3] = fold[c + 3 :, 2 * c + 3 :] = np.eye(3)
    system = Linearised(
        mass=np.concatenate([first.mass, second.mass]),
        omega=np.concatenate([first.omega, second.omega]),
        zeta=np.concatenate([first.zeta, second.zeta]),
        rows=fold @ rows,
        residual=fold @ residual @ fold.T,
        own=np.concatenate([_tangents(spec, contacts), np.zeros(6)]),
        group=np.concatenate([np.zeros(c, int), np.tile([1, 1, 2], 2)]),
        dashpot=np.concatenate([_contact_dashpots(spec, c), np.zeros(6)]),
        tooth=np.concatenate([[contact.teeth[0] + 1000 for contact in contacts], np.full(6, -1)]),
    )
    return _held(spec, system, [first.mass[0], second.mass[0]], c)


def _tangents(spec: StageSpec, contacts: Sequence[Contact]) -> np.ndarray:
    """δ′ (m/N) of the local law of each contact at its force, both bodies (docs/theory.md eqs. 7 and 8)."""
    yields = [2 * (1 - g.material.poisson_ratio**2) / (math.pi * g.material.youngs_modulus) for g in spec.gears]
    strips = [math.log(4 * g.body.strip_half_width) - 1 for g in spec.gears]
    constant, length = float(np.dot(yields, strips)), min(g.face_width for g in spec.gears) / spec.contact.slices
    result = []
    for contact in contacts:
        radius = 1 / (1 / contact.rolls[0] + 1 / contact.rolls[1])
        half_width = math.sqrt(2 * sum(yields) * radius * contact.force / length)
        result.append((constant - sum(yields) * (math.log(max(half_width, LEAST_HALF_WIDTH)) + 0.5)) / length)
    return np.array(result)


def _contact_dashpots(spec: StageSpec, contacts: int) -> np.ndarray:
    length = min(gear.face_width for gear in spec.gears) / spec.contact.slices
    return np.full(contacts, spec.contact.damping * length)


def _held(spec: StageSpec, system: Linearised, masses: Sequence[float], contacts: int) -> Linearised:
    """The system with the flexibilities and dashpots of bearings and ports; rows of ports that hold nothing go."""
    own, dashpot, keep = system.own.copy(), system.dashpot.copy(), np.ones(len(system.own), bool)
    chains: list[tuple[int, PortSpec]] = []
    for index, gear in enumerate(spec.gears):
        at, port = contacts + 3 * index, spec.ports[gear.name]
        own[at : at + 2] = 1 / gear.bearing.stiffness
        dashpot[at : at + 2] = 2 * gear.bearing.damping_ratio * math.sqrt(gear.bearing.stiffness * masses[index])
        keep[at + 2] = port.kind != "torque"
        if port.chain is not None:
            own[at + 2], dashpot[at + 2] = 1 / port.chain.shaft_k, port.chain.shaft_c
            chains.append((at + 2, port))
        elif port.kind != "torque":
            own[at + 2], dashpot[at + 2] = 1 / FIXED_K, 0.0
            if port.kind == "spring":
                assert port.k is not None and port.c is not None
                own[at + 2], dashpot[at + 2] = 1 / port.k, port.c
    rows, mass = system.rows, system.mass
    for row, port in chains:
        assert port.chain is not None and port.k is not None and port.c is not None
        rows = np.hstack([rows, np.zeros((len(rows), 1))])
        rows[row, -1] = -1.0
        rows = np.vstack([rows, np.eye(rows.shape[1])[-1:]])
        mass = np.append(mass, port.chain.inertia + port.chain.disc_inertia)
        own, dashpot, keep = np.append(own, 1 / port.k), np.append(dashpot, port.c), np.append(keep, True)
    extra, more = len(own) - len(system.own), len(mass) - len(system.mass)
    residual = sl.block_diag(system.residual, np.zeros((extra, extra)))
    return Linearised(
        mass=mass,
        omega=np.append(system.omega, np.zeros(more)),
        zeta=np.append(system.zeta, np.zeros(more)),
        rows=rows[keep],
        own=own[keep],
        residual=residual[np.ix_(keep, keep)],
        group=np.append(system.group, np.full(extra, 2))[keep],
        dashpot=dashpot[keep],
        tooth=np.append(system.tooth, np.full(extra, -1))[keep],
    )
