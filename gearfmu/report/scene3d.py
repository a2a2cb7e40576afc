"""Surfaces seen in parallel projection: painter's order, colour by value, light from above left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from gearfmu.report.style import WIDTH, png, styled

ELEVATION, AZIMUTH = np.radians(17.0), np.radians(-13.0)
LIGHT = np.array([-0.4, 0.6, 0.7]) / np.linalg.norm([-0.4, 0.6, 0.7])
STEEL = LinearSegmentedColormap.from_list("steel", ["#d6dce3", "#a3bfd8", "#4f88b8", "#e2a63e", "#bb3a26"])


@dataclass(frozen=True)
class Shape:
    """A surface: points (P, 3) m, quads (Q, 4) with outward normals, value (P,) for the colour."""

    points: np.ndarray
    quads: np.ndarray
    value: np.ndarray


def draw(shapes: Sequence[Shape], centre: np.ndarray, radius: float, label: str) -> str:
    """The shapes obliquely as a whole, and beside it along the axis within `radius` (m) of `centre` (3,); an <img>
    element."""
    norm = Normalize(0, max(float(shape.value.max()) for shape in shapes))
    with styled():
        figure = Figure(figsize=(WIDTH, 0.4 * WIDTH), layout="constrained")
        whole, detail = figure.subplots(1, 2, width_ratios=(1.55, 1))
        _paint(whole, shapes, camera(), norm, 0.15)
        _paint(detail, shapes, np.eye(3), norm, 0.35)
        detail.set(xlim=(centre[0] - radius, centre[0] + radius), ylim=(centre[1] - radius, centre[1] + radius))
        figure.colorbar(ScalarMappable(norm, STEEL), ax=[whole, detail], label=label, shrink=0.7, aspect=26, pad=0.01)
        return png(figure)


def _paint(axis: Axes, shapes: Sequence[Shape], view: np.ndarray, norm: Normalize, line: float) -> None:
    corners = np.vstack([shape.points[shape.quads] for shape in shapes]) @ view.T
    values = np.concatenate([shape.value[shape.quads].mean(axis=1) for shape in shapes])
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    facing = np.flatnonzero(normal[:, 2] > 1e-6)
    order = facing[np.argsort(corners[facing, :, 2].mean(axis=1))]
    colours = _shaded(STEEL, norm(values[order]), normal[order] @ view)
    edges = colours.copy()
    edges[:, :3] *= 0.82
    polygons = corners[order][:, :, :2]
    axis.add_collection(PolyCollection(list(polygons), facecolors=colours, edgecolors=edges, linewidths=line))
    axis.set(
        xlim=(polygons[..., 0].min(), polygons[..., 0].max()),
        ylim=(polygons[..., 1].min(), polygons[..., 1].max()),
        aspect="equal",
    )
    axis.axis("off")


def _shaded(colormap: Colormap, values: np.ndarray, normals: np.ndarray) -> np.ndarray:
    colours = matplotlib.colormaps.get_cmap(colormap)(values)
    colours[:, :3] *= (0.62 + 0.38 * np.clip(normals @ LIGHT, 0, 1))[:, None] / (0.62 + 0.38 * LIGHT[2])
    return np.clip(colours, 0, 1)


def camera(elevation: float = ELEVATION, azimuth: float = AZIMUTH) -> np.ndarray:
    """Rows: right, up and towards the eye, of a camera above and left of the axis (rad)."""
    ce, se, ca, sa = np.cos(elevation), np.sin(elevation), np.cos(azimuth), np.sin(azimuth)
    tilt = np.array([[1, 0, 0], [0, ce, -se], [0, se, ce]])
    turn = np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])
    return tilt @ turn
