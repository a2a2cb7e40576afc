"""From numbers to report through the command line, on the shipped bodies; slow ones: the demo, the wheel."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
import zipfile
from contextlib import chdir
from pathlib import Path

import pytest
from verbs import call

from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.scenefile.scene import SHIPPED
from gearfmu.stage.run.trace import Trace

ROOT = Path(__file__).resolve().parents[1]
LARGEST_WHEEL = 20e6  # bytes, with both kernels


def gearfmu(*arguments: object, cwd: Path | None = None) -> str:
    """Standard output of the verb."""
    with chdir(cwd or Path.cwd()):
        code, out, err = call(*arguments)
    assert code == 0, err + out
    return out


def test_export_and_validate(tmp_path: Path) -> None:
    gearfmu("export", "fzg_c", "-o", tmp_path / "pair.fmu", "--port", "pinion=torque", "--port", "wheel=fixed")
    assert "0 problems" in gearfmu("validate", tmp_path / "pair.fmu")
    shown = json.loads(gearfmu("inspect", tmp_path / "pair.fmu", "--json"))
    assert shown["kind"] == "fmu" and "pinion.w" in shown["variables"] and "wheel.phi" not in shown["variables"]


def test_run_through_the_fmu_equals_the_kernel_bit_for_bit(tmp_path: Path) -> None:
    text = (SHIPPED / "clutch_closure.toml").read_text(encoding="utf-8").replace('"0.4 s"', '"6 ms"')
    (tmp_path / "short.toml").write_text(text, encoding="utf-8")
    for unit, more in (("fmu", ()), ("kernel", ("--verify",))):
        gearfmu("run", "short.toml", "--unit", unit, *more, "--out", unit, cwd=tmp_path)
        assert {"trace.h5", "summary.json", "report.html", "data"} <= {
            path.name for path in (tmp_path / unit).iterdir()
        }
    summary = json.loads((tmp_path / "kernel" / "summary.json").read_text(encoding="utf-8"))
    assert 0 <= summary["coupling_error"] < 0.05, "its other fields: tests/cosim/test_scene_runs.py"
    fmu, kernel = (Trace.load(tmp_path / unit / "trace.h5") for unit in ("fmu", "kernel"))
    assert list(fmu.channels) == list(kernel.channels)
    assert all(fmu[name].tobytes() == kernel[name].tobytes() for name in fmu.channels)


@pytest.mark.full
def test_demo_ends_with_a_report_and_the_fmu_is_the_solver_all_the_way(tmp_path: Path) -> None:
    out = gearfmu("demo", "--out", tmp_path)
    gearfmu("run", "clutch_closure", "--step", "20 us", "--unit", "kernel", "--out", tmp_path / "kernel")
    fmu, kernel = (Trace.load(folder / "trace.h5") for folder in (tmp_path, tmp_path / "kernel"))
    assert list(fmu.channels) == list(kernel.channels) and fmu.time.size == 20001
    assert all(fmu[name].tobytes() == kernel[name].tobytes() for name in fmu.channels)
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert str(tmp_path / "report.html") in out
    wanted = {
        "scene": "clutch_closure",
        "level": "standard",
        "slices": 5,
        "master": "gs_mean",
        "H": 2e-5,
        "unit": "fmu",
    }
    assert wanted.items() <= summary.items()
    assert 'class="warning"' not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 0.05 < summary["results"]["lock_time_s"] < 0.3 and summary["chain_in_fmu"]


@pytest.mark.full
@pytest.mark.needs("ziglang", "build")
def test_the_wheel_runs_the_demo_in_an_empty_environment(tmp_path: Path) -> None:
    """Small, for Linux and Windows, made as users are told: both kernels export the same names, the Windows one is not
    loaded here. Installed without compiler and away from the checkout; needs a package index for the dependencies."""
    subprocess.run(["make", "wheel", f"VENV={sys.prefix}"], cwd=ROOT, check=True, capture_output=True)
    wheel = max((ROOT / "dist").glob("gearfmu-*.whl"), key=lambda path: path.stat().st_mtime)
    assert wheel.stat().st_size <= LARGEST_WHEEL
    assert wheel.name.endswith("-py3-none-manylinux2014_x86_64.manylinux_2_17_x86_64.win_amd64.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "wheel")
    folder = tmp_path / "wheel" / "gearfmu" / "kernel" / "lib"
    names = [exported_symbols(folder / file) for file in ("linux64/gearfmu_kernel.so", "win64/gearfmu_kernel.dll")]
    assert names[0] == names[1] and len(names[0]) > 40
    venv.create(tmp_path / "venv", with_pip=True)
    binaries = tmp_path / "venv" / "bin"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {"CC": "false"}
    for command in (
        [binaries / "python", "-m", "pip", "install", "--quiet", wheel],
        [binaries / "gearfmu", "demo", "--out", tmp_path / "out"],
    ):
        subprocess.run(command, check=True, cwd=tmp_path, env=environment, capture_output=True)
    assert (tmp_path / "out" / "report.html").is_file()
