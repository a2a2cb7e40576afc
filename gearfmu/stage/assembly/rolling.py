"""Rolling bearings of a stage at its operating torque: load and stiffness by turns, until both agree.

With stiffnesses K_k of all bearings the kernel's statics give the forces B on them, and with that the load f of the
shafts at the bearings, where H is the displacement there per unit force (both from the ground group),

    e = K_k⁻¹ B,    f = H⁻¹ e,    K_s = H⁻¹ − K_k

K_s is the stiffness of the shafts alone. The bearings then stand where U(e) + ½ eᵀ K_s e − fᵀ e is least, and K_k+1 is
the second derivative of U there. Forces of a shaft on two bearings hardly depend on stiffness: about three iterations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sl

from gearfmu.bearing.catalogue import Filled, filled_ball, filled_roller
from gearfmu.bearing.law import Rolling, Row
from gearfmu.bearing.rest import NoRestError, Rest, least, preloaded, scales, state
from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.forms.turning import shafts_of, turns
from gearfmu.stagefile.tables.connections import BallBearing, RollerBearing, SupportSpec

Tangents = Mapping[str, np.ndarray]
BALL_NUMBERS = ("balls", "ball_diameter", "pitch_diameter", "inner_groove", "outer_groove")
ROLLER_NUMBERS = ("rollers", "roller_diameter", "roller_length", "pitch_diameter")
SETTLED = 2e-3  # largest relative change of a stiffness that ends the iterations
_ITERATIONS = 12
_CAGE = 8  # positions over which bearings are averaged
_POSITIONS = 4  # of the meshes over their longest pitch
_FLOOR = 1e-3  # of the largest stiffness: the least in any direction
_LOOSE = 1e5  # N/m: the least stiffness of a bearing that carries nothing
_FIRST = 1e-5  # m: interference that stands for a load before one is known


@dataclass(frozen=True)
class Statics:
    """What a model with some tangents says of its supports. names: (s,), one a direction; compliance: (s, s) m/N …, H,
    elongation of the supports per unit force across them, of the ground group; blob: of the model."""

    names: Sequence[str]
    compliance: np.ndarray
    blob: bytes

    @classmethod
    def of(cls, sections: Mapping[str, np.ndarray | str], blob: bytes) -> Statics:
        """From the sections of the blob."""
        found = (np.asarray(sections[f"{name}0"]) for name in ("damper_rows", "omega_ground", "kappa"))
        rows, omega, kappa = found
        own = np.diag(np.asarray(sections["support_compliance0"]))
        own = own + np.asarray(sections.get("support_coupling0", np.zeros_like(own)))
        held = omega > 0
        oscillators = (rows[:, held] / omega[held] ** 2) @ rows[:, held].T
        return cls(str(sections["support_names"]).split("|"), oscillators + own - own @ kappa @ own, blob)


@dataclass(frozen=True)
class Settled:
    """Bearings at a torque. torque: N·m on the input; bearings: by the name of their support; rests: where they stand,
    displacements counted from the assembled stage without load; tangents: (d, d) stiffness of the linear model, d as
    `Rolling.directions`; iterations: that were needed."""

    torque: float
    bearings: dict[str, Rolling]
    rests: dict[str, Rest]
    tangents: dict[str, np.ndarray]
    iterations: int


def filled(spec: BallBearing | RollerBearing) -> Filled:
    """The law of a bearing of a stage file, and which of its numbers are proposed."""
    fixed = {"contact_angle": spec.contact_angle, "clearance": spec.clearance}
    if isinstance(spec, BallBearing):
        known = {name: value for name, value in spec if name in BALL_NUMBERS}
        return filled_ball(spec.bore, spec.outside, known, **fixed)
    known = {name: value for name, value in spec if name in (*ROLLER_NUMBERS, "width")}
    return filled_roller(spec.bore, spec.outside, known, **fixed)


def _bearing(stage: Stage, support: SupportSpec) -> Rolling:
    """ModelError for a preload that it cannot bear."""
    spec = stage.bearings[str(support.bearing)]
    law, side = filled(spec).law, -1 if support.carries == "-z" else 1
    places = [(0.0, side)] if support.span is None else [(-support.span / 2, side), (support.span / 2, -side)]
    try:
        rows = tuple(preloaded(Row(law, offset, way), spec.preload) for offset, way in places)
    except NoRestError as error:
        raise ModelError(f"bearing {support.bearing} of {support.name}: {error}") from error
    return Rolling(rows, _CAGE)


def settle(stage: Stage, torque: float, statics_with: Callable[[Tangents], Statics]) -> Settled:
    """The bearings of a stage under a torque on its input, N·m. statics_with: of the stage with these tangents.
    ModelError where a bearing cannot carry its load, or no stiffness is found."""
    bearings = {support.name: _bearing(stage, support) for support in stage.supports if support.bearing is not None}
    tangents = {name: _floored(bearing, _tight(bearing)) for name, bearing in bearings.items()}
    rests: dict[str, Rest] = {}
    for iteration in range(1, _ITERATIONS + 1):
        rests = _loaded(stage, bearings, tangents, statics_with(tangents), torque)
        found = {name: _floored(bearings[name], own.stiffness) for name, own in rests.items()}
        change = max(_change(bearings[name], found[name], tangents[name]) for name in bearings)
        tangents = found
        if change < SETTLED:
            return Settled(torque, bearings, rests, tangents, iteration)
    raise ModelError(
        f"{stage.name}: loads and stiffnesses of its bearings still change by {100 * change:.2g} % after {_ITERATIONS} "
        "iterations: give them less clearance, or a preload"
    )


def _tight(bearing: Rolling) -> np.ndarray:
    """(5, 5): stiffness with a little interference all round, before a load is known."""
    rows = tuple(replace(row, law=replace(row.law, clearance=-_FIRST)) for row in bearing.rows)
    return replace(bearing, rows=rows).stiffness(np.zeros(5))


def _floored(bearing: Rolling, stiffness: np.ndarray) -> np.ndarray:
    """(d, d): the stiffness in the directions that carry, nowhere less than the floor."""
    free = list(bearing.directions)
    scale = scales(bearing)[free]
    values, vectors = np.linalg.eigh(stiffness[np.ix_(free, free)] * np.outer(scale, scale))
    raised = np.maximum(values, max(_FLOOR * float(values[-1]), _LOOSE))
    found = (vectors * raised) @ vectors.T / np.outer(scale, scale)
    return 0.5 * (found + found.T)


def _change(bearing: Rolling, new: np.ndarray, old: np.ndarray) -> float:
    """Largest change of a stiffness, relative to the largest of all."""
    scale = np.outer(*2 * [scales(bearing)[list(bearing.directions)]])
    return float(np.abs((new - old) * scale).max() / np.abs(new * scale).max())


def _loaded(
    stage: Stage, bearings: Mapping[str, Rolling], tangents: Tangents, statics: Statics, torque: float
) -> dict[str, Rest]:
    """Where the bearings stand, of a model with these tangents."""
    names = [name.split(".")[1] for name in statics.names]
    own = [np.array([i for i, name in enumerate(names) if name == support]) for support in bearings]
    every = np.concatenate(own)
    scale = np.concatenate([scales(b)[list(b.directions)] for b in bearings.values()])
    both = np.outer(scale, scale)
    springs = sl.block_diag(*[tangents[name] for name in bearings])
    force = np.zeros(len(names)) if torque == 0.0 else support_forces(stage, statics.blob, torque)
    spread = np.linalg.inv(statics.compliance[np.ix_(every, every)] / both) / both
    at = np.linalg.solve(springs * both, force[every] * scale) * scale
    load, shafts = spread @ at, spread - springs
    shafts = 0.5 * (shafts + shafts.T)
    ends = np.cumsum([0, *(len(part) for part in own)])

    def each(e: np.ndarray) -> list[tuple[Rolling, np.ndarray]]:
        return [(b, b.placed(e[i:j])) for b, i, j in zip(bearings.values(), ends, ends[1:], strict=False)]

    def carried(e: np.ndarray) -> np.ndarray:
        return np.concatenate([b.force(d)[list(b.directions)] for b, d in each(e)])

    def stiff(e: np.ndarray) -> np.ndarray:
        return sl.block_diag(*[b.stiffness(d)[np.ix_(b.directions, b.directions)] for b, d in each(e)])

    try:
        found = least(
            lambda e: sum(b.energy(d) for b, d in each(e)) + 0.5 * e @ shafts @ e - load @ e,
            lambda e: carried(e) + shafts @ e - load,
            lambda e: stiff(e) + shafts,
            at,
            scale,
            float(np.abs(force[every] * scale).max(initial=1.0)),
        )
    except NoRestError as error:
        raise ModelError(
            f"{stage.name}: its bearings cannot carry {torque:g} N·m on the input: one is pushed to the side that it "
            "does not carry, or nothing holds a shaft along its axis"
        ) from error
    return {name: state(b, d) for name, (b, d) in zip(bearings, each(found), strict=True)}


def support_forces(stage: Stage, blob: bytes, torque: float) -> np.ndarray:
    """(s,) N, N·m: static forces on the supports, linear in their springs, under a torque (N·m) on the input; mean over
    the longest pitch. blob: of the model."""
    kernel = Kernel(blob, {"level": 0.0})
    kernel.prepare()
    pitch, total = _longest_pitch(stage), 0.0
    for part in range(_POSITIONS):
        kernel.transmission(pitch * part / _POSITIONS, torque)
        linear = kernel.linearise()
        held = linear.omega > 0
        moved = np.zeros(linear.omega.size)
        moved[held] = (linear.rows.T @ linear.force)[held] / linear.omega[held] ** 2
        total = total + linear.support_rows @ moved + linear.support_forces @ linear.force
    return np.asarray(total) / _POSITIONS


def _longest_pitch(stage: Stage) -> float:
    """Angle of the output, rad, in one pitch of the mesh that meets most rarely."""
    shafts = shafts_of(stage)
    turning = turns(stage, shafts.input)
    angles = []
    for mesh in stage.engagements:
        speed = float(turning.get(stage.rotor_of(mesh.gears[0]), 0))
        if speed:
            angles.append(2 * math.pi / mesh_shape(stage, mesh).gears[0].z / abs(speed * shafts.ratio))
    return max(angles)
