"""Involute flanks found on the surface of an external spur gear made elsewhere.

The outward normal of an involute touches the base circle: for a point x with normal n in the transverse plane
x × n = sg r_b on every flank of side sg, and with s = x · n its base angle is β = φ + 2πk/z + sg ψ_b (tooth k). So
faces of the flanks show themselves, tooth and side included; the fit then moves r_b, ψ_b, φ and the axis until the
points lie on the involutes, in the mean square of the distance along the normal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from gearfmu.geometry import involute
from gearfmu.geometry.plane import about_z

_NEAR = 0.03  # share of r_b by which the normal of a flank face may miss the base circle
_ASIDE = 0.3  # share of ψ_b by which the base angle of a flank face may miss those of its side
_STEEP = 0.1  # largest axial component of a flank's normal


class FitError(ValueError):
    """No involute flanks, or too few, among the faces."""


@dataclass(frozen=True)
class FlankPoints:
    """Points (P, 3) m with the tooth number (P,) and side (P,), +1 or −1, of the flank they lie on."""

    points: np.ndarray
    tooth: np.ndarray
    side: np.ndarray

    def of(self, chosen: np.ndarray) -> FlankPoints:
        """Those where `chosen` is true."""
        return FlankPoints(self.points[chosen], self.tooth[chosen], self.side[chosen])


@dataclass(frozen=True)
class InvoluteFit:
    """The gear whose involutes fit best.

    r_b, psi_b : base radius (m) and half tooth-thickness angle at the base circle. phase : angle of the middle of tooth
    0, in (−π/z, π/z]. origin (3,), direction (3,) : a point of the axis (m), near z = 0, and its unit vector, both in
    the frame of the points. residual : (P,) m, distance of the points from their involutes, positive outside the tooth.
    """

    teeth: int
    r_b: float
    psi_b: float
    phase: float
    origin: np.ndarray
    direction: np.ndarray
    residual: np.ndarray

    @property
    def rms(self) -> float:
        """Root mean square of the residual (m)."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def worst(self) -> float:
        """Largest residual (m)."""
        return float(np.abs(self.residual).max())

    def in_gear_frame(self, points: np.ndarray) -> np.ndarray:
        """Points (…, 3) in the frame of the gear: axis +z, tooth 0 on +x, the origin's height kept."""
        return (points - self.origin) @ self.turn().T

    def turn(self) -> np.ndarray:
        """(3, 3) rotation into the frame of the gear."""
        return about_z(-self.phase) @ _tilt(self.direction)


def flank_faces(centres: np.ndarray, normals: np.ndarray, teeth: int, r_b: float | None = None) -> FlankPoints:
    """Which faces lie on a flank, and on which one: centres (F, 3) m, outward unit normals (F, 3).

    Faces of no flank get side 0. r_b : m, known base radius; else the radius that most of the steep faces share.
    Raises FitError when there are none.
    """
    moment = centres[:, 0] * normals[:, 1] - centres[:, 1] * normals[:, 0]
    steep = np.abs(normals[:, 2]) < _STEEP
    if r_b is None:
        r_b = _most_common(np.abs(moment[steep]))
    candidate = steep & (np.abs(np.abs(moment) - r_b) < _NEAR * r_b)
    if candidate.sum() < 4:
        raise FitError(f"no face has a normal that touches a base circle of {1e3 * r_b:.4g} mm")
    side = np.where(candidate, np.sign(moment), 0.0)
    t = np.arctan2(-normals[:, 0] * side, normals[:, 1] * side)
    roll = np.einsum("fc,fc->f", centres[:, :2], normals[:, :2])
    beta = t + side * roll / r_b
    pitch = 2 * np.pi / teeth
    places = [np.angle(np.exp(1j * teeth * beta[side == sg]).mean()) / teeth for sg in (1, -1) if (side == sg).any()]
    if len(places) < 2:
        raise FitError("only one side of the teeth is there: the fit needs both flanks")
    half = 0.5 * ((places[0] - places[1]) % pitch)
    middle = places[0] - half
    number = np.round((beta - side * half - middle) / pitch)
    miss = beta - side * half - middle - pitch * number
    side = np.where(np.abs(miss) < _ASIDE * half, side, 0.0)
    return FlankPoints(centres, (number % teeth).astype(int), side.astype(int))


