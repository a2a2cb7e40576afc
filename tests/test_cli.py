"""The command line: exit codes, one clear message, nothing half-written; verbs that need no long work are run."""

from __future__ import annotations

import importlib
import importlib.metadata
import io
import json
import os
import re
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


def test_help_names_every_verb() -> None:
    code, out, _ = call("--help")
    assert code == 0 and not [verb for verb in cli.VERBS if f"\n  {verb} " not in out]


def test_debug_shows_the_traceback() -> None:
    code, _, err = call("--debug", "inspect", "fzg_x")
    assert code == 1 and "Traceback" in err


@pytest.mark.parametrize("verb", ["simulate", "te", "modes", "frf", "import", "run"])
def test_help_shows_units_as_the_options_take_them(verb: str) -> None:
    from gearfmu.quantities import to_si

    code, out, _ = call(verb, "--help")
    units = re.findall(r'"<number> ([^"]+)"', out)
    assert code == 0 and units and [to_si(f"1 {unit}", unit) for unit in units] == [1.0] * len(units)


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


def small_trace(path: Path) -> Path:
    t = np.arange(2000) * 1e-4
    force = Channel(1000 + 100 * np.sin(2 * np.pi * 300 * t), "N", "normal force")
    Trace(t, {"mesh.force": force}, {"scene": "small", "outcome": "ok"}).save(path)
    return path


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


REFUSED = {  # command line, words apart by blanks (a unit after "_"): what the message says
    "": "Usage",
    "nonsense": "no verb 'nonsense'",
    "simulat fzg_c": "did you mean simulate?",
    "new": "NAME",
    "new mine --teeth x": "--teeth",
    "new mine --teeth 31_73 --like fzg_c": "--like",
    "new mine --like fzg_k": "fzg_c",
    "new fzg_c/../x": "small letters",
    "study pair_loaded": "--out",
    "study --out x": "SCENE",
    "study pair_loadet --out x": "pair_loaded",
    "reduce stage.toml": "teeth",
    "mesh stage.toml": "teeth",
    "mesh fzg_c --gear sun": "sun",
    "mesh planetary54 --gear wheel": "wheel",
    "te fzg_c": "--torque",
    "te fzg_c --torque 302": "unit",
    "te fzg_c --torque 302_mm": "N*m",
    "te fzg_c --torque 300_N*m --positions 1": "--positions",
    "te fzg_k --torque 1_N*m": "fzg_c",
    "te fzg_c --torque 1e9_N*m": "torque",
    "te stage.toml --torque 1_N*m": "teeth",
    "simulate stage.toml --torque 1_N*m --speed 1_rpm": "teeth",
    "simulate fzg_c --torque 1_N*m --speed 1_rpm --set level=superb": "superb",
    "simulate fzg_c --torque 1_N*m --speed 1_rpm --set h=1": "h",
    "bearings fzg_c": "has no rolling bearings",
    "bearings helical_demo/stage_bearings --torque 80": "N*m",
    "frf planetary54 wheel --out none": "no body 'wheel'; the stage has sun, planet, ring, carrier",
    "frf planetary54 carrier --methods guyan --out none": "methods = guyan: is no method; there are modal",
    "frf planetary54 carrier --scale 0.2 --methods krylov --size 20 --out none": "give at least that",
    "frf planetary54 carrier --band 5_kHz 1_kHz --scale 0.2 --out none": "from a lower to a higher frequency",
    "run clutch_closur": "clutch_closure",
    "run clutch_closure --unit guess": "--unit",
    "run clutch_closure --unit kernel --fmu stage.fmu": "--fmu",
    "run scene.toml": "scene.toml",
    "run pair_light --fmu damaged.fmu": "damaged.fmu",
    "run pair_light --fmu body.h5": "body.h5",
    "export": "STAGE",
    "export stage.toml -o new.fmu": "teeth",
    "export fzg_c --scene pair_loaded --port wheel=fixed": "--port",
    "export fzg_c --port pinion": "--port",
    "export fzg_c --port pinion=glue": "glue",
    "export fzg_c -o new.fmu --port sun=fixed": "sun",
    "export fzg_c -o stage.toml/new.fmu": "stage.toml",
    "schema stage extra": "extra",
    "inspect": "Missing argument",
    "inspect no/such.h5": "no such file",
    "inspect fzg_x": "fzg_c",
    "inspect trace.h5": "trace.h5",
    "inspect body.h5": "body.h5",
    "inspect damaged.fmu": "damaged.fmu",
    "inspect stage.toml": "teeth",
    "report no/such": "no such trace file",
    "report trace.h5": "trace.h5",
    "report body.h5": "body.h5",
    "validate damaged.fmu": "damaged.fmu",
}


