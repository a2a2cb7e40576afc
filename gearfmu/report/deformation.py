"""Gears deformed in a run: pictures at chosen times and a film, drawn from their modal amplitudes."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from gearfmu.geometry.plane import direction
from gearfmu.modes.deformed import DeformedGear
from gearfmu.report.chart import Plot
from gearfmu.report.run import Run
from gearfmu.report.style import INK, MUTED, STEEL, WIDTH, embedded, png, round_scale, styled
from gearfmu.stage.assembly.meshes import mesh_axes
from gearfmu.stage.run.deformation import Deformation
from gearfmu.stage.run.touching import GEAR_PHI

SHOWN = 0.035  # of the gear's diameter: how large the largest elastic displacement is drawn
IN_A_ROW = 3
FRAME_MS, FILM_DPI, FILM_COLOURS = 90, 60, 64
MICRO = 1e6


@dataclass(frozen=True)
class _Face:
    """What is seen of a gear along its axis: quadrilaterals (Q, 4) that face the eye, and marks of a carrier's turning
    neighbours: centres (N, F, 2) and radius, m."""

    gear: DeformedGear
    quads: np.ndarray
    scale: float
    norm: Normalize
    neighbours: np.ndarray
    radius: float


def pictures(run: Run, deformation: Deformation, gear: DeformedGear) -> Plot | None:
    """The gear at the times of the pictures, side by side; None without one."""
    chosen = list(deformation.pictures)
    if not chosen:
        return None
    face, moved = _face(run, deformation.time, gear, chosen)
    rows = math.ceil(len(chosen) / IN_A_ROW)
    with styled():
        width = WIDTH / min(len(chosen), IN_A_ROW)
        figure = Figure(figsize=(WIDTH, rows * min(width + 0.25, 0.5 * WIDTH)), layout="constrained")
        axes = figure.subplots(rows, min(len(chosen), IN_A_ROW), squeeze=False).ravel()
        for axis, frame, field in zip(axes, chosen, moved, strict=False):
            _draw(axis, face, frame, field)
            axis.set_title(f"t = {1e3 * deformation.time[frame]:.4g} ms", loc="left", color=INK)
        for axis in axes[len(chosen) :]:
            axis.axis("off")
        _bar(figure, list(axes), face, 0.5)
        image = png(figure)
    title = f"Deformation of the {gear.name}"
    return Plot(f"deformation_{gear.name}", title, _caption(face, moved), image, _columns(deformation, gear, chosen))


def film(run: Run, deformation: Deformation, gear: DeformedGear) -> Plot | None:
    """The frames of the film as one animated PNG; None with fewer than two."""
    chosen = list(deformation.film)
    if len(chosen) < 2:
        return None
    face, moved = _face(run, deformation.time, gear, chosen)
    with styled():
        figure = Figure(figsize=(6.4, 7.1), layout="constrained", dpi=FILM_DPI)
        canvas, axis = FigureCanvasAgg(figure), figure.subplots()
        _bar(figure, [axis], face, 0.7)
        _draw(axis, face, chosen[0], moved[0])
        axis.set_title("t", loc="left", fontsize=13)
        canvas.draw()
        figure.set_layout_engine("none")  # every frame has the place of the first
        images = []
        for frame, field in zip(chosen, moved, strict=True):
            axis.clear()
            _draw(axis, face, frame, field)
            axis.set_title(f"t = {1e3 * deformation.time[frame]:.1f} ms", loc="left", color=INK, fontsize=13)
            canvas.draw()
            images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
    step = float(np.median(np.diff(deformation.time[chosen])))
    caption = (
        f"{len(chosen)} frames, one every {1e3 * step:.4g} ms, shown {FRAME_MS / 1e3 / step:.0f} times slower than "
        f"they happened. Colours, from 0 to {face.norm.vmax:.3g} µm, and enlargement, {face.scale:g} times, are the "
        "same throughout. What repeats with the teeth, faster than the frames, is seen folded."
    )
    title = f"Deformation of the {gear.name}, film"
    columns = _columns(deformation, gear, chosen)
    return Plot(f"deformation_{gear.name}_film", title, caption, _animated(images), columns)


def _face(run: Run, time: np.ndarray, gear: DeformedGear, frames: Sequence[int]) -> tuple[_Face, list[np.ndarray]]:
    """What the frames have in common, and their elastic displacements."""
    points, quads = gear.surface
    moved = [gear.elastic(frame) for frame in frames]
    most = max(max(float(np.linalg.norm(u, axis=1).max()) for u in moved), 1e-12)
    diameter = 2 * float(np.linalg.norm(points[:, :2], axis=1).max())
    corners = points[quads]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    facing = quads[normal[:, 2] > 1e-3 * np.linalg.norm(normal, axis=1)]
    scale, norm = round_scale(SHOWN * diameter / most), Normalize(0, MICRO * most)
    return _Face(gear, facing, scale, norm, *_neighbours(run, time, gear.name)), moved


def _neighbours(run: Run, time: np.ndarray, gear: str) -> tuple[np.ndarray, float]:
    """Centres (N, F, 2) m of the planets that mesh with a gear that stands, as the ring of a set, by the carrier's
    angle, and the radius (m) of their tips; of other gears none."""
    trace, stage, none = run.trace, run.stage, (np.zeros((0, time.size, 2)), 0.0)
    if stage is None or not stage.rotors[stage.rotor_of(gear)].stands:
        return none
    meshes = [mesh for mesh in stage.engagements if mesh.gears[1] == gear]
    carrier = stage.rotors[stage.rotor_of(gear)].carried_by
    if not meshes or carrier is None or carrier + GEAR_PHI not in trace:
        return none
    turned = np.interp(time, trace.time, trace[carrier + GEAR_PHI])
    centres = np.array([mesh_axes(stage, mesh)[0] for mesh in meshes])
    planet = next(body for body in stage.gears if body.name == meshes[0].gears[0])
    angles = np.arctan2(centres[:, 1], centres[:, 0])[:, None] + turned
    return float(np.hypot(*centres[0])) * direction(angles), float(planet.tip_diameter) / 2


def _draw(axis: Axes, face: _Face, frame: int, moved: np.ndarray) -> None:
    points, _ = face.gear.surface
    edge = float(np.linalg.norm(points[:, :2], axis=1).max())
    drawn = (points + face.scale * moved)[:, :2]
    value = MICRO * np.linalg.norm(moved, axis=1)[face.quads].mean(axis=1)
    colours = STEEL(face.norm(value))
    depth = np.argsort(points[face.quads, 2].mean(axis=1), kind="stable")
    axis.add_collection(
        PolyCollection(list(drawn[face.quads[depth]]), facecolors=colours[depth], edgecolors=colours[depth], lw=0.25)
    )
    axis.add_patch(Circle((0, 0), edge, fill=False, ec=MUTED, lw=0.7, ls=(0, (4, 3))))
    for centre in face.neighbours[:, frame]:
        axis.add_patch(Circle(tuple(centre), face.radius, fill=False, ec=MUTED, lw=0.8))
        axis.plot(*centre, ".", color=MUTED, ms=3)
    most = edge * (1 + 2.4 * SHOWN)
    axis.set(xlim=(-most, most), ylim=(-most, most), aspect="equal")
    axis.axis("off")


def _bar(figure: Figure, axes: list[Axes], face: _Face, shrink: float) -> None:
    mappable, label = ScalarMappable(face.norm, STEEL), "elastic displacement in µm"
    bar = figure.colorbar(mappable, ax=axes, label=label, aspect=60, shrink=shrink, orientation="horizontal", pad=0.01)
    bar.outline.set_visible(False)


def _caption(face: _Face, moved: Sequence[np.ndarray]) -> str:
    largest = ", ".join(f"{MICRO * np.linalg.norm(u, axis=1).max():.3g}" for u in moved)
    marks = ""
    if len(face.neighbours):
        marks = " Thin circles: tip circles of the planets. What holds the ring is spread evenly round its rim."
    return (
        f"Seen along the axis, elastic displacement enlarged {face.scale:g} times, coloured by its magnitude; largest: "
        f"{largest} µm. The sum of all stored modes at that time; rigid motion on its supports is left out, and what "
        f"loaded teeth yield beyond those modes. Broken line: the undeformed outside.{marks}"
    )


def _columns(deformation: Deformation, gear: DeformedGear, frames: Sequence[int]) -> dict[str, np.ndarray]:
    """Root-mean-square displacement by nodal diameter, and rigid motion."""
    own, chosen = gear.motion, np.asarray(frames)
    diameter = gear.body.toothed.diameter[own.modes - 1]
    table: dict[str, Any] = {"time_[s]": deformation.time[chosen]}
    for nu in np.unique(diameter):
        table[f"rms_nu{nu}_[m]"] = np.sqrt((own.amplitude[chosen][:, diameter == nu] ** 2).sum(axis=1))
    names = ("x_[m]", "y_[m]", "z_[m]", "rx_[rad]", "ry_[rad]", "rz_[rad]")
    return table | {f"rigid_{name}": own.motion[chosen, k] for k, name in enumerate(names)}


def _animated(images: Sequence[Image.Image]) -> str:
    """An <img> element that holds an animated PNG of one palette, the colours of the scale and greys of lines and text;
    it needs no script."""
    scale = STEEL(np.linspace(0, 1, FILM_COLOURS))[:, :3]
    greys = np.linspace(0.13, 1, 16)[:, None] * np.ones(3)
    palette = Image.new("P", (1, 1))
    palette.putpalette((255 * np.concatenate([scale, greys])).round().astype(int).ravel().tolist())
    packed = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    buffer = io.BytesIO()
    packed[0].save(buffer, "PNG", save_all=True, append_images=packed[1:], duration=FRAME_MS, loop=0, optimize=True)
    return embedded(buffer, ' style="max-width:560px;margin:auto"')
