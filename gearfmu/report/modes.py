"""Mode pictures: the deformed surface coloured by its displacement, the undeformed edges, and nodal lines along the
axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from gearfmu.fem.surface import shape as face_shape
from gearfmu.modes import BodyModes, Mode
from gearfmu.modes.shapes import cylindrical
from gearfmu.report.style import INK, MUTED, styled, written

SHARP = np.cos(np.radians(40.0))  # edges between faces that turn by more are drawn
_BRIGHT = np.linspace(0.06, 0.93, 256)  # of turbo, without its dark ends
MAGNITUDE = LinearSegmentedColormap.from_list("bright turbo", colormaps["turbo"](_BRIGHT))
SIGNED = colormaps["RdBu_r"]
LARGEST, MOST_PIECES = 0.012, 6  # sides of drawn quadrilaterals, parts of the body's diameter
AMBIENT = 0.66
DEPTH_CELL = 0.015
ELEVATION, AZIMUTH = np.radians(38.0), np.radians(-24.0)
LIGHT = np.array([-0.45, 0.55, 0.7]) / np.linalg.norm([-0.45, 0.55, 0.7])
OBLIQUE, ALONG_AXIS = 0, 1
SHEET = 12


@dataclass(frozen=True)
class _Surface:
    """What is drawn of a body: quadrilaterals (Q, 4) of points interpolated from the body's, sample (p, P); and sharp
    edges (E, 3) of its own points: start, middle, end."""

    sample: sp.csr_array
    quads: np.ndarray
    edges: np.ndarray


def write_mode_picture(body: BodyModes, mode: Mode, path: Path) -> None:
    """One mode: obliquely by the size of its displacement, and along the axis by its main component with sign."""
    with styled():
        figure = Figure(figsize=(9.6, 4.7), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.12, 1))
        surface = _surface(body)
        _paint(left, body, surface, mode, OBLIQUE)
        _paint(right, body, surface, mode, ALONG_AXIS)
        left.set_title("displacement, parts of the largest", loc="left", color=MUTED)
        right.set_title(f"{_component(mode)[1]} displacement, seen along the axis", loc="left", color=MUTED)
        for axis, norm, colours in ((left, Normalize(0, 1), MAGNITUDE), (right, Normalize(-1, 1), SIGNED)):
            bar = figure.colorbar(ScalarMappable(norm, colours), ax=axis, shrink=0.6, aspect=26, pad=0.01)
            bar.outline.set_visible(False)
        figure.suptitle(f"{body.name}, {heading(mode)}", x=0.012, ha="left", color=INK, fontsize=12)
        written(figure, path)


def write_contact_sheet(body: BodyModes, path: Path) -> None:
    """The first twelve frequencies of a body on one page."""
    modes = body.modes[:SHEET]
    columns = min(4, len(modes))
    rows = -(-len(modes) // columns)
    with styled():
        figure = Figure(figsize=(3.0 * columns, 2.75 * rows + 0.4), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        surface = _surface(body)
        for axis, mode in zip(axes, modes, strict=False):
            _paint(axis, body, surface, mode, OBLIQUE)
            axis.set_title(heading(mode, short=True), loc="left", fontsize=9, color=INK)
        for axis in axes[len(modes) :]:
            axis.axis("off")
        figure.suptitle(f"{body.name}: the lowest {len(modes)} frequencies", x=0.012, ha="left", color=INK, fontsize=12)
        written(figure, path, 130)


def heading(mode: Mode, short: bool = False) -> str:
    """A mode in one line: its numbers, frequency, nodal diameters and name."""
    numbers = "–".join(str(number) for number in (mode.numbers[0], mode.numbers[-1])[: len(mode.numbers)])
    nu = mode.nodal_diameter
    diameters = f"ν = {nu}" if short else f"{nu} nodal diameter{'' if nu == 1 else 's'}"
    share = "" if mode.harmonic_share > 0.995 else f" ({100 * mode.harmonic_share:.0f} %)"
    frequency = f"{mode.frequency:.0f} Hz" if short else f"{mode.frequency:.1f} Hz"
    name = mode.name if short else f"{mode.motion} ({mode.name})"
    separator = "\n" if short else ", "
    word = "mode" if len(mode.numbers) == 1 else "modes"
    return f"{word} {numbers}: {frequency}{separator}{diameters}{share}, {name}"


def _component(mode: Mode) -> tuple[int, str]:
    """The cylindrical component with most energy: its number and name."""
    number = int(np.argmax(mode.energy))
    return number, ("radial", "tangential", "axial")[number]


def _paint(axis: Axes, body: BodyModes, surface: _Surface, mode: Mode, view: int) -> None:
    moved, rest = surface.sample @ body.drawn(mode)[0], surface.sample @ body.points
    axes = np.eye(3) if view == ALONG_AXIS else _camera(ELEVATION, AZIMUTH)
    drawn, normal = (rest + moved) @ axes.T, _normals((rest + moved) @ axes.T, surface.quads)
    value = np.linalg.norm(moved, axis=1)
    value = cylindrical(rest, moved)[:, _component(mode)[0]] if view == ALONG_AXIS else value
    value = (value / np.abs(value).max())[surface.quads].mean(axis=1)
    colours = SIGNED(Normalize(-1, 1)(value)) if view == ALONG_AXIS else MAGNITUDE(value)
    colours[:, :3] *= (AMBIENT + (1 - AMBIENT) * np.clip(normal @ LIGHT, 0, 1))[:, None]
    facing = np.flatnonzero(normal[:, 2] > 0)
    order = facing[np.argsort(drawn[surface.quads[facing], 2].mean(axis=1))]
    polygons, colours = list(drawn[surface.quads[order], :2]), np.clip(colours[order], 0, 1)
    axis.add_collection(PolyCollection(polygons, facecolors=colours, edgecolors=colours, linewidths=0.3))
    _outline(axis, body.points @ axes.T, rest @ axes.T, surface)
    margin, seen = np.linalg.norm(moved, axis=1).max(), (rest @ axes.T)[:, :2]
    low, high = seen.min(axis=0) - margin, seen.max(axis=0) + margin  # the same frame for every mode of a body
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axis.axis("off")


def _outline(axis: Axes, points: np.ndarray, rest: np.ndarray, surface: _Surface) -> None:
    """The sharp edges that nothing of the undeformed body hides, by the depth of its surface on a coarse grid."""
    cell = DEPTH_CELL * np.ptp(rest[:, :2])
    low = rest[:, :2].min(axis=0)
    centres = rest[surface.quads].mean(axis=1)
    place, middle = (((p[:, :2] - low) / cell).astype(int) for p in (centres, points[surface.edges[:, 1]]))
    depth = np.full(place.max(axis=0) + 2, -np.inf)
    np.maximum.at(depth, tuple(place.T), centres[:, 2])
    seen = points[surface.edges[:, 1], 2] > depth[tuple(middle.T)] - 4 * cell
    axis.add_collection(LineCollection(list(points[surface.edges[seen], :2]), colors=INK, linewidths=0.55, alpha=0.5))


@lru_cache(maxsize=1)
def _surface(body: BodyModes) -> _Surface:
    """Faces are divided until their sides are below `LARGEST` of the body's diameter."""
    corners = body.points[body.faces[:, :4]]
    longest = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    pieces = np.clip(np.ceil(longest / (LARGEST * np.ptp(body.points[:, :2]))), 1, MOST_PIECES).astype(int)
    samples, quads, first = [], [], 0
    for n in np.unique(pieces):
        faces = np.flatnonzero(pieces == n)
        sample, grid = _divided(body.faces[faces], len(body.points), n)
        samples.append(sample)
        quads.append(first + grid)
        first += sample.shape[0]
    return _Surface(sp.csr_array(sp.vstack(samples)), np.concatenate(quads), _sharp_edges(body))


