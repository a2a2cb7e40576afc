"""The command line: exit codes, one clear message, nothing half-written; verbs that need no long work are run."""

from __future__ import annotations

import importlib
import importlib.metadata
import io
import json
import os
import re
import subprocess
import sys
import time
import zipfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from verbs import call

from gearfmu import cli
from gearfmu.commands import shared
from gearfmu.stage.run.trace import Channel, Trace

ROOT = Path(__file__).resolve().parents[1]


def test_help_names_every_verb_and_imports_nothing_heavy() -> None:
    code = "import sys; from gearfmu.cli import outcome; print(outcome(['--help'])); print(sorted(sys.modules))"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    *told, exit_code, loaded = done.stdout.splitlines()
    assert exit_code == "0" and not [verb for verb in cli.VERBS if f"\n  {verb} " not in "\n".join(told)]
    heavy = ("numpy", "h5py", "matplotlib", "pydantic", "pint", "rich", "scipy")
    assert not [name for name in heavy if f"'{name}'" in loaded]


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["nonsense"],
        ["new"],
        ["new", "mine", "--teeth", "x"],
        ["new", "mine", "--teeth", "31 73", "--like", "fzg_c"],
        ["study", "pair_loaded"],
        ["study", "--out", "x"],
        ["te", "fzg_c"],
        ["te", "fzg_c", "--torque", "302"],
        ["te", "fzg_c", "--torque", "302 mm"],
        ["te", "fzg_c", "--torque", "300 N*m", "--positions", "1"],
        ["run", "clutch_closure", "--unit", "guess"],
        ["run", "clutch_closure", "--unit", "kernel", "--fmu", "stage.fmu"],
        ["export"],
        ["export", "fzg_c", "--scene", "pair_loaded", "--port", "wheel=fixed"],
        ["export", "fzg_c", "--port", "pinion"],
        ["export", "fzg_c", "--port", "pinion=glue"],
        ["mesh", "fzg_c", "--gear", "sun"],
        ["schema", "stage", "extra"],
        ["inspect"],
    ],
    ids=" ".join,
)
def test_wrong_usage_is_100(arguments: list[str]) -> None:
    code, _, err = call(*arguments)
    assert code == cli.USAGE_ERROR and err.strip()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["inspect", "no/such.h5"], "no such file"),
        (["inspect", "fzg_x"], "fzg_c"),
        (["new", "mine", "--like", "fzg_k"], "fzg_c"),
        (["run", "clutch_closur"], "clutch_closure"),
        (["study", "pair_loadet", "--out", "x"], "pair_loaded"),
        (["report", "no/such"], "no such trace file"),
        (["te", "fzg_k", "--torque", "1 N*m"], "fzg_c"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_errors_are_one_message_with_the_remedy(arguments: list[str], words: str) -> None:
    code, out, err = call(*arguments)
    assert code == 1 and words in err and "Traceback" not in err and out == ""
    assert len(err.strip().splitlines()) == 1


def test_debug_shows_the_traceback() -> None:
    code, _, err = call("--debug", "inspect", "fzg_x")
    assert code == 1 and "Traceback" in err


@pytest.mark.parametrize("verb", ["simulate", "te", "modes", "frf", "import", "run"])
def test_help_shows_units_as_the_options_take_them(verb: str) -> None:
    from gearfmu.quantities import to_si

    code, out, _ = call(verb, "--help")
    units = re.findall(r'"<number> ([^"]+)"', out)
    assert code == 0 and units and [to_si(f"1 {unit}", unit) for unit in units] == [1.0] * len(units)


def test_inspect_tells_quantities_with_units_and_json_in_si() -> None:
    _, out, _ = call("inspect", "fzg_c/stage_relief")
    told = ("torque_max   600 N*m", "pressure_angle   20 deg", "speed_max    6000 rpm", "tip_diameter     82.46 mm")
    for line in (*told, "amount      15 µm", "youngs_modulus  2.06e+11 Pa", "r_b  33.8289 mm"):
        assert line in out
    plain = json.loads(call("inspect", "fzg_c/stage_relief", "--json")[1])
    assert plain["pair"]["pressure_angle"] == pytest.approx(np.radians(20)) and plain["torque_max"] == 600.0
    _, scene, _ = call("inspect", "clutch_closure")
    assert re.search(r"duration +400 ms", scene) and re.search(r"step +100 µs", scene)


def test_bodies_that_are_being_made_are_told_how_far_every_ten_seconds(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from gearfmu.commands import models

    now = [0.0]
    monkeypatch.setattr(shared.time, "monotonic", lambda: now[0])
    with models.reducing() as progress:
        for second in range(25):
            now[0] = float(second)
            progress(second / 40, f"{'wheel' if second % 2 else 'pinion'}: step {second}")
    assert capsys.readouterr().err.splitlines() == [
        "reducing pinion …",
        "reducing wheel …",
        "reducing wheel: step 9, 22 %",
        "reducing pinion: step 18, 45 %",
    ]


def test_long_work_is_told_of_while_nothing_is_heard(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared, "_EVERY", 0.1)
    with shared.progress_bar("te") as progress:
        progress(None, "statics")
        deadline = time.monotonic() + 20
        told = ""
        while told.count("te statics, for ") < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
            told += capsys.readouterr().err
    assert told.count("te statics, for ") >= 2
    time.sleep(0.3)
    assert capsys.readouterr().err == "", "it ends with the work"


def test_bodies_of_a_planetary_set_mesh_and_tell_their_facts(tmp_path: Path) -> None:
    for name in ("ring", "carrier"):
        code, out, _ = call("mesh", "planetary54", "--gear", name, "--scale", 0.34, "--out", tmp_path)
        assert code == 0 and "scaled_jacobian_min" in out and (tmp_path / f"{name}.vtu").is_file()
    code, out, _ = call("inspect", ROOT / "reduced_models" / "planetary54" / "carrier.h5")
    assert code == 0 and "krylov" in out and "trusted_to_Hz" in out and "bolt3" in out
    code, out, _ = call("inspect", "planetary54")
    assert code == 0 and "ring_least_tip_radius" in out and "65.362 mm" in out


@pytest.mark.parametrize("kind", ["stage", "general", "planetary", "scene"])
def test_schema_is_json_and_knows_the_fields(kind: str, tmp_path: Path) -> None:
    assert call("schema", kind, "--out", tmp_path / "s.json")[0] == 0
    made = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))
    known = {"stage": "gears", "general": "engagements", "planetary": "carrier", "scene": "coupling"}
    assert known[kind] in made["properties"]