def fit_involute(given: FlankPoints, teeth: int, r_b: float) -> InvoluteFit:
    """The best involutes through the points; r_b (m) to begin with. Raises FitError: points of fewer than one tooth."""
    points, side = given.points, given.side
    if min((side == 1).sum(), (side == -1).sum()) < 6:
        raise FitError("fewer than six points on one of the flanks")
    scale = float(np.hypot(points[:, 0], points[:, 1]).max())
    pitch = 2 * np.pi / teeth
    few = len(np.unique(given.tooth)) < 3
    free = 3 if few else 7
    width = np.ptp(points[:, 2])
    start = np.zeros(7)
    start[0] = r_b / scale

    def residual(x: np.ndarray) -> np.ndarray:
        base, half, phase = x[0] * scale, x[1], x[2]
        moved = np.zeros(4) if few else x[3:]
        local = (points - np.array([moved[0] * scale, moved[1] * scale, 0.0])) @ _tilt(_axis(moved[2:])).T
        radius = np.maximum(np.hypot(local[:, 0], local[:, 1]), base * (1 + 1e-12))
        beta = np.arctan2(local[:, 1], local[:, 0]) + side * involute.inv(np.arccos(base / radius))
        miss = beta - pitch * given.tooth - phase - side * half
        return side * base * (np.mod(miss + np.pi, 2 * np.pi) - np.pi) / scale

    start[1:3] = _first_angles(residual, start, side, scale, r_b)
    found = least_squares(lambda x: residual(np.concatenate([x, start[free:]])), start[:free], x_scale="jac",
                          xtol=1e-15, ftol=1e-15, gtol=1e-15)  # fmt: skip
    x = np.concatenate([found.x, start[free:]])
    phase = float(np.mod(x[2] + 0.5 * pitch, pitch) - 0.5 * pitch)
    middle = float(0.5 * (points[:, 2].min() + points[:, 2].max())) if width > 0 else 0.0
    direction = _axis(x[5:])
    origin = np.array([x[3] * scale, x[4] * scale, 0.0]) + direction / direction[2] * middle
    return InvoluteFit(teeth, float(x[0] * scale), float(x[1]), phase, origin, direction, found.fun * scale)


def _first_angles(
    residual: Callable[[np.ndarray], np.ndarray], start: np.ndarray, side: np.ndarray, scale: float, r_b: float
) -> tuple[float, float]:
    """ψ_b and φ that centre both sides at the first base radius."""
    miss = residual(start) * scale / r_b * side
    mean = {sg: float(np.angle(np.exp(1j * miss[side == sg]).mean())) for sg in (1, -1)}
    return 0.5 * (mean[1] - mean[-1]), 0.5 * (mean[1] + mean[-1])


def _most_common(values: np.ndarray) -> float:
    """The value that most of these lie near: middle of the fullest window of ± 1.5 %, zero and its surroundings left
    out (tip and root lands, bore)."""
    values = np.sort(values[values > 0.2 * values.max(initial=0.0)])
    if len(values) == 0:
        raise FitError("no face has the direction of a flank: is the gear's axis z?")
    last = np.searchsorted(values, 1.03 * values, side="right")
    first = int(np.argmax(last - np.arange(len(values))))
    return float(np.median(values[first : last[first]]))


def _axis(tilt: np.ndarray) -> np.ndarray:
    direction = np.array([tilt[0], tilt[1], 1.0])
    return direction / np.linalg.norm(direction)


def _tilt(direction: np.ndarray) -> np.ndarray:
    """The smallest rotation that brings `direction` to +z (Rodrigues)."""
    x, y, z = direction
    factor = 1 / (1 + z)
    return np.array([[1 - x * x * factor, -x * y * factor, -x], [-x * y * factor, 1 - y * y * factor, -y], [x, y, z]])
