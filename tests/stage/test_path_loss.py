"""What friction takes from elastic gears in motion against the integral over the path of contact, for every kind of
stage: statics without friction say how the teeth share the load on the path."""

from __future__ import annotations

import math

import numpy as np
import pytest

import gearfmu as gf
from gearfmu.geometry.planetary import RingMesh
from gearfmu.spec.forms.shapes import mesh_shape
from gearfmu.spec.forms.turning import meshings, turns
from gearfmu.stage import StageModel, Steady, simulate
from gearfmu.stage.build.meshes import direction_of, mesh_axes, tooth_phases
from gearfmu.stage.run.te import statics_of

MU, STEP, SETTLES, PITCHES, POSITIONS = 0.01, 2e-5, 5e-3, 2, 64


def by_the_path(model: StageModel, engagement: str, torque: float, speed: float) -> float:
    """µ Σ λ |v| over all slices of all tooth pairs, mean over a pitch, W: v by the speeds of gears that roll evenly.
    The gears have their backlash by thinner teeth, each by half of what is beyond the backlash of its own numbers:
    where coast flanks touch, the length of roll is shorter by that much."""
    stage = model.stage
    number, mesh = next((i, m) for i, m in enumerate(stage.engagements) if m.name == engagement)
    shape, meshing, kernel = mesh_shape(stage, mesh), meshings(stage)[engagement], statics_of(model)
    a, b = shape.gears
    rate, rolls = (float(meshing.relative(turns(stage, port))) for port in (model.shafts.input, model.shafts.output))
    place = tooth_phases(stage)[mesh.gears[0]] - direction_of(shape, *mesh_axes(stage, mesh))
    place += wound_up(model, mesh.gears[0], meshing.carrier, torque)
    slices, width = int(kernel.get("slices")), min(stage.bodies[name].face_width for name in mesh.gears)
    lean = math.tan(a.beta_b) * width * ((np.arange(slices) + 0.5) / slices - 0.5)
    thinned = 0.5 * (mesh.backlash - shape.nominal_backlash) * math.cos(shape.alpha_wt)
    pitch, total = 2 * math.pi / a.z, 0.0
    for turned in pitch * np.arange(POSITIONS) / POSITIONS:
        state = kernel.transmission(turned / rolls, torque, number)
        for (flank, tooth), loads in state.forces.items():
            sense = -1 if flank else 1
            roll = a.r_b * (sense * (turned + place + tooth * pitch) + a.psi_b + shape.alpha_wt) + sense * lean
            roll -= thinned if flank else 0.0
            total += np.array(loads) @ np.abs(roll - shape.path["C"])
    ratio = a.r_b / b.r_b * (-1 if isinstance(shape, RingMesh) else 1)
    return MU * total / POSITIONS * (1 + ratio) * abs(rate) * speed


def wound_up(model: StageModel, gear: str, carrier: str | None, torque: float) -> float:
    """Angle (rad) of a gear under load on its path, where the output's bore is at 0."""
    driven = model.driven_by_springs()
    kernel = driven.kernel(level=0.0)
    for name, value in Steady(driven, 0.0, torque)(0.0).items():
        kernel.set(name, value)
    kernel.initialize()
    rotors = (model.stage.rotor_of(gear), *([carrier] if carrier else []))
    return kernel.get(f"{rotors[0]}.gear.phi") - sum(kernel.get(f"{rotor}.gear.phi") for rotor in rotors[1:])


def in_motion(model: StageModel, engagements: tuple[str, ...], torque: float, speed: float) -> list[float]:
    """Mean power of friction of a run at level fast over whole pitches, W."""
    driven, known, turning = model.driven_by_springs(), meshings(model.stage), turns(model.stage, model.shafts.input)
    law = {name: MU for name in model.kernel().variables if name.endswith("friction_coefficient")}
    pitches = [2 * math.pi / known[m].teeth / abs(float(known[m].relative(turning)) * speed) for m in engagements]
    span = PITCHES * max(pitches)
    settings = {"level": 1.0, "effect.friction": 1.0, **law}
    trace = simulate(driven, Steady(driven, speed, torque), math.ceil((SETTLES + span) / STEP) * STEP, STEP, settings)
    assert trace["solver.retried_steps"][-1] == 0
    whole = [pitch * math.floor(span / pitch * (1 + 1e-9)) for pitch in pitches]
    ends = [np.array([SETTLES, SETTLES + time]) for time in whole]
    lost = [trace[f"{mesh}.friction_loss"] for mesh in engagements]
    return [float(np.ptp(np.interp(e, trace.time, x)) / np.ptp(e)) for e, x in zip(ends, lost, strict=True)]


@pytest.mark.parametrize(
    ("name", "torque", "speed", "engagements"),
    [
        ("helical_demo", 150.0, 20.0, ("mesh",)),
        pytest.param("two_stage", 150.0, 20.0, ("stage1", "stage2"), marks=pytest.mark.full),
        pytest.param("planetary54", 600.0, 30.0, ("sun_planet1", "ring_planet1"), marks=pytest.mark.full),
    ],
)
def test_elastic_gears_lose_the_integral_over_the_path(
    name: str, torque: float, speed: float, engagements: tuple[str, ...]
) -> None:
    """Within 0.5 %; the second mesh of the train carries on coast flanks. The coefficient is so small that friction
    hardly changes the load of the next mesh, and that planets hardly swing where it changes sides."""
    model = gf.assemble(name)
    for mesh, power in zip(engagements, in_motion(model, engagements, torque, speed), strict=True):
        path = by_the_path(model, mesh, torque, speed)
        print(f"{name} {mesh}: {power:.4f} W, by the path {path:.4f} W ({power / path - 1:+.2%})")
        assert power == pytest.approx(path, rel=0.005)
