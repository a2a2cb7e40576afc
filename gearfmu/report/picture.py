"""The deformed pair at the instant of the largest mesh force, drawn from the bodies' display surfaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from gearfmu.geometry import PairGeometry
from gearfmu.report.chart import Plot
from gearfmu.report.plots import of_mesh
from gearfmu.report.scene3d import Shape, draw
from gearfmu.report.signals import drive_side
from gearfmu.spec.forms.general import Stage
from gearfmu.spec.forms.shapes import mesh_shape
from gearfmu.stage.build.meshes import mesh_axes, tooth_phases
from gearfmu.stage.run.touching import Contact, angle_of, contacts_at, meshing_angles
from gearfmu.stage.run.trace import Trace

SHOWN_FRACTION = 0.35  # of the module: how large the largest displacement is drawn


def deformed_pair(trace: Trace, stage: Stage, mesh: str, bodies: Sequence[Any]) -> Plot | None:
    """Two gears in mesh at the largest |force| of their engagement: their elastic displacement, enlarged, under that
    force applied statically and split evenly over the tooth pairs that rigid gears would have in contact. Drawn with
    gear A at the origin and gear B on +x. None without the force or the angle of gear A.

    bodies : ReducedBody of every gear of the stage with its `display`.
    """
    engagement = next((e for e in stage.engagements if e.name == mesh), None)
    if engagement is None:
        return None
    numbers = [[gear.name for gear in stage.gears].index(name) for name in engagement.gears]
    own, angle = [bodies[number] for number in numbers], angle_of(trace, stage, engagement.gears[0])
    if f"{mesh}.force" not in trace or angle is None or any(body.display is None for body in own):
        return None
    sample = int(np.argmax(np.abs(trace[f"{mesh}.force"])))
    force = float(trace[f"{mesh}.force"][sample])
    pair = mesh_shape(stage, engagement)
    if not isinstance(pair, PairGeometry):
        return None  # of a ring the recorded deformation is drawn (deformation.py)
    sg = 1 if force >= 0 else -1
    (x, y), (u, v) = mesh_axes(stage, engagement)
    place = tooth_phases(stage)[engagement.gears[0]] - math.atan2(v - y, u - x)
    angles = meshing_angles(pair, float(angle[sample]) + place, sg)
    contacts = contacts_at(pair, angles, sg)
    if not contacts or force == 0:
        return None
    moved = [
        _displacement(own[g], pair.gears[g].z, [(c.teeth[g], c.rolls[g]) for c in contacts], force) for g in (0, 1)
    ]
    scale = round_scale(SHOWN_FRACTION * pair.gears[0].m / max(float(np.linalg.norm(u, axis=1).max()) for u in moved))
    placed = [_placed(own[g].display.points, angles[g], pair.a if g else 0.0) for g in (0, 1)]
    world = [u @ _rotation(angle).T for u, angle in zip(moved, angles, strict=True)]
    approach = _approach(pair, contacts, sg, placed, world)
    drawn = [points + scale * u for points, u in zip(placed, world, strict=True)]
    drawn[0] = drawn[0] @ _rotation(sg * scale * approach / pair.gears[0].r_b).T
    shapes = [_shape(own[g].display, drawn[g], moved[g]) for g in (0, 1)]
    flank = "drive" if sg == drive_side(trace, mesh) else "coast"
    touching = f", tooth pairs in contact: {trace[f'{mesh}.pairs'][sample]:g}" if f"{mesh}.pairs" in trace else ""
    caption = (
        f"At t = {trace.time[sample]:.5f} s: mesh force {force / 1e3:.2f} kN on the {flank} flanks{touching}. "
        f"Right: the mesh, seen along the axis. Elastic displacement, enlarged {scale:g} times, under that force "
        f"applied statically to the tooth pairs that rigid gears would have in contact at mid-width, {len(contacts)}; "
        f"{engagement.gears[0]} is turned on until the loaded flanks meet again. Local flattening is left out."
    )
    if any(sum(name in e.gears for e in stage.engagements) > 1 for name in engagement.gears):
        caption += " So are the forces at the other meshes of the two."
    pitch_point = np.array([pair.r_w[0], 0, 0])
    image = draw(shapes, pitch_point, 3.2 * pair.gears[0].m, "elastic displacement in µm")
    file = "deformed_pair" if len(stage.engagements) == 1 else f"deformed_pair_{mesh}"
    title = of_mesh(trace, mesh, "The deformed pair at the largest mesh force")
    return Plot(file, title, caption, image, _columns(shapes, moved))


def _displacement(body: Any, teeth: int, loads: Sequence[tuple[int, float]], force: float) -> np.ndarray:
    """Displacement (P, 3) m in the body frame under `force` (N, negative: on flank 1) split evenly over `loads`
    (tooth, roll)."""
    display = body.display
    total = np.zeros((len(display.points), 3))
    for tooth, roll in loads:
        unit = _at_roll(np.asarray(display.loads, dtype=float), np.asarray(display.load_roll, dtype=float), roll)
        if force < 0:
            unit = mirrored(np.asarray(display.points, dtype=float), unit)
        total -= abs(force) / len(loads) * _on_tooth(unit, tooth, teeth)
    return total


def _at_roll(loads: np.ndarray, rolls: np.ndarray, roll: float) -> np.ndarray:
    """Linear interpolation of loads (p, P, 3) between rolls (p,)."""
    order = np.argsort(rolls)
    position = np.interp(roll, rolls[order], np.arange(rolls.size))
    low = min(int(position), rolls.size - 2)
    part = position - low
    return (1 - part) * loads[order[low]] + part * loads[order[low + 1]]


def _on_tooth(unit: np.ndarray, tooth: int, teeth: int) -> np.ndarray:
    """A field of tooth 0 (z·P, 3), sector after sector, moved to another tooth."""
    turned = np.roll(unit.reshape(teeth, -1, 3), tooth, axis=0).reshape(-1, 3)
    return turned @ _rotation(2 * math.pi * tooth / teeth).T


def mirrored(points: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """The field of flank 1 from that of flank 0 by half a turn about the tooth's middle line, the x axis: it leaves
    spur and helical gears as they are."""
    mirror = np.array([1.0, -1.0, -1.0])
    _, index = cKDTree(points).query(points * mirror)
    return unit[index] * mirror


def _rotation(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _placed(points: np.ndarray, angle: float, x: float) -> np.ndarray:
    return np.asarray(points, dtype=float) @ _rotation(angle).T + np.array([x, 0, 0])


def _approach(
    pair: PairGeometry, contacts: Sequence[Contact], sg: int, placed: Sequence[np.ndarray], moved: Sequence[np.ndarray]
) -> float:
    """How far (m) the flanks recede from each other along the line of action, mean over the pairs in contact."""
    t = -sg * pair.alpha_wt
    normal = sg * np.array([-math.sin(t), math.cos(t), 0])
    tangent_point = pair.gears[0].r_b * np.array([math.cos(t), math.sin(t), 0])
    spots = np.array([tangent_point + contact.rolls[0] * normal for contact in contacts])
    spots[:, 2] = max(float(points[:, 2].max()) for points in placed)
    nearest = [cKDTree(points).query(spots)[1] for points in placed]
    return float(np.mean((moved[1][nearest[1]] - moved[0][nearest[0]]) @ normal))


def _shape(display: Any, drawn: np.ndarray, moved: np.ndarray) -> Shape:
    return Shape(drawn, np.asarray(display.quads, dtype=int), 1e6 * np.linalg.norm(moved, axis=1))


def round_scale(scale: float) -> float:
    """The largest of 1, 2, 5 times a power of ten below `scale`."""
    power = 10 ** math.floor(math.log10(scale))
    return float(next(step * power for step in (5, 2, 1) if step * power <= scale))


def _columns(shapes: Sequence[Shape], moved: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    points = np.vstack([shape.points for shape in shapes])
    displacement = np.vstack(moved)
    gear = np.repeat([0, 1], [len(u) for u in moved])
    columns = {"gear": gear}
    columns |= {f"drawn_{axis}_[m]": points[:, i] for i, axis in enumerate("xyz")}
    return columns | {f"body_u{axis}_[m]": displacement[:, i] for i, axis in enumerate("xyz")}
