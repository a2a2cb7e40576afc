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
from gearfmu.modes.deformed import DeformedGear
from gearfmu.report.packed import Pack
from gearfmu.report.structure import AROUND, parts, turned
from gearfmu.report.style import round_scale
from gearfmu.stage.assembly.meshes import direction_of, kind_of, mesh_axes, tooth_phases
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
    force (N, negative on flank 1); unit: displacement (2, R, P, 3) m/N under unit loads on the flanks 0 and 1 of tooth
    0 at rolls (R,); frames (G, P, 3) m at `times` (G,) where the deformation was recorded."""

    name: str
    points: np.ndarray
    quads: np.ndarray
    ahead: np.ndarray
    teeth: int
    angle: np.ndarray
    place: tuple[np.ndarray, np.ndarray, float]
    contacts: dict[str, np.ndarray] = field(default_factory=dict)
    rolls: np.ndarray | None = None
    unit: np.ndarray | None = None
    times: np.ndarray | None = None
    frames: np.ndarray | None = None
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


def moving_view(
    trace: Trace, stage: Stage, bodies: Mapping[str, Body], window: tuple[float, float],
    recorded: Sequence[tuple[DeformedGear, np.ndarray]] = (),
) -> View | None:  # fmt: skip
    """The view of a stage within a window (s); None where an angle or every mesh force is missing. bodies: by name;
    recorded: gears with the times (s) of their frames."""
    gears = [gear.name for gear in stage.gears if gear.name in bodies and bodies[gear.name].picture is not None]
    time = np.linspace(*window, FRAMES)
    if not gears or any(_rotor_angle(trace, stage, stage.rotor_of(name)) is None for name in gears):
        return None
    phases, made = tooth_phases(stage), {}
    for name in gears:
        made[name] = _body(trace, stage, (name, bodies[name]), time, phases[name])
    for mesh in stage.engagements:
        if f"{mesh.name}.force" in trace and set(mesh.gears) <= set(made):
            _load(trace, stage, mesh, (made, bodies), time)
    for gear, times in recorded:
        if gear.name in made:
            _record(made[gear.name], gear, times, window)
    _turn_together(stage, made)
    most = max(_largest(body) for body in made.values())
    if most <= 0:
        return None
    module = float(stage.gears[0].normal_module)
    scale = round_scale(SHOWN_FRACTION * module / most)
    drawn = [*made.values(), *_structure(trace, stage, time), *_housings(stage, bodies)]
    return View(time, drawn, scale, most, _close(stage, trace, time), tuple(g.name for g, _ in recorded))


def _structure(trace: Trace, stage: Stage, time: np.ndarray) -> list[Drawn]:
    """Shafts and carriers whose angle was recorded."""
    found = []
    for name, rotor, profile, (x, y), z in parts(stage):
        recorded = _rotor_angle(trace, stage, rotor)
        if recorded is None:
            continue
        angle, axis = np.interp(time, trace.time, recorded), complex(*stage.rotors[rotor].axis)
        at = axis + complex(x, y) * np.exp(1j * angle)
        surface = turned(profile)
        found.append(
            Drawn(name, *surface, AROUND, angle, (at.real, at.imag, z), tone=BOLT_TONE if "bolt" in name else 1.0)
        )
    return found


def _housings(stage: Stage, bodies: Mapping[str, Body]) -> list[Drawn]:
    """Housings by their skin, at rest."""
    found, still = [], np.zeros(FRAMES)
    for housing in stage.housings:
        skin = bodies[housing.name].skin if housing.name in bodies else None
        if skin is not None:
            points = skin.points.astype(float)
            x, y, z = 0.5 * (points.min(axis=0) + points.max(axis=0))
            ahead = np.zeros_like(skin.faces, np.int8)
            place, centred = (still + x, still + y, float(z)), points - [x, y, z]
            surface = (centred, skin.faces, ahead)
            found.append(Drawn(housing.name, *surface, 1, still, place, tone=HOUSING_TONE, inside=True))
    return found


def _body(trace: Trace, stage: Stage, named: tuple[str, Body], time: np.ndarray, phase: float) -> Drawn:
    (name, body), rotor = named, stage.rotor_of(named[0])
    display, carrier = body.picture, stage.rotors[rotor].carried_by
    assert display is not None
    turned = _rotor_angle(trace, stage, rotor)
    assert turned is not None
    angle, (x, y) = np.interp(time, trace.time, turned), stage.rotors[rotor].axis
    about = np.zeros_like(time)
    if carrier is not None and not stage.rotors[rotor].stands:
        about = np.interp(time, trace.time, trace[f"{carrier}{GEAR_PHI}"])
    places = (x * np.cos(about) - y * np.sin(about), x * np.sin(about) + y * np.cos(about))
    points, quads = np.asarray(display.points, float), np.asarray(display.quads, int)
    teeth = body.toothed.teeth if _periodic(points, quads, body.toothed.teeth) else 1
    place = (*places, float(stage.rotors[rotor].bodies[name]))
    return Drawn(name, points, *_first_sector(len(points), quads, teeth), teeth, angle + phase, place)


def _first_sector(points: int, quads: np.ndarray, teeth: int) -> tuple[np.ndarray, np.ndarray]:
    """Quads of the first of `teeth` equal sectors by its points, and whether each point is the next sector's."""
    size, first = points // teeth, quads[: len(quads) // teeth]
    return first % size, (first // size == 1).astype(np.int8)


def _rotor_angle(trace: Trace, stage: Stage, rotor: str) -> np.ndarray | None:
    """Angle (n,) rad of a rotor in the fixed axes; a rotor at rest does not turn."""
    if stage.rotors[rotor].stands:
        return np.zeros(trace.time.size)
    return trace[f"{rotor}{GEAR_PHI}"] if f"{rotor}{GEAR_PHI}" in trace else None


def _periodic(points: np.ndarray, quads: np.ndarray, teeth: int) -> bool:
    """Whether points and quads are those of the first sector, repeated."""
    if len(points) % teeth or len(quads) % teeth:
        return False
    size, turn = len(points) // teeth, 2 * math.pi / teeth
    first = np.tile(points[:size], (teeth, 1))
    angle = np.repeat(np.arange(teeth) * turn, size)
    c, s = np.cos(angle), np.sin(angle)
    turned = np.stack([c * first[:, 0] - s * first[:, 1], s * first[:, 0] + c * first[:, 1], first[:, 2]], axis=1)
    per = len(quads) // teeth
    shifted = (np.tile(quads[:per], (teeth, 1)) + size * np.repeat(np.arange(teeth), per)[:, None]) % len(points)
    return bool(np.allclose(turned, points, atol=1e-6 * np.ptp(points)) and np.array_equal(shifted, quads))


def _load(
    trace: Trace, stage: Stage, mesh: EngagementSpec, gears: tuple[dict[str, Drawn], Mapping[str, Body]],
    time: np.ndarray,
) -> None:  # fmt: skip
    """Add the tooth pairs in contact of an engagement to its two bodies."""
    made, bodies = gears
    pair, force = mesh_shape(stage, mesh), np.interp(time, trace.time, trace[f"{mesh.name}.force"])
    carried = _carried(trace, stage, mesh, time)
    gamma = direction_of(pair, *mesh_axes(stage, mesh))
    found = [np.zeros((3, time.size, CONTACTS)) for _ in mesh.gears]
    for i in range(time.size):
        sg = 1 if force[i] >= 0 else -1
        angles = [made[name].angle[i] - carried[i] - gamma for name in mesh.gears]
        contacts = contacts_at(pair, angles, sg)[:CONTACTS]
        for c, contact in enumerate(contacts):
            for (tooth, roll, part), number, at in zip(found, contact.teeth, contact.rolls, strict=True):
                tooth[i, c], roll[i, c], part[i, c] = number, at, force[i] / len(contacts)
    for name, own in zip(mesh.gears, found, strict=True):
        body = made[name]
        body.contacts[mesh.name] = own
        if body.unit is None:
            picture = bodies[name].picture
            assert picture is not None
            body.rolls, body.unit = _unit_loads(picture)


def _carried(trace: Trace, stage: Stage, mesh: EngagementSpec, time: np.ndarray) -> np.ndarray:
    """Angle (F,) rad of the axes in which an engagement rolls."""
    frame = stage.frame_of(mesh)
    return np.zeros_like(time) if frame is None else np.interp(time, trace.time, trace[f"{frame}{GEAR_PHI}"])


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
    c, s = math.cos(gear.angle), math.sin(gear.angle)
    back = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # from the axes of the stage to the body's
    points, quads = gear.surface
    body.points, body.teeth = points @ back, gear.body.toothed.teeth
    body.quads, body.ahead = _first_sector(len(points), quads, body.teeth)
    body.times, body.frames = times[list(chosen)], np.stack([gear.elastic(k) @ back for k in chosen])
    body.contacts, body.unit, body.rolls = {}, None, None


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
        ratio = kind_of(pair) * pair.gears[1].r_b / pair.gears[0].r_b
        turned.setdefault(a, []).append(recede / pair.gears[0].r_b - ratio * behind)
    for name, body in made.items():
        if (own := turned.get(stage.rotor_of(name))) is not None:
            body.extra = np.mean(own, axis=0)


def _recede(body: Drawn, mesh: str, geometry: ReferenceGear) -> np.ndarray:
    """(F,) m, signed as the force: how far the loaded flanks of a gear yield at their contacts, mean over them."""
    if body.unit is None or body.rolls is None or mesh not in body.contacts:
        return np.zeros(FRAMES)
    known = zip(body.unit[0], body.rolls, strict=True)
    yields = np.array([_yield(body.points, unit, geometry, roll) for unit, roll in known])
    _, roll, force = body.contacts[mesh]
    count = np.maximum((force != 0).sum(axis=1), 1)
    return np.asarray((force * np.interp(roll, body.rolls, yields)).sum(axis=1) / count)


def _yield(points: np.ndarray, unit: np.ndarray, geometry: ReferenceGear, roll: float) -> float:
    """Displacement (m/N) along the normal where a unit load acts on flank 0 of tooth 0 at a roll (m)."""
    t = geometry.psi_b - roll / geometry.r_b
    radial, normal = np.array([math.cos(t), math.sin(t)]), np.array([-math.sin(t), math.cos(t)])
    nearest = cKDTree(points[:, :2]).query(geometry.r_b * radial + roll * normal)[1]
    return abs(float(unit[nearest, :2] @ normal))


def _largest(body: Drawn) -> float:
    """Largest displacement (m) at any frame."""
    if body.frames is not None:
        return float(np.linalg.norm(body.frames, axis=2).max())
    if body.unit is None or body.rolls is None:
        return 0.0
    size, rolls = np.linalg.norm(body.unit, axis=3).max(axis=(0, 2)), body.rolls
    found = (float(np.abs(np.interp(roll, rolls, size) * f).max()) for _, roll, f in body.contacts.values())
    return max(found, default=0.0)


def _close(stage: Stage, trace: Trace, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Pitch point of the first engagement, x and y (F,) m, and a radius (m) around it."""
    mesh = stage.engagements[0]
    (x, y), (u, v) = mesh_axes(stage, mesh)
    pair = mesh_shape(stage, mesh)
    part = pair.gears[0].z / (pair.gears[0].z + pair.gears[1].z)
    at = complex(x + part * (u - x), y + part * (v - y)) * np.exp(1j * _carried(trace, stage, mesh, time))
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
    if body.frames is not None and body.times is not None:
        scale = float(np.abs(body.frames).max()) / STEPS or 1.0
        frames = np.rint(body.frames / scale).astype(np.int8)
        found |= {"times": pack.add(body.times), "frames": pack.add_raw(frames.ravel()), "step": scale}
    elif body.unit is not None and body.rolls is not None:
        scale = float(np.abs(body.unit).max()) / STEPS
        unit = np.rint(body.unit / scale).astype(np.int8)
        found |= {"rolls": pack.add(body.rolls), "unit": pack.add_raw(unit.ravel()), "step": scale}
        found["contacts"] = [
            {
                "tooth": pack.add_raw(tooth.astype(np.int32).ravel()), "most": CONTACTS,
                "roll": pack.add_raw(roll.astype(np.float32).ravel()),
                "force": pack.add_raw(force.astype(np.float32).ravel()),
            }
            for tooth, roll, force in body.contacts.values()
        ]  # fmt: skip
    return found