def small_trace(path: Path) -> Path:
    t = np.arange(2000) * 1e-4
    force = Channel(1000 + 100 * np.sin(2 * np.pi * 300 * t), "N", "normal force")
    Trace(t, {"mesh.force": force}, {"scene": "small", "outcome": "ok"}).save(path)
    return path


def test_inspect_tells_a_trace(tmp_path: Path) -> None:
    code, out, _ = call("inspect", small_trace(tmp_path / "x.h5"), "--json")
    found = json.loads(out)
    assert code == 0 and found["kind"] == "trace" and found["channels"]["mesh.force"]["unit"] == "N"


POOR_FMU = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="poor" guid="{{0}}">
<CoSimulation modelIdentifier="poor"/>
<ModelVariables>{variables}</ModelVariables>
<ModelStructure/>
</fmiModelDescription>"""
POOR_VARIABLE = '<ScalarVariable name="x{0}" valueReference="{0}" causality="output"><Real unit="N"/></ScalarVariable>'


@pytest.mark.parametrize("count", [1, 150])
def test_validate_returns_the_count_at_most_99(tmp_path: Path, count: int) -> None:
    """Outputs without unit definition and outside ModelStructure: at least one problem each."""
    variables = "".join(POOR_VARIABLE.format(i) for i in range(count))
    with zipfile.ZipFile(tmp_path / "poor.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", POOR_FMU.format(variables=variables))
    code, out, _ = call("validate", tmp_path / "poor.fmu")
    found = int(out.strip().splitlines()[-1].split(": ")[1].split()[0])
    assert found >= count and code == min(found, 99) and len(out.strip().splitlines()) >= found


def test_version_is_the_packages() -> None:
    assert call("--version")[1].strip() == f"gearfmu, version {importlib.metadata.version('gearfmu')}"


def test_reduce_tells_degrees_of_freedom_time_and_memory(tmp_path: Path) -> None:
    """Of the shipped bodies, which are up to date: read, not made again."""
    code, out, err = call("reduce", "fzg_c")
    assert code == 0 and err == "" and out.count("up to date, only read; it was reduced in ") == 2
    assert "0 bodies reduced, 2 read" in out
    for gear in ("pinion", "wheel"):
        made = json.loads(call("inspect", ROOT / "reduced_models" / "fzg_c" / f"{gear}.h5", "--json")[1])
        size, cost = made["mesh"], made["provenance"]
        assert f"{size['dof_body']} DOF, {made['facts']['teeth']} sectors of {size['dof_sector']}" in out
        assert f"{cost['cpu_s']:g} s CPU time and {cost['peak_memory_GB']:g} GB" in out


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo terminals")
def test_long_work_shows_a_progress_bar_on_a_terminal_and_only_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pty

    line = "simulate fzg_c --torque 80~N*m --speed 2000~rpm --duration 4~ms --settle 1~ms --set level=rigid".split()
    words = [word.replace("~", " ") for word in line]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    near, far = pty.openpty()
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    with os.fdopen(far, "w", encoding="utf-8") as terminal, redirect_stderr(terminal), redirect_stdout(out):
        assert cli.outcome(words) == 0
    shown = os.read(near, 1 << 16).decode(errors="replace")
    os.close(near)
    plain = call(*words)
    assert "fzg_c" in shown and "━" in shown and "━" not in out.buffer.getvalue().decode()
    assert plain[0] == 0 and "━" not in plain[2], "lines at most, where the machine is slow"


@pytest.fixture
def wreckage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with a file of every kind in it that cannot be used; no lines of progress here."""
    monkeypatch.setattr(shared, "_EVERY", 1e9)
    stage = (ROOT / "reduced_models" / "fzg_c" / "stage.toml").read_text(encoding="utf-8")
    (tmp_path / "stage.toml").write_text(stage.replace("teeth = 16", 'teeth = "many"'), encoding="utf-8")
    scene = (ROOT / "gearfmu" / "scenes" / "pair_light.toml").read_text(encoding="utf-8")
    (tmp_path / "scene.toml").write_text(scene.replace('"20 us"', '"30 us"'), encoding="utf-8")
    small_trace(tmp_path / "trace.h5")
    (tmp_path / "trace.h5").write_bytes((tmp_path / "trace.h5").read_bytes()[:-1])
    body = (ROOT / "reduced_models" / "fzg_c" / "wheel.h5").read_bytes()
    (tmp_path / "body.h5").write_bytes(body[:9999] + b"?" + body[10000:])
    (tmp_path / "damaged.fmu").write_bytes(b"PK\x03\x04 cut")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "line",
    [
        "reduce stage.toml",
        "mesh stage.toml",
        "export stage.toml -o new.fmu",
        "export fzg_c -o new.fmu --port sun=fixed",
        "export fzg_c -o stage.toml/new.fmu",
        "te stage.toml --torque 1_N*m",
        "te fzg_c --torque 1e9_N*m",
        "simulate stage.toml --torque 1_N*m --speed 1_rpm",
        "simulate fzg_c --torque 1_N*m --speed 1_rpm --set level=superb",
        "simulate fzg_c --torque 1_N*m --speed 1_rpm --set h=1",
        "run scene.toml",
        "run pair_light --fmu damaged.fmu",
        "run pair_light --fmu body.h5",
        "report trace.h5",
        "report body.h5",
        "inspect trace.h5",
        "inspect body.h5",
        "inspect damaged.fmu",
        "inspect stage.toml",
        "validate damaged.fmu",
        "new fzg_c/../x",
        "mesh planetary54 --gear wheel",
    ],
)
def test_bad_input_is_one_clear_error_and_nothing_half_written(line: str, wreckage: Path) -> None:
    before = {path: path.read_bytes() for path in wreckage.rglob("*") if path.is_file()}
    code, out, err = call(*(word.replace("_N", " N").replace("_r", " r") for word in line.split()))
    assert code in (1, cli.USAGE_ERROR) and out == "" and "Traceback" not in err and "internal" not in err
    assert len(err.strip()) > 20 and (code == cli.USAGE_ERROR or len(err.strip().splitlines()) == 1), err
    assert {path: path.read_bytes() for path in wreckage.rglob("*") if path.is_file()} == before


def test_run_lists_the_shipped_scenes() -> None:
    code, out, _ = call("run", "--list")
    assert code == 0 and "planetary_shift" in out and "clutch_closure_train   Clutch closure on a two-stage" in out
