"""The pair on paper: static deflection of one tooth pair, free motion of a gear, tip corners, from spec, geometry and
reduced bodies alone, in numpy. No code of the kernel, no model of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.interpolate import BarycentricInterpolator
from scipy.optimize import brentq, minimize_scalar, root

from gearfmu.body import Body
from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.stagefile.forms.general import Stage

DRIVE = 0
RZ = 5
BORE = (0, 1, RZ)


@dataclass(frozen=True)
class Pair:
    """A spur pair with drive flanks in contact, both axes in their places; position p in pitches."""

    spec: Stage
    bodies: Sequence[Body]

    @property
    def geometry(self) -> PairGeometry:
        return self.spec.written.geometry

    @property
    def width(self) -> float:
        return min(gear.face_width for gear in self.spec.gears)

    def rolls(self, position: float) -> dict[int, tuple[float, float]]:
        """Rolls (m) on both gears of the tooth pairs whose flanks meet, by tooth number of the pinion."""
        pinion, wheel = self.geometry.gears
        found = {}
        for tooth in range(-3, 4):
            roll = pinion.r_b * (2 * math.pi * (position + tooth) / pinion.z + pinion.psi_b + self.geometry.alpha_wt)
            if roll <= pinion.s_tip and self.geometry.length - roll <= wheel.s_tip:
                found[tooth] = (roll, self.geometry.length - roll)
        return found

    def local_law(self, rolls: tuple[float, float]) -> tuple[float, float, float]:
        """a, c, β of δ(f) = f (c − ½ a ln βf), f in N per metre of width (theory, eqs. 7 and 8)."""
        yields = [
            2 * (1 - g.material.poisson_ratio**2) / (math.pi * g.material.youngs_modulus) for g in self.spec.gears
        ]
        c = sum(y * (math.log(4 * g.body.strip_half_width) - 1) for y, g in zip(yields, self.spec.gears, strict=True))
        return sum(yields), c, 2 * sum(yields) / (1 / rolls[0] + 1 / rolls[1])

    def secant(self, rolls: tuple[float, float]) -> float:
        """δ/f (m²/N) at torque_max carried by this pair alone."""
        a, c, beta = self.local_law(rolls)
        return c - 0.5 * a * math.log(beta * self.spec.written.torque_max / self.geometry.gears[0].r_b / self.width)

    def approach(self, rolls: tuple[float, float], load: np.ndarray, hertz: bool) -> np.ndarray:
        """δ (m) under the line load (N/m)."""
        a, c, beta = self.local_law(rolls)
        return load * (c - 0.5 * a * np.log(beta * load)) if hertz else load * self.secant(rolls)

    def compliance(self, rolls: tuple[float, float], slices: int, modes_only: bool = False) -> np.ndarray:
        """(slices, slices) m/N: te of the bore nodes under slice forces at one tooth of either gear, the bores held by
        torques and forces there. modes_only: what the stored modes alone give, Σ N Nᵀ/ω²."""
        total = np.zeros((slices, slices))
        for body, roll in zip(self.bodies, rolls, strict=True):
            weights = slice_weights(slices, body.flank.rows.shape[2])
            flank, cross, bore = (_modal if modes_only else _static)(body, roll)
            held = np.append(
                -_normal(body, roll), -body.flank.r_b
            )  # force x, y and moment at the bore per unit slice force
            side = weights @ cross @ held
            total += weights @ flank @ weights.T + side[:, None] + side[None, :] + held @ bore @ held
        return total

    def te(self, position: float, torque: float, hertz: bool = True, elastic: np.ndarray | None = None) -> float:
        """Transmission error (m) of a position with one pair in contact. elastic: from `compliance`; None: rigid."""
        (rolls,) = self.rolls(position).values()
        if elastic is None:
            load = torque / self.geometry.gears[0].r_b / self.width
            return float(self.approach(rolls, np.array([load]), hertz)[0])
        return self.spread(position, torque, elastic, hertz)[0]

    def spread(
        self, position: float, torque: float, elastic: np.ndarray, hertz: bool = True
    ) -> tuple[float, np.ndarray]:
        """te (m) and the share of every slice: all slices of the one pair close the same distance."""
        (rolls,) = self.rolls(position).values()
        force, count = torque / self.geometry.gears[0].r_b, len(elastic)

        def unbalanced(unknown: np.ndarray) -> np.ndarray:
            share = np.abs(unknown[1:])
            deflection = self.approach(rolls, share * force * count / self.width, hertz) + force * elastic @ share
            return np.append(unknown[0] - 1e5 * deflection, share.sum() - 1)

        found = root(unbalanced, np.append(1.0, np.full(count, 1 / count)))
        assert np.abs(unbalanced(found.x)).max() < 1e-9
        return 1e-5 * float(found.x[0]), found.x[1:]

    def touch_torque(self, rolls: tuple[float, float], gap: float) -> float:
        """Torque (N·m) at which one pair of rigid gears approaches by `gap` (m), by the load-dependent law."""
        load = brentq(lambda f: self.approach(rolls, np.array([f]), hertz=True)[0] - gap, 1.0, 1.5e6)
        return load * self.width * self.geometry.gears[0].r_b

    def corner(self, position: float, tooth: int, te: float = 0.0) -> tuple[float, float]:
        """Distance (m) of the pinion's tip edge from the wheel's involute, and the roll (m) there, by search along the
        involute; the pinion has turned by te (m) more."""
        pinion, wheel = self.geometry.gears
        beta = 2 * math.pi * (position + tooth) / pinion.z + te / pinion.r_b + pinion.psi_b
        turned = self.geometry.wheel_phase - 2 * math.pi * (position + tooth) / wheel.z + wheel.psi_b
        edge = self.spec.gears[0].tip_edge_radius
        centre = _on_tangent(pinion, beta, pinion.s_tip, pinion.s_tip - edge)
        axis = np.array([self.geometry.a, 0.0])

        def distance(roll: float) -> float:
            return float(np.hypot(*(axis + _on_tangent(wheel, turned, roll, roll) - centre)))

        found = minimize_scalar(distance, (1e-4, wheel.s_tip), bounds=(1e-4, wheel.s_tip), method="bounded",
                                options={"xatol": 1e-12})  # fmt: skip
        return found.fun - edge, float(found.x)

    def corner_approach(self, beyond: float, roll: float, load: float) -> float:
        """δ (m) of the pinion's tip edge on the wheel's involute at `roll` under the line load (N/m), the pinion's roll
        `beyond` (m) the end of its flank: over the half-width of the load strip the curvature of the edge takes the
        place of the flank's (theory, 2.3)."""
        share = min(beyond / self.spec.gears[0].body.strip_half_width, 1.0)
        share *= share * (3 - 2 * share)
        own = (1 - share) / self.geometry.gears[0].s_tip + share / self.spec.gears[0].tip_edge_radius
        a, c, _ = self.local_law((1.0, 1.0))
        return load * (c - 0.5 * a * math.log(2 * a * load / (own + 1 / roll)))


