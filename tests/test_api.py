"""`import gearfmu`: at once, readable, and the same numbers as the command line."""

from __future__ import annotations

import csv
import importlib
import importlib.metadata
import inspect
import math
import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args, get_type_hints

import click
import matplotlib
import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cli
from gearfmu.api.results import Page
from gearfmu.api.settings import Integrator, Level, RunSettings
from gearfmu.commands.shared import LEVELS, scene_names, stage_names
from gearfmu.stage.assembly.shown import LINES, WIDTH
from gearfmu.stage.run.trace import TraceError
from gearfmu.stagefile.proposals.new import new_stage

SMALL = {"modes": 12, "roll_points": 8, "width_functions": 3, "mesh.scale": 0.4}
STIFF = ("mesh", "stage")
ROOT = Path(__file__).resolve().parents[1]
HEAVY = ("numpy", "scipy", "matplotlib", "h5py", "pydantic", "pint", "xarray", "pandas", "pyarrow", "dask", "fmpy")


def python(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_import_is_quick_and_loads_nothing_heavy() -> None:
    """Processor time of the import alone, which does not wait for a busy machine; 0.02 s where it was written."""
    spent = python("import time; start = time.process_time(); import gearfmu; print(time.process_time() - start)")
    assert float(spent) < 0.2


LAZY = {  # code, and what it does not load
    "import gearfmu": HEAVY,
    "from gearfmu.cli import outcome; outcome(['--help'])": (*HEAVY[:6], "rich"),
    "from gearfmu.quantities import to_si; to_si('3 m', 'm'); to_si('3 mm', 'm')": ("pint",),
    # but dask.base, which pint imports where it finds it
    "import gearfmu as gf; gf.te(gf.assemble('fzg_c'), 100.0, 2, level='rigid')": (
        "matplotlib", "xarray", "pandas", "pyarrow", "distributed",
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", LAZY)
def test_packages_are_loaded_when_they_are_wanted(code: str) -> None:
    *_, loaded = python(f"import sys; {code}\nprint(*(name.split('.')[0] for name in sys.modules))").splitlines()
    assert not set(LAZY[code]) & set(loaded.split())


def test_help_is_readable() -> None:
    """Every name has its signature and says what it takes, gives and raises; the ten lines stand at the top."""
    text = pydoc.plain(pydoc.render_doc(gf))
    assert text.index("import gearfmu as gf") < text.index("CLASSES") < text.index("FUNCTIONS")
    lines = text[: text.index("\nDATA\n")].splitlines()
    assert not [line for line in lines if len(line) > 124 and "->" not in line]  # signatures are one line each
    for name in gf.__all__:
        member = getattr(gf, name)
        assert member.__doc__, name
        if inspect.isfunction(member):
            assert f"\n    {name}(" in text
            assert "return" in member.__annotations__
            parameters = inspect.signature(member).parameters
            assert all(re.search(rf"\b{p}\b", member.__doc__) for p in parameters), f"{name}: a parameter is not told"
    assert set(gf.__all__) <= set(dir(gf)) and gf.__version__ == importlib.metadata.version("gearfmu")
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        gf.simulat  # noqa: B018


def test_te_is_that_of_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Table, console and function. With rigid bearings the stage is its mesh, and the console names the mesh alone."""
    out, model = tmp_path / "te.csv", gf.assemble(gf.load("fzg_c"))
    call = ["te", "fzg_c", "--torque", "80 N*m", "--torque", "302 N*m", "--positions", "6", "--out", str(out)]
    shown = []
    for more, effects in (([], {}), (["--rigid-bearings"], {"effect.bearings": 0.0})):
        assert cli.outcome([*call, *more]) == 0
        told = re.findall(r"(mesh|stage) stiffness ([0-9.]+) N/µm", capsys.readouterr().out)
        shown.append({name: float(number) for name, number in told})
        table = np.genfromtxt(out, delimiter=",", names=True)
        assert table.dtype.names[:5] == ("torque_Nm", "position", "te_um", *(f"{n}_stiffness_N_per_um" for n in STIFF))
        for te in (gf.te("fzg_c", ["80 N*m", 302], 6, **effects), gf.te(model, [80.0, "0.302 kN*m"], 6, **effects)):
            assert table["te_um"].tolist() == (1e6 * te.te.ravel()).tolist()
            assert table["mesh_stiffness_N_per_um"] == pytest.approx(1e-6 * te.mesh_stiffness.ravel(), rel=1e-9)
        assert np.allclose(sum(table[n] for n in table.dtype.names if n.startswith("share_")), 1, atol=1e-9)
        heavy = table[table["torque_Nm"] == 302.0]
        for name, value in shown[-1].items():
            assert value == pytest.approx(heavy[f"{name}_stiffness_N_per_um"].mean(), abs=0.06)
    assert np.array_equal(table["mesh_stiffness_N_per_um"], table["stage_stiffness_N_per_um"])
    assert set(shown[1]) == {"mesh"} and shown[0]["stage"] < 0.6 * shown[0]["mesh"]
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_harmonics_of_a_sum_of_cosines() -> None:
    """Amplitudes come out as rms; from half the number of positions on they cannot be told."""
    position = np.arange(8) / 8
    te = 5 + 3 * np.cos(2 * np.pi * position) + 2 * np.sin(6 * np.pi * position)
    result = gf.TeResult(
        np.ones(1), position, te[None], np.ones((1, 8)), np.ones((1, 8)), np.ones((1, 8, 4)), np.ones((1, 5)), ("",)
    )
    assert result.harmonics(4)[0, :3] == pytest.approx([3 / 2**0.5, 0, 2 / 2**0.5], abs=1e-12)
    assert np.isnan(result.harmonics(6)[0, 3:]).all()


def test_simulate_is_that_of_the_command_line(tmp_path: Path) -> None:
    call = ["simulate", "fzg_c", "--torque", "302 N*m", "--speed", "2000 rpm", "--duration", "4 ms", "--settle", "1 ms"]
    assert cli.outcome([*call, "--set", "level=fast", "--set", "slices=3", "--out", str(tmp_path)]) == 0
    other = gf.Trace.load(tmp_path / "trace.h5")
    trace = gf.simulate("fzg_c", 302, "2000 rpm", "4 ms", settle=1e-3, level="fast", slices=3)
    assert all(np.array_equal(trace[name], other[name]) for name in other.channels)
    untold = {"cpu_s", "realtime_factor", "stage"}
    assert {k: v for k, v in trace.meta.items() if k not in untold} == {
        k: v for k, v in other.meta.items() if k not in untold
    }
    wound = gf.drive("fzg_c", gf.wound_up("fzg_c", 302, "2000 rpm"), 4e-3, level="fast", slices=3)
    assert np.array_equal(wound["mesh.force"], trace["mesh.force"])


def test_ports_and_bores_of_a_model() -> None:
    model = gf.assemble("fzg_c", ports={"pinion": "torque", "wheel": "fixed"})
    assert [port.kind for port in model.stage.ports.values()] == ["torque", "fixed"]
    with pytest.raises(gf.GearfmuError, match=r"the stage has pinion, wheel[\s\S]*kinds spring, torque, fixed"):
        gf.assemble("fzg_c", ports={"sun": "torque", "wheel": "glue"})
    with pytest.raises(gf.GearfmuError, match="averaging or rigid"):
        gf.assemble("fzg_c", bore="loose")
    with pytest.raises(gf.GearfmuError, match="keep averaging bores"):
        gf.assemble("planetary54", bore="rigid")
    with pytest.raises(gf.GearfmuError, match="'levl' is no parameter: did you mean \"level\""):
        gf.simulate("fzg_c", 1, 1, levl="fast")


def readme_example() -> str:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)[0]


def test_the_example_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ten lines at most; what it prints is right: torque over base radius."""
    code = readme_example()
    assert len(code.strip().splitlines()) <= 10
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    numbers = [float(word) for word in re.findall(r"\d+\.\d+", capsys.readouterr().out)]
    assert numbers[-1] == pytest.approx(302 / (0.5 * 4.5e-3 * 16 * 0.9396926207859084), rel=1e-2)
    assert (tmp_path / "fzg_c_relief.fmu").is_file() and (tmp_path / "out" / "steady" / "report.html").is_file()


@pytest.mark.full
def test_bodies_of_a_changed_stage_lie_apart(tmp_path: Path) -> None:
    """A body that fits is taken over, one that does not is made, and those of the file stay. Coarse meshes."""
    path = new_stage("small", "fzg_c", tmp_path)
    coarse = {f"gears.{name}.body.{key}": n for name in ("pinion", "wheel") for key, n in SMALL.items()}
    first = gf.reduce(gf.load(path, coarse), path.parent)
    before = {file.name: file.read_bytes() for file in path.parent.glob("*.h5")}
    narrow = gf.load(path, coarse | {"gears.pinion.face_width": "13 mm"})
    made = gf.reduce(narrow)
    (apart,) = path.parent.glob("bodies_*")
    assert made[0].total_mass < first[0].total_mass and (apart / "wheel.h5").read_bytes() == before["wheel.h5"]
    assert {file.name: file.read_bytes() for file in path.parent.glob("*.h5")} == before


# ---- the verbs new, efficiency, modes, bearings as functions; options that mean the same on every verb ---------------
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


# ---- in a session: what models, results and traces show of themselves, completion, types of keyword arguments --------
matplotlib.use("Agg")
SCREEN = 24  # lines of a terminal


@pytest.fixture(scope="module")
def trace() -> gf.Trace:
    return gf.simulate("fzg_c", 302, "2000 rpm", "2 ms", settle=1e-3, level="rigid")


def screens(thing: Any) -> tuple[str, str]:
    """Text and HTML; both fit one screen."""
    text, page = repr(thing), thing._repr_html_()
    lines = text.splitlines()
    assert len(lines) <= SCREEN and max(map(len, lines)) <= WIDTH
    assert len(page) < 8000 and page.count("<tr>") <= LINES + 1
    return text, page


@pytest.mark.parametrize("stage", ["fzg_c", "two_stage", "planetary54"])
def test_models_and_results_fit_one_screen(stage: str) -> None:
    model = gf.assemble(stage)
    text, page = screens(model)
    assert text.startswith(f"Stage {stage} (") and stage in page and "effect.(" in text and model.hash[:12] in text
    result = gf.te(model, [50.0, "100 N*m"], 2, level="rigid", slices=1)
    text, page = screens(result)
    assert "50.0 N·m" in text and f"mean {1e6 * result.te[1].mean():.3f} µm" in text and "100.0 N·m" in page
    axes = result.plot()
    assert np.allclose(axes[0].lines[1].get_ydata(), 1e6 * (result.te[1] - result.te[1].mean()))


def test_a_trace_shows_its_run_and_channels(trace: gf.Trace) -> None:
    text, page = screens(trace)
    assert text.startswith("Trace: fzg_c, constant speed and load, rigid, completed")
    assert "101, 0 s to 2 ms" in text and "bearing.pinion" in page
    assert text.index("  mesh ") < text.index("  bearing.pinion "), "meshes first"
    many = gf.Trace(trace.time, {f"part{k}.x": gf.Channel(trace.time) for k in range(40)})
    assert screens(many)[0].endswith("23 more")
    assert "mesh.force" in trace._ipython_key_completions_()


def test_a_trace_draws_the_part_and_the_channels_that_are_named(trace: gf.Trace) -> None:
    force, error = trace.plot()
    assert (force.get_ylabel(), error.get_ylabel()) == ("mesh.force in N", "mesh.te in m")
    assert np.array_equal(force.lines[0].get_ydata(), trace.window(1e-3)["mesh.force"])
    (axis,) = trace.plot("bearing.*.f?", "bearing.*.fx_mean", start=0.0)
    assert axis.get_ylabel() == "N" and len(axis.lines) == 6 and axis.lines[0].get_xdata()[0] == 0.0
    with pytest.raises(TraceError, match=r"no channel 'mesh.forc': did you mean 'mesh.force'\?"):
        trace.plot("mesh.forc")
    with pytest.raises(TraceError, match="no channel 'zz': it has: bearing.pinion.fx, "):
        trace["zz"]


@pytest.mark.parametrize(("place", "reason"), [("/proc/x.fmu", "No such file"), (".", "it is a folder")])
def test_a_place_that_cannot_be_written_is_named_itself(place: str, reason: str) -> None:
    with pytest.raises(gf.GearfmuError, match=f"^{place}: cannot be written, {reason}.*: .*(folder|file)") as refused:
        gf.export("fzg_c", place)
    assert isinstance(refused.value, OSError)


def test_typed_settings_are_the_kernels_parameters() -> None:
    """Names, types and items; single meshes and ports have parameters beside."""
    hints = get_type_hints(gf.Settings)
    known = {}
    for stage in ("fzg_c", "two_stage", "planetary54", "planetary54/stage_pin_error"):
        parameters = [v for v in gf.assemble(stage).kernel_variables() if v.causality == "parameter"]
        known |= {v.name: v for v in parameters if "." not in v.name or v.name.startswith("effect.")}
    assert set(hints) - {"effect.runout"} == set(known), "fields of gearfmu/api/settings.py"
    types = {"Real": float, "Integer": int, "Boolean": bool}
    for name, variable in known.items():
        items = get_args(hints[name])
        assert items == tuple(variable.items) if items else hints[name] is types[variable.type], name
    assert get_args(Level) == tuple(known["level"].items) and get_args(Integrator) == tuple(known["integrator"].items)
    assert set(get_type_hints(RunSettings)) == set(hints) | {"profile"}
