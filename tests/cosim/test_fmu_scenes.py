"""A scene run with an FMU computes with the FMU's stage: the same bits as with that stage itself; what does not fit the
scene is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cosim, fmu
from gearfmu.api.results import stage_and_bodies
from gearfmu.cosim.given_fmu import fitted, of_scene
from gearfmu.cosim.scene_run import Staged, drive_of
from gearfmu.errors import BodyError, SpecError
from gearfmu.fmu.opened import OpenedFmu
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stage.run.trace import Trace

OF_A_ROAD = {"finished", "cpu_s", "realtime_factor", "stage_cpu_s", "stage_realtime_factor", "unit", "fmu_path"}
OF_A_NAME = {"stage", "hashes"}  # "planetary54/stage_pin_error" calls itself planetary54_pin_error
ROADS = [
    ("fzg_c", "pair_loaded"),
    ("fzg_c/stage_relief", "clutch_closure"),
    *(
        pytest.param(*case, marks=pytest.mark.full)
        for case in (
            ("two_stage/stage_housed", "clutch_closure_housed"),
            ("helical_demo", "pair_loaded"),
            ("two_stage", "train_runup"),
            ("helical_set", "planetary_paper"),
            ("planetary54", "planetary_paper"),
            ("planetary54/stage_pin_error", "planetary_runup"),
            ("planetary54/stage_ring_port", "planetary_shift"),
        )
    ),
]


def short(name: str, **more: object) -> SceneSpec:
    """Twenty communication steps of a shipped scene."""
    scene = gf.load_scene(name)
    changes = {"duration": 20 * scene.coupling.step, "settle": 0.0, "deformation": None, **more}
    return scene.model_copy(update=changes)


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Path:
    """fzg_c with the shafts of its own file."""
    return gf.export("fzg_c", tmp_path_factory.mktemp("fmus") / "fzg_c.fmu")


def same(one: Trace, other: Trace) -> bool:
    """Names, types, units and bits."""
    kinds = [[(name, c.unit, c.values.dtype) for name, c in trace.channels.items()] for trace in (one, other)]
    return kinds[0] == kinds[1] and all(np.array_equal(one[name], other[name]) for name in one.channels)


@pytest.mark.parametrize(("stage", "scene"), ROADS)
def test_both_roads_give_the_same_bits(stage: str, scene: str, tmp_path: Path) -> None:
    path = fmu.export(gf.assemble_in_scene(short(scene), stage), tmp_path / "stage.fmu")
    by_stage, by_fmu = gf.run(short(scene), stage=gf.load(stage), unit="kernel"), gf.run(short(scene), unit=path)
    assert by_stage.meta["outcome"] == "ok" and same(by_stage, by_fmu)
    left = set(by_stage.meta) - OF_A_ROAD - OF_A_NAME
    assert {key: by_fmu.meta[key] for key in left} == {key: by_stage.meta[key] for key in left}
    bodies = {key: text for key, text in by_stage.meta["hashes"].items() if key != "scene"}
    assert by_fmu.meta["hashes"].items() >= bodies.items()


def test_an_fmu_keeps_its_shafts_and_the_run_says_so(plain: Path) -> None:
    """Its stiffness also decides how far the shafts are twisted at the start."""
    trace = gf.run(short("pair_loaded"), unit=plain)
    (remark,) = trace.meta["warnings"]
    assert str(plain) in remark and "gearfmu export fzg_c --scene" in remark
    assert "ports.wheel.k 40000 N*m/rad, in the scene 50000 N*m/rad" in remark and "pinion.k" not in remark
    shafts = {f"test_rig.wheel_shaft_{name}": value for name, value in (("stiffness", 4e4), ("damping", 0.3))}
    scene = gf.load_scene("pair_loaded", shafts | {"test_rig.pinion_shaft_damping": 0.1})
    scene = scene.model_copy(update={"duration": 4e-4, "settle": 0.0})
    assert same(trace, gf.run(scene, stage="fzg_c", unit="kernel"))


def test_the_report_is_about_the_stage_of_the_fmu(plain: Path, tmp_path: Path) -> None:
    """Heading and bodies; a stage file of that name with other bodies is not taken."""
    trace = gf.run(short("pair_loaded"), tmp_path, unit=plain)
    assert trace.meta["stage"] == "fzg_c" and Path(trace.meta["fmu_path"]) == plain
    spec, bodies = stage_and_bodies(trace.meta)
    assert spec.gears[0].tip_relief is None and spec.ports == gf.load("fzg_c").ports
    assert [body.how.hash for body in bodies] == [trace.meta["hashes"][f"body {name}"] for name in ("pinion", "wheel")]
    with pytest.raises(BodyError, match="has other bodies"):
        stage_and_bodies(trace.meta | {"stage": "helical_demo"})
    changed = trace.meta | {"hashes": {"model": "0" * 64}}
    with pytest.raises(gf.GearfmuError, match="exported again since the run"):
        stage_and_bodies(changed)


def test_an_fmu_of_another_kind_of_stage_is_refused_by_name(plain: Path) -> None:
    scene, spec = gf.load_scene("pair_loaded"), gf.load("planetary54")
    opened = OpenedFmu(Path("set.fmu"), StageModel(spec, b"", ("",) * 4), {})
    with pytest.raises(
        SpecError, match=r"set.fmu: kind of stage planetary54 = planetary_set: scene pair_loaded is made"
    ):
        of_scene(scene, opened)
    assert of_scene(scene, opened, spec) is scene  # named with --stage it is wanted
    with pytest.raises(SpecError, match=r"kind of stage fzg_c = external_pair: scene planetary_paper"):
        cosim.run(Staged.of_fmu(load_scene("planetary_paper"), plain))


def test_an_fmu_of_another_stage_than_the_named_one_is_refused(plain: Path) -> None:
    with pytest.raises(SpecError, match=r"fzg_c.fmu: name = fzg_c: .*stage_relief.toml says fzg_c_relief"):
        gf.run(short("pair_loaded"), stage="fzg_c/stage_relief", unit=plain)
    assert gf.run(short("pair_loaded"), stage="fzg_c", unit=plain).meta["outcome"] == "ok"


def test_the_stage_of_the_scene_need_not_be_there(plain: Path) -> None:
    scene = short("pair_loaded")
    scene = scene.with_stage(name="gone/stage.toml")
    assert cosim.run(Staged.of_fmu(scene, plain)).meta["stage"] == "fzg_c"


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ("clutch_closure", r"ports.pinion.chain = none: scene clutch_closure needs a port with a chain: export it"),
        ("planetary_backfire", r"ports = pinion, wheel: stage fzg_c does not fit scene planetary_backfire"),
    ],
)
def test_ports_that_do_not_fit_are_all_named(plain: Path, scene: str, message: str) -> None:
    with pytest.raises(SpecError, match=message) as refused:
        Staged.of_fmu(gf.load_scene(scene), plain, gf.load("fzg_c"))
    assert len(refused.value.problems) >= 2 and refused.value.problems[0].file == str(plain)


def test_another_kind_of_port_is_named() -> None:
    spec = gf.assemble("fzg_c", ports={"wheel": "torque"}).stage
    opened = OpenedFmu(Path("pair.fmu"), StageModel(spec, b"", ("", "")), {})
    with pytest.raises(SpecError, match=r"pair.fmu: ports.wheel.kind = torque: scene pair_loaded needs .* kind spring"):
        fitted(gf.load_scene("pair_loaded"), opened, drive_of)


def test_an_fmu_for_a_scene_shows_the_gears_that_it_records() -> None:
    choice = gf.load_scene("planetary_paper").deformation.model_copy(update={"gears": ("wheel",)})
    scene = short("pair_loaded", deformation=choice)
    opened = OpenedFmu(Path("shown.fmu"), gf.assemble_in_scene(scene, "fzg_c", observe=["pinion", "wheel"]), {})
    assert opened.observed == ("pinion", "wheel") and fitted(scene, opened, drive_of) == (scene, ())
    assert OpenedFmu(Path("own.fmu"), gf.assemble_in_scene(scene, "fzg_c"), {}).observed == ("wheel",)
