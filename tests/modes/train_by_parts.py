"""A pair, or a train of helical gears on elastic shafts, at rest in mesh, put together in numpy from its spec, its
reduced gears and finite-element shafts: equation (29) in six freedoms a body, gears in their unloaded places. Of the
kernel it takes which slices carry load, and how much.

Every body has its rigid motion x, y, z, r_x, r_y, r_z in the axes of the stage and elastic coordinates; a shaft has the
unknowns of its finite elements instead. Links are loaded slices, seats, bearings and ports: with their elongations R q
and their compliance C, which holds what gears yield beyond their modes, K = diag(ω²) + Rᵀ C⁻¹ R. Both gears of a mesh
must have tooth 0 on +x at φ = 0, or face it: no gear with two meshes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sl
from numpy.polynomial.legendre import Legendre
from turned_rows import on_tooth

from gearfmu.body import Body
from gearfmu.body.beam import ORDER, Section, Shaft, Steel, bending_matrices, rod_matrices
from gearfmu.geometry import PairGeometry
from gearfmu.geometry.plane import about_z
from gearfmu.stage.assembly.teeth import resampling
from gearfmu.stagefile.forms.general import EngagementSpec, Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.tables.bodies import ShaftBody

STIFFNESS = {"radial": (0, 1), "axial": (2,), "tilt": (3, 4), "torsion": (5,)}
LEAST_HALF_WIDTH = 5e-6  # m: below it the local law is a parabola (docs/theory.md 2.4)
UNSEEN = 1e-9  # of the largest row: modes that nothing excites are left out
FINE = 16  # elements along a shaft


@dataclass(frozen=True)
class Load:
    """A loaded slice: engagement, flank (0 drive, 1 coast), tooth of gear A, number across the width, force (N)."""

    mesh: int
    flank: int
    tooth: int
    slice: int
    force: float


@dataclass(frozen=True)
class Part:
    """A body. stiffness, mass (n, n) of its coordinates; rows (m, n) of the places at which it is linked, node by node
    with six motions each, then its contacts; residual (m, m): what these yield beyond the coordinates."""

    stiffness: np.ndarray
    mass: np.ndarray
    rows: np.ndarray
    residual: np.ndarray


@dataclass(frozen=True)
class Touch:
    """Where a slice touches: tangent δ′ (m/N) of the local law; of A and B roll (m), direction of tooth 0 (rad), number
    of the tooth, and the row (6,) of rigid motion that closes the gap; part (2,): of the width, −1 … 1."""

    rolls: tuple[float, float]
    law: float
    zero: tuple[float, float]
    teeth: tuple[int, int]
    rigid: tuple[np.ndarray, np.ndarray]
    part: np.ndarray


def touch(stage: Stage, mesh: EngagementSpec, load: Load, turned: tuple[float, float]) -> Touch:
    """Of a slice of an engagement whose gears have turned by `turned` (rad) since the drive flanks of tooth 0 touched,
    tooth 0 of gear A on +x. A slice is a part of the line of contact: of the width that lies on both flanks."""
    pair = mesh_shape(stage, mesh)
    assert isinstance(pair, PairGeometry)
    a, b = pair.gears
    axes = [np.array(stage.rotors[stage.rotor_of(name)].axis) for name in mesh.gears]
    gamma, sense = math.atan2(*(axes[1] - axes[0])[::-1]), 1.0 - 2.0 * load.flank
    width = min(stage.bodies[name].face_width for name in mesh.gears)
    free = [a.psi_b + pair.alpha_wt, b.psi_b + pair.alpha_wt]  # roll/r_b of a tooth on the line between the axes
    first = gamma + math.pi - free[1] + (pair.length - a.r_b * (free[0] - gamma)) / b.r_b  # tooth 0 of B then
    zero = (turned[0], first + turned[1])
    middle = a.r_b * (free[0] + sense * (zero[0] - gamma + 2 * math.pi * load.tooth / a.z))  # roll on A at mid-width
    pitch = 2 * math.pi / b.z
    facing = sense * ((pair.length - middle) / b.r_b - free[1]) - (zero[1] - gamma - math.pi)
    other = round(facing / pitch)  # tooth of B
    across = b.r_b * (free[1] + sense * (zero[1] - gamma - math.pi + other * pitch))
    slope = sense * math.tan(a.beta_b)
    ends = sorted([(a.s_tip - middle) / slope, (across - b.s_tip) / slope]) if slope else (-width, width)
    first, last = np.clip([-0.5 * width, 0.5 * width], *ends)  # of the face width, what lies on both flanks
    left = first + (last - first) * np.array([load.slice, load.slice + 1]) / stage.slices
    touching = float(left.mean())
    normal = np.array([math.sin(pair.alpha_wt), sense * math.cos(pair.alpha_wt)])
    foot = a.r_b * np.array([math.cos(pair.alpha_wt), -sense * math.sin(pair.alpha_wt)])
    point = np.append(foot + (middle + slope * touching) * normal, touching)
    n = np.append(normal * math.cos(a.beta_b), -sense * math.sin(a.beta_b))
    turn = np.kron(np.eye(2), about_z(gamma))
    rigid = [turn @ np.concatenate([n, np.cross(point - (x, 0, 0), n)]) for x in (0, pair.a)]
    curvature = math.cos(a.beta_b) * (1 / (middle + slope * touching) + 1 / (across - slope * touching))
    length = float(np.diff(left)[0]) / math.cos(a.beta_b)
    law = _tangent(stage, mesh, curvature, load.force / length) / length
    rolls = (middle + slope * touching, across - slope * touching)
    return Touch(rolls, law, zero, (load.tooth, other), (rigid[0], -rigid[1]), 2 * left / width)


def _tangent(stage: Stage, mesh: EngagementSpec, curvature: float, line: float) -> float:
    """δ′ (m²/N) of both bodies under the line load (N/m): docs/theory.md 2.4, the parabola of narrow contacts too."""
    gears = [stage.bodies[name] for name in mesh.gears]
    yields = [2 * (1 - g.material.poisson_ratio**2) / (math.pi * g.material.youngs_modulus) for g in gears]
    constant = sum(y * (math.log(4 * g.body.strip_half_width) - 1) for y, g in zip(yields, gears, strict=True))
    a, lowest = sum(yields), LEAST_HALF_WIDTH**2 * curvature / (2 * sum(yields))
    held = max(line, lowest)
    slope = constant - 0.5 * a * math.log(2 * a * held / curvature) - 0.5 * a
    return slope + a * (1 - min(line / lowest, 1.0))


def gear_part(stage: Stage, body: Body, touches: Sequence[tuple[Load, Touch, int]], count: int) -> Part:
    """A gear with its bore's node and the slices that it carries; the last of each entry: 0 gear A, 1 gear B. count: of
    width functions."""
    zero = touches[0][1].zero[touches[0][2]]
    seen = np.abs(body.flank.rows).max(axis=(0, 1, 2)) > UNSEEN * np.abs(body.flank.rows).max()
    seen |= (np.abs(body.rows) > UNSEEN * np.abs(body.rows).max(axis=1, keepdims=True)).any(axis=0)
    second = np.flatnonzero(body.flank.part == 2)
    seen[second] = seen[second - 1] = seen[second] | seen[second - 1]
    chosen, degrees, turn = np.flatnonzero(seen), np.arange(count), np.kron(np.eye(2), about_z(zero))
    weights = [weights_between(t.part, degrees)[0] for _, t, _ in touches]
    places = [resampling(body.flank.roll, t.rolls[side], t.rolls[side], 1)[0] for _, t, side in touches]
    teeth = [t.teeth[side] for _, t, side in touches]
    modal, rigid = [turn @ body.rows[:, chosen]], [np.eye(6)]
    for (load, t, side), place, tooth, weight in zip(touches, places, teeth, weights, strict=True):
        row = np.einsum("r,a,ran->n", place, weight, body.flank.rows[load.flank][:, degrees])
        modal.append(on_tooth(body.flank, row[None], tooth, body.flank.teeth)[:, chosen])
        rigid.append(t.rigid[side][None])
    rows, omega = np.vstack(modal), 2 * np.pi * body.frequency[chosen]
    static = np.zeros((6 + len(touches),) * 2)
    static[:6, :6] = turn @ body.static @ turn.T
    for i, (load, _, _) in enumerate(touches):
        own = np.kron(np.eye(2), about_z(zero + 2 * math.pi * teeth[i] / body.flank.teeth))
        to_bore = np.einsum("r,a,rak->k", places[i], weights[i], body.flank.node[load.flank][:, degrees])
        static[6 + i, :6] = static[:6, 6 + i] = own @ to_bore
        for j, (other, _, _) in enumerate(touches):
            offset = (teeth[j] - teeth[i]) % body.flank.static.shape[2]
            block = body.flank.static[load.flank, other.flank, offset][:, :, :count, :count]
            static[6 + i, 6 + j] = np.einsum("r,s,a,b,rsab->", places[i], places[j], weights[i], weights[j], block)
    return Part(
        stiffness=np.diag(np.concatenate([np.zeros(6), omega**2])),
        mass=sl.block_diag(body.total_mass * np.eye(3), body.inertia, np.eye(omega.size)),
        rows=np.hstack([np.vstack(rigid), rows]),
        residual=static - (rows / omega) @ (rows / omega).T,
    )


def weights_between(edges: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """(slices, A): (2a + 1) × mean of P_a over each slice between ascending `edges` on −1 … 1."""
    columns = []
    for a in degrees:
        integral = Legendre.basis(int(a)).integ()(edges)
        columns.append((2 * a + 1) * np.diff(integral) / np.diff(edges))
    return np.stack(columns, axis=1)


def shaft_part(stage: Stage, shaft: ShaftBody, places: Sequence[float]) -> Part:
    """A shaft of finite elements, nodes at `places` (m, in the stage)."""
    origin, m = stage.place(shaft.name, None), shaft.material
    beam = Shaft(
        [Section(s.length, s.outer_diameter, s.bore_diameter) for s in shaft.sections],
        Steel(m.youngs_modulus, m.poisson_ratio, m.density),
        [place - origin for place in places],
    )
    ends = beam.ends(beam.steps[-1] / FINE)
    planes = [bending_matrices(beam, ends)] * 2 + [rod_matrices(beam, ends, turning) for turning in (False, True)]
    stiffness, mass = (sl.block_diag(*[plane[i] for plane in planes]) for i in (0, 1))
    starts = np.cumsum([0, *(len(plane[0]) for plane in planes)])
    rows = np.zeros((6 * len(places), len(mass)))
    for n, place in enumerate(beam.places):
        at = ORDER * int(np.abs(ends - place).argmin())
        for direction, start, sign in (
            (0, starts[0] + 2 * at, 1), (4, starts[0] + 2 * at + 1, 1),
            (1, starts[1] + 2 * at, 1), (3, starts[1] + 2 * at + 1, -1),
            (2, starts[2] + at, 1), (5, starts[3] + at, 1),
        ):  # fmt: skip
            rows[6 * n + direction, start] = sign
    return Part(stiffness, mass, rows, np.zeros((len(rows),) * 2))


def frequencies(
    stage: Stage, bodies: Sequence[Body], loads: Sequence[Load], turned: Mapping[str, float], count: int
) -> np.ndarray:
    """(count,) lowest frequencies, Hz. turned: angle (rad) of every rotor; every seat is at a gear's mid-width."""
    touches = []
    for load in loads:
        mesh = stage.engagements[load.mesh]
        a, b = (turned[stage.rotor_of(name)] for name in mesh.gears)
        touches.append(touch(stage, mesh, load, (a, b)))
    parts, first, node_of, contact_of = [], 0, {}, {}
    functions = min(body.flank.width_functions for body in bodies)
    for gear, body in zip(stage.gears, bodies, strict=True):
        own = [(i, stage.engagements[x.mesh].gears.index(gear.name)) for i, x in enumerate(loads)
               if gear.name in stage.engagements[x.mesh].gears]  # fmt: skip
        parts.append(gear_part(stage, body, [(loads[i], touches[i], side) for i, side in own], functions))
        node_of[gear.name, stage.place(gear.name, None)] = first
        contact_of |= {(i, side): first + 6 + n for n, (i, side) in enumerate(own)}
        first += len(parts[-1].rows)
    for shaft in (body for body in stage.bodies.values() if isinstance(body, ShaftBody)):
        places = sorted({
            *(s.at if s.at is not None else stage.place(s.body, None) for s in stage.supports
              if shaft.name in (s.body, s.to)),
            *(port.at for port in stage.ports.values() if port.body == shaft.name),
        })  # fmt: skip
        parts.append(shaft_part(stage, shaft, places))
        node_of |= {(shaft.name, place): first + 6 * n for n, place in enumerate(places)}
        first += len(parts[-1].rows)
    links = [([(contact_of[i, 0], 1.0), (contact_of[i, 1], 1.0)], t.law) for i, t in enumerate(touches)]
    for support in stage.supports:
        at = support.at if support.at is not None else stage.place(support.body, None)
        for field, directions in STIFFNESS.items():
            stiffness = getattr(support, field)
            for direction in directions if stiffness is not None else ():
                ends = [(node_of[support.body, at] + direction, 1.0)]
                ends += [(node_of[support.to, at] + direction, -1.0)] if support.to else []
                links.append((ends, 0.0 if stiffness == "rigid" else 1 / stiffness))
    for port in stage.ports.values():
        at = port.at if port.at is not None else stage.place(port.body, None)
        links.append(([(node_of[port.body, at] + 5, 1.0)], 1 / port.k))
    fold = np.zeros((len(links), first))
    for row, (ends, _) in zip(fold, links, strict=True):
        for place, sign in ends:
            row[place] += sign
    compliance = fold @ sl.block_diag(*[part.residual for part in parts]) @ fold.T + np.diag([c for _, c in links])
    rows = fold @ sl.block_diag(*[part.rows for part in parts])
    scale = 1 / np.sqrt(np.diag(compliance))  # forces and moments differ by powers of ten
    inner = np.linalg.solve(scale[:, None] * compliance * scale, scale[:, None] * rows)
    stiffness = sl.block_diag(*[part.stiffness for part in parts]) + (scale[:, None] * rows).T @ inner
    mass = sl.block_diag(*[part.mass for part in parts])
    squared = sl.eigh(0.5 * (stiffness + stiffness.T), mass, eigvals_only=True, subset_by_index=[0, count - 1])
    return np.sqrt(np.maximum(squared, 0)) / (2 * math.pi)
