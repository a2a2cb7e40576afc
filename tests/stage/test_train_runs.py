"""Trains at rest: ratio and torque through the meshes, phases of the teeth by the closed form at the places of the
axes, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from driven import begun

from gearfmu.body import load_bodies
from gearfmu.errors import ModelError, SpecError
from gearfmu.stage import StageModel, Steady, assemble, loaded_te
from gearfmu.stage.assembly.meshes import tooth_phases
from gearfmu.stage.run.steady import LoadCase, steady_run
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.general import RotorSpec, Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.forms.turning import shafts_of
from gearfmu.stagefile.reading.base import read_toml
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

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


def test_axial_forces_on_the_intermediate_shaft_oppose(two_stage) -> None:
    """Two gears of one hand, one driven and one driving: each pushes with F_t tan β, tangential at the reference
    circle, and the locating bearing carries the difference. At a moderate load the status bits are clear."""
    found = at_rest(two_stage, **{"effect.tip_relief": 0.0, "effect.tip_contact": 0.0})
    pushed = {}
    for mesh, gear, index, torque in (("stage1", "wheel1", 1, TORQUE), ("stage2", "pinion2", 0, TORQUE * 61 / 25)):
        shape = mesh_shape(two_stage.stage, next(m for m in two_stage.stage.engagements if m.name == mesh))
        first = shape.gears[0]
        pushed[gear] = torque / (first.m_t * first.z / 2) * math.tan(abs(first.beta))
        assert abs(found[f"seat.{gear}.fz"]) == pytest.approx(pushed[gear], rel=5e-3), gear
        assert shape.gears[index].beta < 0  # left-handed
    assert found["seat.wheel1.fz"] * found["seat.pinion2.fz"] < 0
    carried = found["bearing.intermediate_left.fz"]
    assert carried == pytest.approx(found["seat.wheel1.fz"] + found["seat.pinion2.fz"], rel=1e-4)
    assert abs(carried) < 0.6 * max(pushed.values())
    assert found["solver.status"] == 0 == at_rest(two_stage)["solver.status"]


def test_a_pair_written_as_a_general_stage_is_the_same_model(tmp_path: Path, bodies, plain) -> None:
    """Same gears, same bodies, same blob: a pair file is the short form."""
    tables = as_general_file(read_toml(find_stage("fzg_c")))
    path = tmp_path / "stage.toml"
    path.write_text("\n".join(f"{key} = {toml(value)}" for key, value in tables.items()), encoding="utf-8")
    spec = load_stage(path)
    assert isinstance(spec, Stage)
    assert load_bodies(spec, find_stage("fzg_c").parent)[0].how.hash == bodies[0].how.hash
    assert assemble(spec, bodies).hash == plain.hash


def as_general_file(pair: dict[str, Any]) -> dict[str, Any]:
    """The tables of a pair file as those of a general stage."""
    rack = {key: pair["pair"][key] for key in ("normal_module", "pressure_angle")}
    names = list(pair["gears"])
    distance = pair["pair"]["center_distance"]
    bearings = {name: gear.pop("bearing") for name, gear in pair["gears"].items()}
    return {
        "name": pair["name"],
        "kind": "general",
        "slices": pair["contact"]["slices"],
        "bodies": {name: gear | rack for name, gear in pair["gears"].items()},
        "rotors": {
            name: {"axis": [x, "0 mm"], "bodies": {name: "0 mm"}}
            for name, x in zip(names, ("0 mm", distance), strict=True)
        },
        "engagements": [
            {"name": "mesh", "gears": names, "backlash": pair["pair"]["backlash"]}
            | {"damping": pair["contact"]["damping"]}
            | {key: pair[key] for key in ("torque_max", "speed_max")}
        ],
        "supports": [
            {"name": name, "body": name, "radial": b["stiffness"], "damping_ratio": b["damping_ratio"]}
            for name, b in bearings.items()
        ],
        "ports": {name: port | {"body": name} for name, port in pair["ports"].items()},
        "levels": pair.get("levels", {}),
    }


def toml(value: Any) -> str:
    """A value as inline TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}" = {toml(item)}' for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)


# ---- phases ----------------------------------------------------------------------------------------------------------
def test_teeth_touch_in_every_engagement_at_angle_zero(two_stage: StageModel) -> None:
    """Drive gap of tooth 0 on tooth 0 is nothing, or a whole number of pitches."""
    train = two_stage.stage
    phases = tooth_phases(train)
    for mesh in train.engagements:
        pair = mesh_shape(train, mesh)
        a, b = pair.gears
        (x, y), (u, v) = (train.rotors[train.rotor_of(gear)].axis for gear in mesh.gears)
        t = math.atan2(v - y, u - x) - pair.alpha_wt
        roll_a = a.r_b * (phases[mesh.gears[0]] + a.psi_b - t)
        roll_b = b.r_b * (phases[mesh.gears[1]] + b.psi_b - t - math.pi)
        assert math.remainder(pair.length - roll_a - roll_b, pair.base_pitch) == pytest.approx(0, abs=1e-12)


def test_a_ring_of_gears_whose_axes_do_not_fit_is_refused(two_stage: StageModel) -> None:
    """Three gears in a triangle, each with each: only certain places of the axes fit the teeth."""
    axes = {"pinion1": (0.0, 0.0), "wheel1": (0.1, 0.0), "third": (0.05, 0.14)}
    train = two_stage.stage
    mesh, bodies = train.engagements[0], train.bodies
    triangle = {
        "bodies": bodies | {"third": bodies["wheel1"].model_copy(update={"name": "third"})},
        "rotors": {name: RotorSpec(axis=axis, bodies={name: 0.0}) for name, axis in axes.items()},
        "engagements": tuple(
            mesh.model_copy(update={"name": "-".join(gears), "gears": gears}) for gears in combinations(axes, 2)
        ),
    }
    with pytest.raises(ModelError, match="move an axis"):
        tooth_phases(train.model_copy(update=triangle))
