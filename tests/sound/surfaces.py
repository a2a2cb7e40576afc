"""Closed skins for the tests of sound, and the exact radiation of a sphere."""

from __future__ import annotations

import numpy as np
from scipy.special import spherical_jn, spherical_yn

RHO_C, SPEED = 1.204 * 343.2, 343.2


def box(size: tuple[float, ...], counts: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Points and quadrilaterals of a box about the origin, counts of them along each side."""
    points: dict[tuple[int, ...], int] = {}
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, counts[axis]):
            for i, j in np.ndindex(counts[u], counts[v]):
                face = []
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    at = [side] * 3
                    at[u], at[v] = i + a, j + b
                    face.append(points.setdefault(tuple(at), len(points)))
                faces.append(face if side else face[::-1])
    return (np.array(list(points)) / counts - 0.5) * size, np.array(faces)


def sphere(count: int, radius: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A cube of count² quadrilaterals a side, blown up to a sphere; scaled so that its volume is the sphere's."""
    points, faces = box((1.0, 1.0, 1.0), (count,) * 3)
    points = np.tan(0.5 * np.pi * points)
    points /= np.linalg.norm(points, axis=1)[:, None]
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    volume = np.linalg.det(points[triangles]).sum() / 6
    return radius * points * (4 / 3 * np.pi / volume) ** (1 / 3), faces


def rigid(points: np.ndarray) -> np.ndarray:
    """(P, 3, 6): shapes of rigid motion about the origin."""
    found = np.zeros((len(points), 3, 6))
    for axis, unit in enumerate(np.eye(3)):
        found[:, axis, axis] = 1.0
        found[:, :, 3 + axis] = np.cross(unit, points)
    return found


def efficiency(order: int, ka: np.ndarray) -> np.ndarray:
    """Radiation efficiency of a sphere whose normal velocity is a spherical harmonic: Re(−i h/h′), h of the second
    kind."""
    h = spherical_jn(order, ka) - 1j * spherical_yn(order, ka)
    slope = spherical_jn(order, ka, True) - 1j * spherical_yn(order, ka, True)
    return np.real(-1j * h / slope)


def source(points: np.ndarray, at: tuple[float, ...], frequency: float) -> np.ndarray:
    """(P, 3, 2): real and imaginary part of the velocity in the field of a point source, p = ρc e^{−ikr}/r Pa. It
    radiates ½ 4π ρc W through any surface around it."""
    k, away = 2 * np.pi * frequency / SPEED, points - np.asarray(at)
    r = np.linalg.norm(away, axis=1)[:, None]
    velocity = np.exp(-1j * k * r) * (1 + 1j * k * r) / (1j * k * r**3) * away
    return np.stack([velocity.real, velocity.imag], axis=2)
