"""The deformed stage, turning: what the page's script (`web/stage.js`) needs to draw it at any time of a short part of
the run.

Angles are the recorded ones. A gear whose deformation was recorded moves by its modes; the others as under the recorded
mesh force applied statically and split evenly over the tooth pairs in contact. The
displacement under a load at any roll is interpolated between the stored unit loads of tooth 0 and turned to the tooth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from gearfmu.body import Body
from gearfmu.body.body import Picture
from gearfmu.geometry.gear import ReferenceGear
from gearfmu.geometry.plane import about_z
from gearfmu.modes.deformed import DeformedGear
from gearfmu.report.packed import Pack
from gearfmu.report.structure import AROUND, parts, turned
from gearfmu.report.style import round_scale
from gearfmu.stage.assembly.meshes import direction_of, mesh_axes, tooth_phases
from gearfmu.stage.run.touching import GEAR_PHI, contacts_at
from gearfmu.stage.run.trace import Trace
from gearfmu.stagefile.forms.general import EngagementSpec, Stage
from gearfmu.stagefile.forms.shapes import mesh_shape

FRAMES, CONTACTS = 160, 4
SHOWN_FRACTION = 0.35  # of the module: how large the largest displacement is drawn
STEPS = 127  # of a displacement, in the page
BOLT_TONE = 1.45  # brighter than the plate behind it
HOUSING_TONE = 1.75


@dataclass
class Drawn:
    """A gear in the view. points (P, 3) m, `teeth` equal sectors of them one after the other; quads (Q, 4) of the first
    sector and whether a point is the next sector's; angle, x, y (F,), z; contacts by mesh: (3, F, C) tooth, roll (m),
    force (N, negative on flank 1); loads: rolls (R,) and displacement (2, R, P, 3) m/N under unit loads there on the
    flanks 0 and 1 of tooth 0; recorded: times (G,) and frames (G, P, 3) m where the deformation was recorded."""

    name: str
    points: np.ndarray
    quads: np.ndarray
    ahead: np.ndarray
    teeth: int
    angle: np.ndarray
    place: tuple[np.ndarray, np.ndarray, float]
    contacts: dict[str, np.ndarray] = field(default_factory=dict)
    loads: tuple[np.ndarray, np.ndarray] | None = None
    recorded: tuple[np.ndarray, np.ndarray] | None = None
    extra: np.ndarray | None = None  # (F,) rad: turn per unit of enlargement that keeps loaded flanks together
    tone: float = 0.0  # of a shaft, carrier or housing, drawn rigid: brightness; 0 of a gear
    inside: bool = False  # of a housing: only faces whose inner side is seen, so that it hides no gear


@dataclass(frozen=True)
class View:
    """The bodies at times (F,) s; scale: enlargement to begin with; most: largest displacement, m; close: pitch point
    of the first mesh, x and y (F,), and a radius (m) to look at it; recorded: names of gears that move by their
    recorded modes."""

    time: np.ndarray
    bodies: Sequence[Drawn]
    scale: float
    most: float
    close: tuple[np.ndarray, np.ndarray, float]
    recorded: tuple[str, ...]

    def numbers(self, pack: Pack) -> dict[str, Any]:
        """The plain structure for the script, arrays in `pack`."""
        return {
            "time": pack.add(self.time), "scale": self.scale, "most": self.most, "half": self.close[2],
            "close": [pack.add(values) for values in self.close[:2]],
            "bodies": [_numbers(body, pack) for body in self.bodies],
        }  # fmt: skip

    @property
    def caption(self) -> str:
        """Caption: visible bodies and omissions."""
        span = 1e3 * (self.time[-1] - self.time[0])
        text = (
            f"{span:.3g} ms of the run, slowed down; gears turn by their recorded angles. Elastic displacement under "
            "the recorded mesh forces, applied statically and split evenly over the pairs in contact of rigid gears; "
        )
        if self.recorded:
            text += f"of {', '.join(self.recorded)}: the sum of all recorded modes; "
        rigid = "; shafts and carrier, dark, are drawn rigid" if any(body.tone for body in self.bodies) else ""
        rigid += ", as is the far side of the housing" if any(body.inside for body in self.bodies) else ""
        return text + (
            f"largest {1e6 * self.most:.3g} µm, enlarged {self.scale:g} times to begin with. Loaded flanks are turned "
            f"together again; local flattening is left out{rigid}. Drag to look from another side."
        )


@dataclass(frozen=True)
class _Course:
    """A stage at the times (F,) s of a view."""

    trace: Trace
    stage: Stage
    time: np.ndarray

    def angle(self, rotor: str | None) -> np.ndarray | None:
        """(F,) rad of a rotor in the fixed axes; 0 of one at rest and of none; None where it was not recorded."""
        if rotor is None or self.stage.rotors[rotor].stands:
            return np.zeros_like(self.time)
        name = f"{rotor}{GEAR_PHI}"
        return np.interp(self.time, self.trace.time, self.trace[name]) if name in self.trace else None

    def carried(self, mesh: EngagementSpec) -> np.ndarray:
        """Angle (F,) rad of the axes in which an engagement rolls."""
        return self._known(self.stage.frame_of(mesh))

    def gear(self, name: str, body: Body, phase: float) -> Drawn:
        """A gear by its picture, without loads; phase: angle of its tooth or space 0, rad, where the stage begins."""
        own, picture = self.stage.rotors[self.stage.rotor_of(name)], body.picture
        assert picture is not None
        about = self._known(None if own.stands else own.carried_by)
        (x, y), teeth = own.axis, body.toothed.teeth
        place = x * np.cos(about) - y * np.sin(about), x * np.sin(about) + y * np.cos(about), float(own.bodies[name])
        points, surface = np.asarray(picture.points, float), np.asarray(picture.quads, int)
        angle = self._known(self.stage.rotor_of(name)) + phase
        sector = _first_sector(len(points), surface, teeth)
        return Drawn(name, points, *sector, teeth, angle, place, loads=_unit_loads(picture))

    def _known(self, rotor: str | None) -> np.ndarray:
        angle = self.angle(rotor)
        assert angle is not None
        return angle


def moving_view(
    trace: Trace, stage: Stage, bodies: Mapping[str, Body], window: tuple[float, float],
    recorded: Sequence[tuple[DeformedGear, np.ndarray]] = (),
) -> View | None:  # fmt: skip
    """The view of a stage within a window (s); None where an angle or every mesh force is missing. bodies: by name;
    recorded: gears with the times (s) of their frames."""
    gears = [gear.name for gear in stage.gears if gear.name in bodies and bodies[gear.name].picture is not None]
    course = _Course(trace, stage, np.linspace(*window, FRAMES))
    if not gears or any(course.angle(stage.rotor_of(name)) is None for name in gears):
        return None
    phases = tooth_phases(stage)
    made = {name: course.gear(name, bodies[name], phases[name]) for name in gears}
    for mesh in stage.engagements:
        if f"{mesh.name}.force" in trace and set(mesh.gears) <= set(made):
            _load(course, mesh, [made[name] for name in mesh.gears])
    for gear, times in recorded:
        if gear.name in made:
            _record(made[gear.name], gear, times, window)
    _turn_together(stage, made)
    most = max(_largest(body) for body in made.values())
    if most <= 0:
        return None
    scale = round_scale(SHOWN_FRACTION * float(stage.gears[0].normal_module) / most)
    drawn = [*made.values(), *_structure(course), *_housings(stage, bodies)]
    return View(course.time, drawn, scale, most, _close(course), tuple(g.name for g, _ in recorded))


def _structure(course: _Course) -> list[Drawn]:
    """Shafts and carriers whose angle was recorded."""
    found = []
    for name, rotor, profile, (x, y), z in parts(course.stage):
        if (angle := course.angle(rotor)) is None:
            continue
        at = complex(*course.stage.rotors[rotor].axis) + complex(x, y) * np.exp(1j * angle)
        place, tone = (at.real, at.imag, z), BOLT_TONE if "bolt" in name else 1.0
        found.append(Drawn(name, *turned(profile), AROUND, angle, place, tone=tone))
    return found


def _housings(stage: Stage, bodies: Mapping[str, Body]) -> list[Drawn]:
    """Housings by their skin, at rest."""
    found, still = [], np.zeros(FRAMES)
    for housing in stage.housings:
        skin = bodies[housing.name].skin if housing.name in bodies else None
        if skin is not None:
            points = skin.points.astype(float)
            x, y, z = 0.5 * (points.min(axis=0) + points.max(axis=0))
            place, surface = (still + x, still + y, float(z)), (points - [x, y, z], skin.faces)
            ahead = np.zeros_like(skin.faces, np.int8)
            found.append(Drawn(housing.name, *surface, ahead, 1, still, place, tone=HOUSING_TONE, inside=True))
    return found


def _first_sector(points: int, quads: np.ndarray, teeth: int) -> tuple[np.ndarray, np.ndarray]:
    """Quads of the first of `teeth` equal sectors by its points, and whether each point is the next sector's."""
    size, first = points // teeth, quads[: len(quads) // teeth]
    return first % size, (first // size == 1).astype(np.int8)


def _load(course: _Course, mesh: EngagementSpec, gears: Sequence[Drawn]) -> None:
    """Add the tooth pairs in contact of an engagement to its two gears."""
    stage, trace, count = course.stage, course.trace, course.time.size
    pair, force = mesh_shape(stage, mesh), np.interp(course.time, trace.time, trace[f"{mesh.name}.force"])
    carried, gamma = course.carried(mesh), direction_of(pair, *mesh_axes(stage, mesh))
    found = [np.zeros((3, count, CONTACTS)) for _ in gears]
    for i in range(count):
        angles = [gear.angle[i] - carried[i] - gamma for gear in gears]
        contacts = contacts_at(pair, angles, 1 if force[i] >= 0 else -1)[:CONTACTS]
        for c, contact in enumerate(contacts):
            for own, number, at in zip(found, contact.teeth, contact.rolls, strict=True):
                own[:, i, c] = number, at, force[i] / len(contacts)
    for gear, own in zip(gears, found, strict=True):
        gear.contacts[mesh.name] = own


def _unit_loads(display: Picture) -> tuple[np.ndarray, np.ndarray]:
    """Rolls (R,) ascending and displacement (2, R, P, 3) m/N under unit loads on the flanks 0 and 1 of tooth 0."""
    order = np.argsort(np.asarray(display.load_roll, float))
    first, points = np.asarray(display.loads, float)[order], np.asarray(display.points, float)
    second = np.stack([_mirrored(points, unit) for unit in first])
    return np.asarray(display.load_roll, float)[order], np.stack([first, second])


def _mirrored(points: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """The field of flank 1 from that of flank 0 by half a turn about the tooth's middle line, the x axis: it leaves
    spur and helical gears as they are."""
    mirror = np.array([1.0, -1.0, -1.0])
    _, index = cKDTree(points).query(points * mirror)
    return unit[index] * mirror


def _record(body: Drawn, gear: DeformedGear, times: np.ndarray, window: tuple[float, float]) -> None:
    """Give a body its recorded motion around the window instead of loads."""
    first = max(int(np.searchsorted(times, window[0])) - 1, 0)
    chosen = range(first, min(int(np.searchsorted(times, window[1])) + 1, times.size))
    back = about_z(gear.angle)  # of row vectors, from the axes of the stage to the body's
    points, quads = gear.surface
    body.points, body.teeth = points @ back, gear.body.toothed.teeth
    body.quads, body.ahead = _first_sector(len(points), quads, body.teeth)
    body.recorded = times[list(chosen)], np.stack([gear.elastic(k) @ back for k in chosen])
    body.contacts, body.loads = {}, None


def _turn_together(stage: Stage, made: dict[str, Drawn]) -> None:
    """Turn of every rotor per unit of enlargement that closes the gaps which the enlarged displacement opens: from the
    last gears B, which stay, back to the input, by equal lengths on the base circles."""
    turned: dict[str, list[np.ndarray]] = {}
    for mesh in reversed(stage.engagements):
        if not set(mesh.gears) <= set(made):
            continue
        pair = mesh_shape(stage, mesh)
        a, b = (stage.rotor_of(name) for name in mesh.gears)
        behind = np.mean(turned[b], axis=0) if b in turned else np.zeros(FRAMES)
        recede = sum(_recede(made[name], mesh.name, own) for name, own in zip(mesh.gears, pair.gears, strict=True))
        ratio = pair.side * pair.gears[1].r_b / pair.gears[0].r_b
        turned.setdefault(a, []).append(recede / pair.gears[0].r_b - ratio * behind)
    for name, body in made.items():
        if (own := turned.get(stage.rotor_of(name))) is not None:
            body.extra = np.mean(own, axis=0)


def _recede(body: Drawn, mesh: str, geometry: ReferenceGear) -> np.ndarray:
    """(F,) m, signed as the force: how far the loaded flanks of a gear yield at their contacts, mean over them."""
    if body.loads is None or mesh not in body.contacts:
        return np.zeros(FRAMES)
    rolls, (first, _) = body.loads
    yields = np.array([_yield(body.points, unit, geometry, roll) for unit, roll in zip(first, rolls, strict=True)])
    _, roll, force = body.contacts[mesh]
    count = np.maximum((force != 0).sum(axis=1), 1)
    return np.asarray((force * np.interp(roll, rolls, yields)).sum(axis=1) / count)


def _yield(points: np.ndarray, unit: np.ndarray, geometry: ReferenceGear, roll: float) -> float:
    """Displacement (m/N) along the normal where a unit load acts on flank 0 of tooth 0 at a roll (m)."""
    t = geometry.psi_b - roll / geometry.r_b
    radial, normal = np.array([math.cos(t), math.sin(t)]), np.array([-math.sin(t), math.cos(t)])
    nearest = cKDTree(points[:, :2]).query(geometry.r_b * radial + roll * normal)[1]
    return abs(float(unit[nearest, :2] @ normal))


def _largest(body: Drawn) -> float:
    """Largest displacement (m) at any frame."""
    if body.recorded is not None:
        return float(np.linalg.norm(body.recorded[1], axis=2).max())
    if body.loads is None:
        return 0.0
    rolls, unit = body.loads
    size = np.linalg.norm(unit, axis=3).max(axis=(0, 2))
    found = (float(np.abs(np.interp(roll, rolls, size) * f).max()) for _, roll, f in body.contacts.values())
    return max(found, default=0.0)


def _close(course: _Course) -> tuple[np.ndarray, np.ndarray, float]:
    """Pitch point of the first engagement, x and y (F,) m, and a radius (m) around it."""
    stage, mesh = course.stage, course.stage.engagements[0]
    (x, y), (u, v) = mesh_axes(stage, mesh)
    a, b = mesh_shape(stage, mesh).gears
    part = a.z / (a.z + b.z)
    at = complex(x + part * (u - x), y + part * (v - y)) * np.exp(1j * course.carried(mesh))
    return at.real, at.imag, 4.0 * float(stage.gears[0].normal_module)


def _numbers(body: Drawn, pack: Pack) -> dict[str, Any]:
    size, (x, y, z) = len(body.points) // body.teeth, body.place
    found: dict[str, Any] = {"tone": body.tone} if body.tone else {}
    found |= {"inside": 1} if body.inside else {}
    found |= {
        "name": body.name, "teeth": body.teeth, "z": z, "size": size,
        "points": pack.add_raw(body.points[:size].astype(np.float32).ravel()),
        "quads": pack.add_raw(body.quads.astype(np.int32).ravel()),
        "ahead": pack.add_raw(body.ahead.astype(np.int8).ravel()),
        "angle": pack.add_raw(body.angle), "x": pack.add(x), "y": pack.add(y),
    }  # fmt: skip
    if body.extra is not None:
        found["extra"] = pack.add(body.extra)
    if body.recorded is not None:
        times, frames = body.recorded
        scale = float(np.abs(frames).max()) / STEPS or 1.0
        steps = np.rint(frames / scale).astype(np.int8)
        found |= {"times": pack.add(times), "frames": pack.add_raw(steps.ravel()), "step": scale}
    elif body.loads is not None and body.contacts:
        rolls, unit = body.loads
        scale = float(np.abs(unit).max()) / STEPS
        steps = np.rint(unit / scale).astype(np.int8)
        found |= {"rolls": pack.add(rolls), "unit": pack.add_raw(steps.ravel()), "step": scale}
        found["contacts"] = [
            {
                "tooth": pack.add_raw(tooth.astype(np.int32).ravel()), "most": CONTACTS,
                "roll": pack.add_raw(roll.astype(np.float32).ravel()),
                "force": pack.add_raw(force.astype(np.float32).ravel()),
            }
            for tooth, roll, force in body.contacts.values()
        ]  # fmt: skip
    return found