def _sharp_edges(body: BodyModes) -> np.ndarray:
    """Edges (E, 3) at which the surface turns by more than `SHARP` allows."""
    quads = body.faces[:, :4]
    ends = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    face = np.repeat(np.arange(len(quads)), 4)
    order = np.lexsort(ends.T)
    first, second = order[0::2], order[1::2]
    assert np.array_equal(ends[first], ends[second]), "every edge of a closed surface lies between two faces"
    normal = _normals(body.points, quads)
    sharp = np.einsum("ij,ij->i", normal[face[first]], normal[face[second]]) < SHARP
    return np.column_stack([ends[:, 0], body.faces[:, 4:].ravel(), ends[:, 1]])[first[sharp]]


def _divided(faces: np.ndarray, points: int, n: int) -> tuple[sp.csr_array, np.ndarray]:
    """Every face (F, 8) as n × n quadrilaterals of points of its own: interpolation (F (n + 1)², points) and corner
    numbers (F n², 4)."""
    line = np.linspace(-1, 1, n + 1)
    y, x = np.meshgrid(line, line, indexing="ij")
    weights = face_shape(np.stack([x.ravel(), y.ravel()], axis=1))
    rows = np.arange(len(faces) * len(weights)).reshape(len(faces), -1, 1)
    values = np.broadcast_to(weights, (len(faces), *weights.shape))
    columns = np.broadcast_to(faces[:, None, :], values.shape)
    rows = np.broadcast_to(rows, values.shape)
    sample = sp.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), (len(faces) * len(weights), points))
    number = np.arange(len(weights)).reshape(n + 1, n + 1)
    cell = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    quads = cell + len(weights) * np.arange(len(faces))[:, None, None]
    return sp.csr_array(sample), quads.reshape(-1, 4)


def _normals(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    corners = points[quads]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)


def mode_columns(modes: Sequence[Mode]) -> dict[str, np.ndarray]:
    """Columns of the table of modes, one row a frequency."""
    energy = np.array([mode.energy for mode in modes]).reshape(-1, 3)
    return {
        "mode": np.array([mode.numbers[0] for mode in modes]),
        "modes_of_this_frequency": np.array([len(mode.numbers) for mode in modes]),
        "frequency_Hz": np.array([mode.frequency for mode in modes]),
        "damping_ratio": np.array([mode.damping_ratio for mode in modes]),
        "nodal_diameter": np.array([mode.nodal_diameter for mode in modes]),
        "nodal_diameter_share": np.array([mode.harmonic_share for mode in modes]),
        "parity": np.array([mode.parity for mode in modes]),
        "radial_share": energy[:, 0],
        "tangential_share": energy[:, 1],
        "axial_share": energy[:, 2],
    }


def _camera(elevation: float, azimuth: float) -> np.ndarray:
    """Rows: right, up and towards the eye, of a camera above and left of the axis (rad)."""
    ce, se, ca, sa = np.cos(elevation), np.sin(elevation), np.cos(azimuth), np.sin(azimuth)
    tilt = np.array([[1, 0, 0], [0, ce, -se], [0, se, ce]])
    turn = np.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])
    return tilt @ turn
