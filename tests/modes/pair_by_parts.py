"""A spur pair in loaded contact put together from spec, geometry and reduced bodies in numpy: equation (29) with rows
of bearings, gears in their unloaded places. Of the kernel it takes the contact forces alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
from numpy.polynomial.legendre import Legendre

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.teeth import excited_modes, resampling
from gearfmu.stagefile.forms.general import Stage

DRIVE, BORE = 0, (0, 1, 5)  # flank; directions of the bore: x, y and spin
LEAST_HALF_WIDTH = 5e-6  # m: below it the local law is a parabola (docs/theory.md 2.4), not known here


@dataclass(frozen=True)
class Contact:
    """A loaded slice: tooth numbers of pinion and wheel, its number across the width, rolls (m) on both gears, force
    (N)."""

    teeth: tuple[int, int]
    slice: int
    rolls: tuple[float, float]
    force: float


def loaded_contacts(spec: Stage, kernel: Kernel, torque: float, position: float) -> list[Contact]:
    """The slices that carry load at a position, wheel held, by the static contact routine."""
    pair = spec.written.geometry
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
class Gear:
    """One gear's part of (29). mass (n,) of its unknowns x, y, φ, modes; omega (n,) rad/s, 0 for the rigid ones; rows
    (c + 3, n): contacts, then the bore's x, y, φ; residual (c + 3, c + 3) m/N."""

    mass: np.ndarray
    omega: np.ndarray
    rows: np.ndarray
    residual: np.ndarray


def gear_at(spec: Stage, bodies: Sequence[Body], index: int, position: float, contacts: Sequence[Contact]) -> Gear:
    pair, body = spec.written.geometry, bodies[index]
    shape, side = pair.gears[index], (1.0, -1.0)[index]
    degrees = np.arange(0, min(b.flank.width_functions for b in bodies), 2)
    chosen = excited_modes(body, degrees, even=True)
    angle = (0.0, pair.wheel_phase)[index] + side * 2 * math.pi * position / shape.z
    direction = math.pi / 2 - pair.alpha_wt - angle  # of the line of action in the body's frame
    rigid = np.array([side * math.cos(direction), side * math.sin(direction), shape.r_b])
    weights = slice_weights(spec.written.contact.slices, degrees)
    places = [(c.teeth[index], resampling(body.flank.roll, c.rolls[index], c.rolls[index], 1)[0]) for c in contacts]
    flank = [
        on_tooth(np.einsum("r,a,ran->n", place, weights[c.slice], body.flank.rows[DRIVE][:, degrees][..., chosen]),
                  body, chosen, tooth)
        for (tooth, place), c in zip(places, contacts, strict=True)
    ]  # fmt: skip
    modal = np.vstack([*flank, body.rows[np.ix_(np.array(BORE), chosen)]])
    rows = np.hstack([np.vstack([np.tile(rigid, (len(contacts), 1)), np.eye(3)]), modal])
    omega = 2 * np.pi * body.frequency[chosen]
    static = static_of(body, degrees, places, weights[[c.slice for c in contacts]])
    return Gear(
        mass=np.concatenate([[body.total_mass, body.total_mass, body.inertia[2, 2]], np.ones(len(chosen))]),
        omega=np.concatenate([np.zeros(3), omega]),
        rows=rows,
        residual=static - (modal / omega) @ (modal / omega).T,
    )


def slice_weights(slices: int, degrees: np.ndarray) -> np.ndarray:
    """(slices, A): (2a + 1) × mean of P_a over each slice of the face width, for loading and reading."""
    return weights_between(np.linspace(-1, 1, slices + 1), degrees)