def _on_tangent(gear: GearGeometry, beta: float, roll: float, along: float) -> np.ndarray:
    """Point `along` the base tangent that touches the flank with base angle β at `roll`."""
    t = beta - roll / gear.r_b
    return gear.r_b * np.array([math.cos(t), math.sin(t)]) + along * np.array([-math.sin(t), math.cos(t)])


def slice_weights(slices: int, functions: int) -> np.ndarray:
    """(slices, functions): (2a + 1) × mean of P_a over each slice of the face width."""
    edges = np.linspace(-1, 1, slices + 1)
    weights = np.empty((slices, functions))
    for a in range(functions):
        antiderivative = legendre.legint(np.eye(functions)[a])
        weights[:, a] = (2 * a + 1) * np.diff(legendre.legval(edges, antiderivative)) / np.diff(edges)
    return weights


def _at(body: Body, roll: float, values: np.ndarray) -> np.ndarray:
    """`values` (R, …) given at the body's Chebyshev rolls, at this roll."""
    return np.asarray(BarycentricInterpolator(body.flank.roll, values)(roll))


def _normal(body: Body, roll: float) -> np.ndarray:
    """Outward normal (x, y) of the drive flank of tooth 0."""
    t = body.flank.psi_b - roll / body.flank.r_b
    return np.array([-math.sin(t), math.cos(t)])


def _static(body: Body, roll: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, A) of a tooth's drive flank with itself, (A, 3) with the bore's x, y and rotation, (3, 3) of the bore, per N
    and N·m."""
    flank = _at(body, roll, _at(body, roll, body.flank.static[DRIVE, DRIVE, 0]))
    return flank, _at(body, roll, body.flank.node[DRIVE][:, :, BORE]), body.static[np.ix_(BORE, BORE)]


def _modal(body: Body, roll: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = _at(body, roll, body.flank.rows[DRIVE]) / (2 * math.pi * body.frequency)
    bore = body.rows[list(BORE)] / (2 * math.pi * body.frequency)
    return rows @ rows.T, rows @ bore.T, bore @ bore.T


def bore_angle(body: Body, time: np.ndarray, cut: float, damped: bool) -> np.ndarray:
    """Angle (rad) of the bore node of a free gear under a unit torque there from t = 0 on: rigid body, static share of
    the modes above `cut` (Hz), and every mode below it."""
    omega, zeta = 2 * math.pi * body.frequency, body.damping_ratio * damped
    flexible = (body.rows[RZ] / omega) ** 2
    dynamic = body.frequency < cut
    angle = 0.5 * time**2 / body.inertia[2, 2] + body.static[RZ, RZ] - flexible[dynamic].sum()
    for k in np.flatnonzero(dynamic & (flexible > 0)):
        root_ = math.sqrt(1 - zeta[k] ** 2)
        phase = omega[k] * root_ * time
        decay = np.exp(-zeta[k] * omega[k] * time)
        angle = angle + flexible[k] * (1 - decay * (np.cos(phase) + zeta[k] / root_ * np.sin(phase)))
    return angle