@pytest.mark.parametrize("line", REFUSED)
def test_bad_input_is_one_clear_error_and_nothing_half_written(line: str, wreckage: Path) -> None:
    before = {path: path.read_bytes() for path in wreckage.rglob("*") if path.is_file()}
    code, out, err = call(*(re.sub(r"(?<=\d)_", " ", word) for word in line.split()))
    assert code in (1, cli.USAGE_ERROR) and out == "" and "Traceback" not in err and "internal" not in err
    assert len(err.strip()) > 20 and (code == cli.USAGE_ERROR or len(err.strip().splitlines()) == 1), err
    assert REFUSED[line] in " ".join(err.split())
    assert {path: path.read_bytes() for path in wreckage.rglob("*") if path.is_file()} == before


BODIES = ROOT / "reduced_models"
SHOWN = {  # command line: what is written to standard output
    "--version": (f"gearfmu, version {importlib.metadata.version('gearfmu')}",),
    "run --list": ("planetary_shift", "clutch_closure_train   Clutch closure on a two-stage"),
    "inspect planetary54": ("ring_least_tip_radius", "65.362 mm"),
    f"inspect {BODIES}/planetary54/carrier.h5": ("krylov", "trusted_to_Hz", "bolt3"),
    "mesh planetary54 --gear ring --scale 0.34 --out .": ("scaled_jacobian_min", "ring.vtu"),
    "mesh planetary54 --gear carrier --scale 0.34 --out .": ("scaled_jacobian_min", "carrier.vtu"),
    "schema stage": ('"gears"',),
    "schema general": ('"engagements"',),
    "schema planetary": ('"carrier"',),
    "schema scene": ('"coupling"',),
    "inspect whole.h5 --json": ('"kind": "trace"', '"unit": "N"'),
    "inspect fzg_c/stage_relief": (
        "torque_max   600 N*m", "pressure_angle   20 deg", "speed_max    6000 rpm", "tip_diameter     82.46 mm",
        "amount      15 µm", "youngs_modulus  2.06e+11 Pa", "r_b  33.8289 mm",
    ),
    "inspect fzg_c/stage_relief --json": ('"pressure_angle": 0.349', '"torque_max": 600.0'),
    "inspect clutch_closure": ("400 ms", "100 µs"),
    "reduce fzg_c": ("up to date, only read; it was reduced in ", "0 bodies reduced, 2 read"),
}  # fmt: skip


@pytest.mark.parametrize("line", SHOWN)
def test_verbs_show_and_write(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    small_trace(tmp_path / "whole.h5")
    code, out, _ = call(*line.split())
    assert code == 0 and not [words for words in SHOWN[line] if words not in out], out
    if "--json" in line or "schema" in line:
        json.loads(out)
    if "mesh" in line:
        assert (tmp_path / SHOWN[line][1]).is_file()


def test_reduce_tells_degrees_of_freedom_time_and_memory() -> None:
    out = call("reduce", "fzg_c")[1]
    for gear in ("pinion", "wheel"):
        made = json.loads(call("inspect", BODIES / "fzg_c" / f"{gear}.h5", "--json")[1])
        size, cost = made["mesh"], made["provenance"]
        assert f"{size['dof_body']} DOF, {made['facts']['teeth']} sectors of {size['dof_sector']}" in out
        assert f"{cost['cpu_s']:g} s CPU time and {cost['peak_memory_GB']:g} GB" in out