def weights_between(edges: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """The same between ascending `edges` on −1 … 1."""
    columns = []
    for a in degrees:
        integral = Legendre.basis(int(a)).integ()(edges)
        columns.append((2 * a + 1) * np.diff(integral) / np.diff(edges))
    return np.stack(columns, axis=1)


def on_tooth(row: np.ndarray, body: Body, chosen: np.ndarray, tooth: int) -> np.ndarray:
    """Row (n,) of tooth 0 on another tooth (docs/theory.md eq. 3)."""
    theta = 2 * np.pi * body.flank.diameter[chosen] * tooth / body.flank.teeth
    first, second = np.flatnonzero(body.flank.part[chosen] == 1), np.flatnonzero(body.flank.part[chosen] == 2)
    result = row * np.cos(theta)
    result[first] -= row[second] * np.sin(theta[first])
    result[second] += row[first] * np.sin(theta[first])
    return result


def static_of(
    body: Body, degrees: np.ndarray, places: Sequence[tuple[int, np.ndarray]], weights: np.ndarray
) -> np.ndarray:
    """C_static (c + 3, c + 3) of contacts at `places` (tooth, weights of the roll points) and of the bore."""
    count = len(places)
    total = np.zeros((count + 3, count + 3))
    bore = np.ix_(BORE, BORE)
    total[count:, count:] = body.static[bore]
    for i, (tooth, place) in enumerate(places):
        for j, (other, there) in enumerate(places):
            block = body.flank.static[DRIVE, DRIVE, other - tooth][..., degrees, :][..., degrees]
            total[i, j] = np.einsum("r,s,a,b,rsab->", place, there, weights[i], weights[j], block)
        x, y, turn = np.einsum("r,a,rak->k", place, weights[i], body.flank.node[DRIVE][:, degrees])[list(BORE)]
        theta = 2 * np.pi * tooth / body.flank.teeth
        c, s = math.cos(theta), math.sin(theta)
        total[i, count:] = total[count:, i] = [c * x - s * y, s * x + c * y, turn]
    return total


@dataclass(frozen=True)
class Parts:
    """Equation (29). mass (n,), omega (n,); rows R (m, n): contacts, then of each gear the bore's x, y and angle; own D
    (m,) m/N, residual C_res (m, m)."""

    mass: np.ndarray
    omega: np.ndarray
    rows: np.ndarray
    own: np.ndarray
    residual: np.ndarray

    @property
    def stiffness(self) -> np.ndarray:
        """(n, n), N/m."""
        coupling = self.rows.T @ np.linalg.solve(np.diag(self.own) + self.residual, self.rows)
        return np.diag(self.mass * self.omega**2) + 0.5 * (coupling + coupling.T)

    def frequencies(self) -> np.ndarray:
        """(n,) Hz."""
        scale = 1 / np.sqrt(self.mass)
        squared = sl.eigh(scale[:, None] * self.stiffness * scale, eigvals_only=True)
        return np.sqrt(np.maximum(squared, 0)) / (2 * math.pi)


def couple(spec: Stage, gears: Sequence[Gear], contacts: Sequence[Contact], held: bool = False) -> Parts:
    """Both gears with their contacts, bearings (rigid when held) and ports, which are springs."""
    first, second = gears
    c = len(contacts)
    rows = sl.block_diag(first.rows, second.rows)
    residual = sl.block_diag(first.residual, second.residual)
    fold = np.zeros((c + 6, 2 * c + 6))  # a contact closes by what both gears do
    fold[:c, :c] = fold[:c, c + 3 : 2 * c + 3] = np.eye(c)
    fold[c : c + 3, c : c + 3] = fold[c + 3 :, 2 * c + 3 :] = np.eye(3)
    springs = []
    for gear in spec.written.gears:
        k = spec.ports[gear.name].k
        assert k is not None and spec.ports[gear.name].chain is None
        springs += [*[0.0 if held else 1 / gear.bearing.stiffness] * 2, 1 / k]
    return Parts(
        mass=np.concatenate([first.mass, second.mass]),
        omega=np.concatenate([first.omega, second.omega]),
        rows=fold @ rows,
        residual=fold @ residual @ fold.T,
        own=np.concatenate([tangents(spec, contacts), springs]),
    )


def tangents(spec: Stage, contacts: Sequence[Contact]) -> np.ndarray:
    """δ′ (m/N) of the local law of each contact at its force, both bodies (docs/theory.md eqs. 7 and 8)."""
    yields = [2 * (1 - g.material.poisson_ratio**2) / (math.pi * g.material.youngs_modulus) for g in spec.gears]
    strips = [math.log(4 * g.body.strip_half_width) - 1 for g in spec.gears]
    constant, length = (
        float(np.dot(yields, strips)),
        min(g.face_width for g in spec.gears) / spec.written.contact.slices,
    )
    result = []
    for contact in contacts:
        radius = 1 / (1 / contact.rolls[0] + 1 / contact.rolls[1])
        half_width = math.sqrt(2 * sum(yields) * radius * contact.force / length)
        result.append((constant - sum(yields) * (math.log(max(half_width, LEAST_HALF_WIDTH)) + 0.5)) / length)
    return np.array(result)
