"""The engagements of a stage for the model blob: positions, backlash, limits, how the teeth stand at φ = 0; of nodal
contact the nodes of every gear's flanks and the penalty of every engagement; of friction and film the starts of the
kernel's parameters, and what a film can stop."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from gearfmu.errors import ModelError
from gearfmu.geometry import PairGeometry
from gearfmu.geometry.mesh import RingMesh, contact_modulus, half_width
from gearfmu.quantities import kernel_limits, kernel_number
from gearfmu.stagefile.forms.general import EngagementSpec, Stage, ToothedBody
from gearfmu.stagefile.forms.shapes import MeshShape, face_width, mesh_shape, toothed

LONGEST = {"pair": 7.5e-6, "helical": 5e-6, "shared": 12.5e-6}  # s: default steps (docs/decisions/kernel.md)
SAME_ANGLE = 1e-9  # rad


def mesh_axes(stage: Stage, mesh: EngagementSpec) -> tuple[tuple[float, float], tuple[float, float]]:
    """Positions (x, y) m of A and B, in the axes of what carries them, where their teeth are as they should be."""
    a, b = (stage.rotors[stage.rotor_of(name)].axis for name in mesh.gears)
    return a, b


def tooth_phases(stage: Stage) -> dict[str, float]:
    """Angle (rad) of tooth 0 of every gear at φ = 0: in every engagement the drive flanks of tooth 0 of both gears
    touch; of a ring it is the flanks of space 0.

    A gear that no engagement before has placed has its tooth 0 on +x. With γ the direction from A to B, rolling both
    gears by equal lengths r_bA dα = −r_bB dβ from the pair by itself gives φ_B = γ + φ_B⁰ − (φ_A − γ) r_bA/r_bB.
    ModelError where a gear with several engagements cannot have all of them so: its axes do not fit its teeth.
    """
    return _placed(stage)[0]


def _placed(stage: Stage) -> tuple[dict[str, float], list[int]]:
    """`tooth_phases`, and of every engagement the tooth of B whose drive flank touches that of A's tooth 0: not 0 where
    engagements close a loop, as those of sun, planets and ring."""
    phases: dict[str, float] = {}
    shifts = []
    for mesh in stage.engagements:
        pair = mesh_shape(stage, mesh)
        gamma = direction_of(pair, *mesh_axes(stage, mesh))
        a, b = mesh.gears
        if b in phases and a not in phases:
            phases[a] = _phase_of_a(pair, phases[b], gamma)
        first = phases.setdefault(a, 0.0)
        fitting = _phase_of_b(pair, first, gamma)
        pitch = 2 * math.pi / pair.gears[1].z
        apart = phases.setdefault(b, fitting) - fitting
        off = math.remainder(apart, pitch)
        shifts.append(round((off - apart) / pitch))
        if abs(off) > SAME_ANGLE:
            raise ModelError(
                f"engagement '{mesh.name}': with {a} and {b} where their other engagements put them, flanks "
                f"miss each other by {1e3 * off * pair.gears[1].r_b:.3g} mm: move an axis"
            )
    return {gear.name: phases.get(gear.name, 0.0) for gear in stage.gears}, shifts


def direction_of(pair: MeshShape, a: Sequence[float], b: Sequence[float]) -> float:
    """Angle (rad) from A's axis to B's, of a ring from its own to A's: above −π; π along −x, whichever way that is
    rounded."""
    gamma = math.atan2(pair.side * (b[1] - a[1]), pair.side * (b[0] - a[0]))
    return gamma + 2 * math.pi if gamma < SAME_ANGLE - math.pi else gamma


def _phase_of_b(pair: MeshShape, first: float, gamma: float) -> float:
    """Angle (rad) of B that fits the angle `first` of A; gamma: `direction_of`."""
    if isinstance(pair, RingMesh):
        return pair.ring_phase(first, gamma)
    return gamma + pair.wheel_phase - (first - gamma) * pair.gears[0].r_b / pair.gears[1].r_b


def _phase_of_a(pair: MeshShape, second: float, gamma: float) -> float:
    """The inverse of `_phase_of_b`."""
    if isinstance(pair, RingMesh):
        return pair.planet_angle(second, gamma)
    return gamma - (second - gamma - pair.wheel_phase) * pair.gears[1].r_b / pair.gears[0].r_b


def stage_sections(stage: Stage) -> dict[str, Any]:
    """Sections of names, limits and engagements."""
    gears = [gear.name for gear in stage.gears]
    engaged, numbers, directions, periods = [], [], [], []
    for mesh in stage.engagements:
        pair, (a, b) = mesh_shape(stage, mesh), mesh_axes(stage, mesh)
        engaged.append([gears.index(mesh.gears[0]), gears.index(mesh.gears[1]), pair.side, _coast_shift(pair)])
        force = mesh.torque_max / (pair.gears[0].r_b * math.cos(pair.gears[0].beta_b))
        rotors = [stage.rotors[stage.rotor_of(name)] for name in mesh.gears]
        place = [at + off for rotor in rotors for at, off in zip(rotor.axis, rotor.offset, strict=True)]
        numbers.append([*place, mesh.backlash, pair.nominal_backlash, mesh.damping, force, *_tilt(mesh, a, b)])
        directions.append(direction_of(pair, a, b))
        periods.append(2 * math.pi / (mesh.speed_max * pair.gears[0].z))
    shifts = _placed(stage)[1]
    looped = {"tooth_shift": np.array(shifts, np.int32)} if any(shifts) else {}
    return (
        looped
        | _frame_section(stage)
        | {
            "name": stage.name,
            "rotor_names": "|".join(stage.rotors),
            "engagement_names": "|".join(mesh.name for mesh in stage.engagements),
            "limits": np.array([stage.levels.fast_cut, stage.levels.standard_cut, longest_step(stage), min(periods)]),
            "engaged": np.array(engaged, np.int32),
            "engagement": np.array(numbers),
            "direction": np.array(directions),
        }
    )


def longest_step(stage: Stage) -> float:
    """Longest default step (s), by its error: meshes that share a rotor hit it less hard than a pair alone, and contact
    lines of helical gears begin and end at tip edges all the time."""
    rotors = [tuple(map(stage.rotor_of, mesh.gears)) for mesh in stage.engagements]
    uses = Counter(rotor for both in rotors for rotor in both)
    longest = []
    for mesh, both in zip(stage.engagements, rotors, strict=True):
        alone = "helical" if mesh_shape(stage, mesh).gears[0].beta_b else "pair"
        longest.append(LONGEST["shared" if max(uses[rotor] for rotor in both) > 1 else alone])
    return min(longest)


def _frame_section(stage: Stage) -> dict[str, Any]:
    """Rotors in whose axes the others stand; nothing where all stand on the ground."""
    rotors, carriers = list(stage.rotors), [rotor.carried_by for rotor in stage.rotors.values()]
    if not any(carriers):
        return {}
    return {"frame": np.array([-1 if name is None else rotors.index(name) for name in carriers], np.int32)}


def _tilt(mesh: EngagementSpec, a: Sequence[float], b: Sequence[float]) -> tuple[float, float]:
    """Angles (rad) about x and y of B's axis against A's: f_Sigma delta along the line of the centres, f_Sigma beta
    across it, both over the span (ISO/TR 10064-3)."""
    if mesh.misalignment is None:
        return 0.0, 0.0
    along, across = (f / mesh.misalignment.span for f in (mesh.misalignment.in_plane, mesh.misalignment.out_of_plane))
    gamma = math.atan2(b[1] - a[1], b[0] - a[0])
    x, y = along * math.cos(gamma) - across * math.sin(gamma), along * math.sin(gamma) + across * math.cos(gamma)
    return -y, x  # the axis e_z + (x, y) is e_z turned by (-y, x)


def _coast_shift(geometry: MeshShape) -> int:
    """The wheel's tooth number that faces the coast flank of the pinion's tooth 0: the one whose gap is the nominal
    backlash. In a ring tooth 0 stands in space 0."""
    if not isinstance(geometry, PairGeometry):
        return 0
    a, b = geometry.gears
    t = geometry.alpha_wt
    gaps = {
        shift: geometry.length
        + a.r_b * (-a.psi_b - t)
        + b.r_b * (geometry.wheel_phase + shift * 2 * math.pi / b.z - b.psi_b - t - math.pi)
        for shift in (-1, 0, 1)
    }
    return min(gaps, key=lambda shift: abs(gaps[shift]))


SHARE_OF_A = {"both": 0.5, "a": 1.0, "b": 0.0}
MOST = int(kernel_limits()["NODES"][1])  # nodes that the kernel takes along or across
STIFFEST = kernel_limits()["PENALTY"][1]  # N/m³ that it takes


def nodal_sections(stage: Stage) -> dict[str, Any]:
    """Sections of nodes and penalties."""
    numbers = [[mesh_penalty(stage, mesh), SHARE_OF_A[stage.nodal.nodes_of]] for mesh in stage.engagements]
    nodes = {f"nodes{i}": np.array(flank_nodes(stage, gear), np.int32) for i, gear in enumerate(stage.gears)}
    return {"nodal": np.array(numbers)} | nodes


def flank_nodes(stage: Stage, gear: ToothedBody) -> tuple[int, int]:
    """Nodes along a flank and across the face width: as said, or corners and middles of the edges of the gear's own
    mesh."""
    nodal, mesh = stage.nodal, gear.body.mesh
    own = (2 * mesh.scaled(count) + 1 for count in (mesh.flank, mesh.width))
    along, across = (given or min(count, MOST) for given, count in zip((nodal.along, nodal.across), own, strict=True))
    return along, across


def mesh_penalty(stage: Stage, mesh: EngagementSpec) -> float:
    """Penalty stiffness (N/m³) of an engagement: as said, or of "hertz" 3 pi E*/(8 b).

    An elastic foundation of that stiffness has Hertz's half-width b under the same load: that of torque_max on one
    tooth pair at the pitch point. (Johnson, Contact Mechanics, 4.3: K/h of a line contact.)
    """
    if not isinstance(stage.nodal.penalty, str):
        return stage.nodal.penalty
    gears, shape = [toothed(stage, name) for name in mesh.gears], mesh_shape(stage, mesh)
    a, b = (gear.material for gear in gears)
    e_star = contact_modulus((a.youngs_modulus, b.youngs_modulus), (a.poisson_ratio, b.poisson_ratio))
    first = shape.path["C"]
    second = shape.opposite(first)
    radius = first * second / shape.length / math.cos(shape.gears[0].beta_b)
    load = mesh.torque_max / shape.gears[0].r_b / face_width(stage, mesh)
    return min(3 * math.pi * e_star / (8 * half_width(load, radius, e_star)), STIFFEST)


REACH = kernel_number("FILM_REACH")  # m: flanks further apart know no film
LAWS = ("constant", "benedict_kelley", "iso_tr_14179")  # of friction, in the kernel's order
NEXT_TO_NONE = 1e-4  # Pa·s: of an engagement that says nothing beside one that does


def friction_starts(stage: Stage) -> dict[str, float]:
    """Parameter → start. Empty where no engagement says anything about friction; else it is on, and an engagement that
    says nothing has none."""
    if not any(mesh.friction for mesh in stage.engagements):
        return {}
    starts = {"effect.friction": 1.0}
    for mesh in stage.engagements:
        prefix = f"{mesh.name}." if len(stage.engagements) > 1 else ""
        own = mesh.friction
        if own is None:
            starts[f"{prefix}friction_coefficient"] = 0.0
            continue
        starts |= {
            f"{prefix}friction_law": float(LAWS.index(own.law)),
            f"{prefix}friction_coefficient": own.coefficient,
            f"{prefix}oil_viscosity": own.viscosity,
            f"{prefix}flank_roughness": own.roughness,
        }
    return starts


def film_starts(stage: Stage) -> dict[str, float]:
    """Parameter → start. Empty where no engagement says anything about a film; else it is on, and an engagement that
    says nothing has oil of next to no viscosity.

    ModelError where friction and film of an engagement name two viscosities: there is one oil."""
    if not any(mesh.film for mesh in stage.engagements):
        return {}
    starts = {"effect.film": 1.0}
    for mesh in stage.engagements:
        prefix = f"{mesh.name}." if len(stage.engagements) > 1 else ""
        rubs = mesh.friction is not None and mesh.friction.law != "constant"
        if mesh.film is None:
            if not rubs:
                starts[f"{prefix}oil_viscosity"] = NEXT_TO_NONE
            continue
        if rubs and mesh.friction is not None and mesh.friction.viscosity != mesh.film.viscosity:
            raise ModelError(
                f"engagement {mesh.name}: friction says oil of {mesh.friction.viscosity:g} Pa·s, film of "
                f"{mesh.film.viscosity:g} Pa·s; state the same viscosity in both"
            )
        starts |= {f"{prefix}oil_viscosity": mesh.film.viscosity, f"{prefix}film_roughness": mesh.film.roughness}
    return starts


def film_stop(stage: Stage, mesh: EngagementSpec) -> float:
    """`film_impulse` of an engagement with a film from REACH on, spur teeth at the pitch point."""
    assert mesh.film is not None
    pair, internal = mesh_shape(stage, mesh), stage.internal(mesh)
    a, b = (gear.r_b for gear in pair.gears)
    first, second = (pair.length * r_b / (b - a if internal else a + b) for r_b in (a, b))
    radius = first * second / (second - first if internal else first + second)
    return film_impulse(REACH, mesh.film.viscosity, mesh.film.roughness, radius, face_width(stage, mesh))


def film_impulse(gap: float, viscosity: float, roughness: float, radius: float, width: float) -> float:
    """∫ c dd from flanks that touch to a gap (m), N·s: momentum that the film takes on the way, docs/theory.md (8r)."""
    gap = min(gap, REACH)
    factor = 3 * math.sqrt(2) * math.pi * viscosity * width * radius**1.5
    far = (REACH + roughness) ** -1.5
    return factor * (2 * roughness**-0.5 - 2 * (gap + roughness) ** -0.5 - gap * far)
