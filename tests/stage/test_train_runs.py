"""Trains at rest: ratio and torque through the meshes, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from driven import begun

from gearfmu.errors import ModelError, SpecError
from gearfmu.stage import StageModel, Steady, loaded_te
from gearfmu.stage.run.steady import LoadCase, steady_run
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.forms.turning import shafts_of

FAST = 1
TORQUE = 120.0  # N·m on the input


def at_rest(model: StageModel, **parameters: float) -> dict[str, float]:
    """Outputs in static equilibrium under TORQUE, input and output wound against each other."""
    kernel = begun(model.kernel(level=FAST, **parameters), Steady(model, 0.0, TORQUE)(0.0))
    return {v.name: kernel.get(v.name) for v in kernel.variables.values() if v.causality == "output"}


def test_torque_comes_through_a_train_by_its_ratio(two_stage) -> None:
    """Without relief and tip corners normals are lines of action, and meshes carry what the teeth's ratio says. A
    relief is a slope of the flank: by it, a part of a per cent, the ratio of the torques at rest differs."""
    stage, shafts = two_stage.stage, two_stage.shafts
    assert shafts.ratio == pytest.approx(61 / 25 * 73 / 19)
    kernel = statics_of(two_stage, **{"effect.tip_relief": 0.0, "effect.tip_contact": 0.0})
    for number, (mesh, torque) in enumerate(zip(stage.engagements, (TORQUE, TORQUE * 61 / 25), strict=True)):
        forces = kernel.transmission(0.0, TORQUE, number).forces
        carried = sum(sum(slices) for slices in forces.values())
        gear = mesh_shape(stage, mesh).gears[0]
        assert carried == pytest.approx(torque / (gear.r_b * math.cos(gear.beta_b)), rel=1e-5), mesh.name
    found = at_rest(two_stage)
    assert -found["output.tau"] / found["input.tau"] == pytest.approx(shafts.ratio, rel=0.01)
    scale = math.hypot(*(found[f"seat.pinion1.f{direction}"] for direction in "xyz"))
    for direction in "xyz":  # what is static at level fast is read where gears stand without load: 1.4e-4
        bearings = [v for n, v in found.items() if n.startswith("bearing.input") and n.endswith(f".f{direction}")]
        assert sum(bearings) == pytest.approx(found[f"seat.pinion1.f{direction}"], abs=3e-4 * scale)


def test_an_engagement_that_a_train_lacks_is_refused(two_stage) -> None:
    with pytest.raises(ModelError, match="two_stage has no engagement 'stage3'; it has stage1, stage2"):
        loaded_te(two_stage, [100.0], 3, mesh="stage3")


def test_a_stage_without_input_and_output_is_refused(two_stage) -> None:
    stage = two_stage.stage
    lonely = stage.model_copy(update={"ports": {"input": stage.ports["input"]}})
    with pytest.raises(SpecError, match="ports = input: a stage needs an input and an output"):
        shafts_of(lonely)
    third = stage.ports["input"].model_copy(update={"body": "intermediate_shaft"})
    crowded = stage.model_copy(update={"ports": stage.ports | {"third": third}})
    with pytest.raises(SpecError, match=r"ports\.third\.kind = .*simulate drives input and output only: make"):
        steady_run(replace(two_stage, stage=crowded), LoadCase(100.0, 50.0))
    apart = stage.model_copy(update={"engagements": stage.engagements[:1]})
    with pytest.raises(SpecError, match="no meshes lead from the first port to the second"):
        shafts_of(apart)
