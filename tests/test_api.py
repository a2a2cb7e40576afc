"""`import gearfmu`: at once, readable, and the same numbers as the command line."""

from __future__ import annotations

import importlib.metadata
import inspect
import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cli
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
