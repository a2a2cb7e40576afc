"""How large the terms of turning axes are in a stage, those that the kernel computes and those that it leaves out: at
the largest speed and load, from the formula of each (docs/theory.md 3.11).

A gear's numbers need its file's group "spin" (`Body.spin`); what has none is not listed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearfmu.body import Body
from gearfmu.stage.assembly.assemble import stage_group
from gearfmu.stage.assembly.ground_part import turn_rates, whirl_rows
from gearfmu.stage.assembly.groups import Group
from gearfmu.stage.assembly.observed import gear_bodies
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_shape
from gearfmu.stagefile.forms.turning import turns

WHIRL_BAND = 15e3  # Hz


@dataclass(frozen=True)
class GearInertia:
    """Of a gear at its largest speed (rad/s) and load: whirl: largest 2Ωg/ω below the cut of level fast; stiffening:
    largest Δω/ω there; growth, deflection (m): centrifugal stretch of a flank at its middle, and what the tooth yields
    there; by_load, by_speed: ΔJ/J."""

    name: str
    speed: float
    whirl: float
    stiffening: float
    growth: float
    deflection: float
    by_load: float
    by_speed: float


def largest_speeds(stage: Stage) -> dict[str, float]:
    """rad/s, of every rotor that is geared to the first port: the stage turns so fast that one engagement has its
    speed_max, in the axes in which it stands."""
    per = {name: float(speed) for name, speed in turns(stage, next(iter(stage.ports))).items()}
    units = []
    for mesh in stage.engagements:
        rotor = stage.rotor_of(mesh.gears[0])
        relative = per.get(rotor, 0.0) - per.get(stage.rotors[rotor].carried_by or "", 0.0)
        units += [mesh.speed_max / abs(relative)] if relative else []
    return {name: speed * min(units, default=0.0) for name, speed in per.items()}


def gear_inertia(name: str, body: Body, speed: float, force: float, cut: float) -> GearInertia | None:
    """Of a reduced gear under a normal force (N), modes up to `cut` (Hz); None where its file does not tell."""
    rates, spin = turn_rates(body, np.arange(body.modes)), body.spin
    if rates is None or spin is None:
        return None
    omega, low = 2 * np.pi * body.frequency, body.frequency < cut
    middle, polar = len(body.toothed.roll) // 2, body.inertia[2, 2]
    growth = float(np.abs(spin.growth[0, middle, 0]))
    return GearInertia(
        name=name,
        speed=speed,
        whirl=float((2 * speed * np.abs(rates) / omega)[low].max(initial=0.0)),
        stiffening=float((0.5 * np.abs(spin.stiffening) * (speed / omega) ** 2)[low].max(initial=0.0)),
        growth=growth * speed**2,
        deflection=float(body.toothed.static[0, 0, 0, middle, middle, 0, 0]) * force,
        by_load=2 * growth * force / polar,
        by_speed=spin.inertia * speed**2 / polar,
    )


def inertia_terms(stage: Stage, bodies: Mapping[str, Body]) -> list[GearInertia]:
    """Of the gears of a stage whose files tell; bodies: by name (`observed.gear_bodies`)."""
    speeds, force = largest_speeds(stage), largest_forces(stage)
    found = [
        gear_inertia(name, body, abs(speeds.get(stage.rotor_of(name), 0.0)), force[name], stage.levels.fast_cut)
        for name, body in bodies.items()
        if name in force
    ]
    return [gear for gear in found if gear is not None]


def largest_forces(stage: Stage) -> dict[str, float]:
    """N, normal to the flanks, on every gear: from torque_max of its engagements."""
    forces: dict[str, float] = {}
    gears = {gear.name: gear for gear in stage.gears}
    for mesh in stage.engagements:
        shape = gear_shape(gears[mesh.gears[0]])
        for name in mesh.gears:
            forces[name] = max(mesh.torque_max / shape.r_b, forces.get(name, 0.0))
    return forces


def whirling(stage: Stage, bodies: Sequence[Body]) -> tuple[float, float, list[str]]:
    """At the largest speeds `whirl_shift` below WHIRL_BAND, the largest `GearInertia.whirl`, and gears whose files do
    not tell; bodies as of `assemble`."""
    toothed = gear_bodies(stage, bodies)
    coupled = max((gear.whirl for gear in inertia_terms(stage, toothed)), default=0.0)
    silent = sorted({body.name for body in toothed.values() if body.spin is None})
    return whirl_shift(stage, stage_group(stage, bodies), WHIRL_BAND), coupled, silent


def whirl_shift(stage: Stage, group: Group, cut: float) -> float:
    """Largest |Δω/ω| of the ground oscillators up to `cut` (Hz) by gyroscopic forces, at the largest speeds."""
    known = largest_speeds(stage)
    speeds = [known.get(name, 0.0) for name in stage.rotors]
    low = group.omega < 2 * math.pi * cut
    omega, coupling = group.omega[low], np.zeros(2 * (int(low.sum()),))
    for rotor, (x, y) in zip(*whirl_rows(group), strict=True):
        coupling += speeds[rotor] * (np.outer(y[low], x[low]) - np.outer(x[low], y[low]))
    matrix = np.block([[np.zeros_like(coupling), np.diag(omega)], [-np.diag(omega), -2 * coupling]])
    whirling = np.sort(np.abs(np.linalg.eigvals(matrix).imag))[::2]
    return float(np.abs(whirling / omega - 1).max(initial=0.0))
