"""Surfaces seen from an oblique direction: parallel projection, painter's order, colour by value."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize

from gearfmu.report.style import WIDTH, png, styled

ELEVATION, AZIMUTH = np.radians(24.0), np.radians(-18.0)
LIGHT = np.array([-0.35, 0.55, 0.76])


@dataclass(frozen=True)
class Shape:
    """A surface: points (P, 3) m, quads (Q, 4) with outward normals, value (P,) for the colour."""

    points: np.ndarray
    quads: np.ndarray
    value: np.ndarray


def draw(shapes: Sequence[Shape], label: str = "elastic displacement in µm") -> str:
    """The shapes in one picture, as an <img> element."""
    view = _view()
    corners = np.vstack([shape.points[shape.quads] for shape in shapes]) @ view.T
    values = np.concatenate([shape.value[shape.quads].mean(axis=1) for shape in shapes])
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    facing = normal[:, 2] > 0
    order = np.argsort(corners[facing][:, :, 2].mean(axis=1))
    with styled():
        return _painted(corners[facing][order][:, :, :2] * 1e3, values[facing][order], normal[facing][order], label)


def _painted(polygons: np.ndarray, values: np.ndarray, normals: np.ndarray, label: str) -> str:
    low, high = polygons.reshape(-1, 2).min(axis=0), polygons.reshape(-1, 2).max(axis=0)
    height = WIDTH * 0.9 * (high[1] - low[1]) / (high[0] - low[0])
    figure = matplotlib.figure.Figure(figsize=(WIDTH, height), layout="constrained")
    axis = figure.add_subplot()
    norm = Normalize(0, float(values.max()))
    colours = matplotlib.colormaps["cividis"](norm(values))
    colours[:, :3] *= (0.55 + 0.45 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1))[:, None]
    edges = colours.copy()
    edges[:, :3] *= 0.8
    axis.add_collection(PolyCollection(list(polygons), facecolors=colours, edgecolors=edges, linewidths=0.25))
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axis.axis("off")
    figure.colorbar(ScalarMappable(norm, "cividis"), ax=axis, label=label, shrink=0.6, aspect=30, pad=0.01)
    return png(figure)


def _view() -> np.ndarray:
    """Rows: right, up and towards the eye, of a camera above and left of the axis."""
    ce, se, ca, sa = np.cos(ELEVATION), np.sin(ELEVATION), np.cos(AZIMUTH), np.sin(AZIMUTH)
    tilt = np.array([[1, 0, 0], [0, ce, -se], [0, se, ce]])
    turn = np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])
    return tilt @ turn
