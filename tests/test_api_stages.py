"""The verbs new, efficiency, modes, bearings as functions, and options that mean the same on every verb."""

from __future__ import annotations

import csv
import importlib
import math
from pathlib import Path

import click
import pytest

import gearfmu as gf
from gearfmu import cli
from gearfmu.api.results import Page
from gearfmu.commands.shared import LEVELS, scene_names, stage_names


def test_a_new_pair_has_what_was_asked_for(tmp_path: Path) -> None:
    """By hand: 10 teeth an inch are a module of 2.54 mm; Σx = 0.4 at 20° and 104 teeth: Σx = z (inv α_w − inv α)/
    (2 tan α)."""
    asked = {"teeth": (31, 73), "diametral_pitch": 10, "width": "30 mm", "shifts": (0.3, 0.1)}
    spec = gf.load(gf.new("mine", folder=tmp_path, bores=("20 mm", "40 mm"), relief="12 um", **asked))  # type: ignore
    assert spec.written.pair.normal_module == pytest.approx(2.54e-3) and [g.profile_shift for g in spec.gears] == [
        0.3,
        0.1,
    ]
    assert [gear.bore_diameter for gear in spec.gears] == pytest.approx([0.02, 0.04])
    assert [gear.tip_relief.amount for gear in spec.gears] == pytest.approx([12e-6] * 2)
    alpha = math.radians(20)
    working = math.acos(2.54e-3 * 104 / 2 * math.cos(alpha) / spec.written.pair.center_distance)
    involute = math.tan(working) - working - (math.tan(alpha) - alpha)
    assert 104 * involute / (2 * math.tan(alpha)) == pytest.approx(0.4, abs=1e-5)


@pytest.mark.parametrize(
    "more, field",
    [
        ({"module": "2 mm", "diametral_pitch": 10}, "diametral_pitch"),
        ({"module": "2 mm", "shifts": (0.1,)}, "shifts"),
        ({"module": "2 mm", "bores": ("1 mm", "2 mm", "3 mm")}, "bores"),
        ({"module": "2 mm", "shifts": (0.1, 0.2), "center": "104 mm"}, "center"),
        ({"module": "2 mm", "like": "fzg_c"}, "like"),
    ],
)
def test_wishes_that_contradict_each_other_are_named(tmp_path: Path, more: dict[str, object], field: str) -> None:
    with pytest.raises(gf.GearfmuError, match=field):
        gf.new("mine", folder=tmp_path, teeth=(31, 73), width="20 mm", **more)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_a_set_takes_them_too(tmp_path: Path) -> None:
    """The bolts stay within the bores that were asked for."""
    spec = gf.load(
        gf.new("set", folder=tmp_path, teeth=(18, 18, 54), planets=3, module="2.5 mm", width="30 mm",
               bores=("10 mm", "12 mm"), relief="12 um")
    )  # fmt: skip
    assert (spec.written.sun.bore_diameter, spec.written.planet.bore_diameter) == pytest.approx((0.01, 0.012))
    assert spec.written.carrier.bolt_diameter < 0.012 and spec.written.planet.tip_relief is not None


def test_modes_is_a_function_and_a_package() -> None:
    """The name of the verb and that of the package behind it are one."""
    assert callable(gf.modes) and importlib.import_module("gearfmu.modes") is gf.modes
    with pytest.raises(gf.GearfmuError, match="there|has pinion"):
        gf.modes("fzg_c", "nobody")


def test_efficiency_is_that_of_the_verb() -> None:
    """Rigid gears, constant coefficient 0.05: within a tenth of the closed form (P µ H_V)."""
    found = gf.efficiency("fzg_c", "302 N*m", "2000 rpm", pitches=2, level="rigid").meshes["mesh"]
    assert found.coefficient == pytest.approx(0.05) and found.lost == pytest.approx(found.closed, rel=0.1)


def test_a_notebook_carries_the_whole_report(tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text('<p class="a">"&"</p>', encoding="utf-8")
    shown = Page(tmp_path / "report.html")._repr_html_()
    assert 'srcdoc="&lt;p class=&quot;a&quot;&gt;&quot;&amp;&quot;&lt;/p&gt;"' in shown


def options(verb: str) -> dict[str, click.Parameter]:
    module, name = cli.VERBS[verb][0].split(":")
    return {option: param for param in getattr(importlib.import_module(module), name).params for option in param.opts}


def test_options_of_one_name_take_the_same() -> None:
    """--torque is that of the input, with its unit, wherever a load acts; --level takes the levels of the kernel."""
    torque = {verb: options(verb)["--torque"] for verb in ("run", "plan", "te", "simulate", "modes", "efficiency")}
    assert {param.type.name for param in torque.values()} == {'"<number> N*m>"'.replace('>"', '"')}
    assert all("input" in (param.help or "") for param in torque.values())  # type: ignore[attr-defined]
    levels = [options(verb)["--level"].type for verb in ("run", "te", "simulate", "efficiency")]
    assert all(isinstance(kind, click.Choice) and tuple(kind.choices) == LEVELS for kind in levels)
    known = gf.assemble("fzg_c").kernel().variables["level"].items
    assert known == LEVELS
    assert {"--stage", "--torque", "--speed", "--step"} <= set(options("run")) & set(options("plan"))


def test_names_of_stages_and_scenes_are_completed() -> None:
    context, param = click.Context(click.Command("te")), click.Argument(["stage"])
    assert "planetary54" in [item.value for item in stage_names(context, param, "plan")]
    assert [item.value for item in scene_names(context, param, "pair_lo")] == ["pair_loaded"]
    assert stage_names(context, param, "./mine")[0].type == "file"


BEARINGS = "helical_demo/stage_bearings"


def test_bearings_prints_the_table_of_the_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "bearings.csv"
    assert cli.outcome(["bearings", BEARINGS, "--torque", "80 N*m", "--csv", str(table)]) == 0
    printed, found = capsys.readouterr().out, gf.bearings(BEARINGS, "80 N*m")
    for state in found.states:
        assert (
            f"{state.support}: bearing {state.bearing}" in printed and f"{state.loaded} of {state.elements}" in printed
        )
    assert "proposed      balls 10, ball_diameter 11.10 mm" in printed
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    assert [row["support"] for row in rows] == ["pinion", "wheel"]
    for row, state in zip(rows, found.states, strict=True):
        assert float(row["load_z"]) == pytest.approx(state.load[2], rel=1e-5)
        assert float(row["pressure_MPa"]) == pytest.approx(1e-6 * state.pressure, rel=1e-5)
    assert gf.bearings(BEARINGS).torque == 100.0, "that of the file, where none is asked"
