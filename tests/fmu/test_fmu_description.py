"""What lies in the FMU: XML from the kernel's table, units, terminals, library, licences; the same bytes every time."""

from __future__ import annotations

import ast
import math
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from fmpy import read_model_description
from small_stage import small_model, unpack

import gearfmu
from gearfmu.body import load_bodies
from gearfmu.errors import FmuError
from gearfmu.fmu import export, package
from gearfmu.fmu.description import DEFAULT_STEP, named
from gearfmu.fmu.package import content_identifier
from gearfmu.fmu.units import base_exponents
from gearfmu.kernel import build, library_path
from gearfmu.kernel.build import BuildError, host_platform
from gearfmu.quantities import HEADER
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.stage import load_stage


@pytest.mark.parametrize(
    "unit, expected",
    [
        ("rad/s2", {"s": -2, "rad": 1}),
        ("N.s/m2", {"kg": 1, "m": -1, "s": -1}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("J/N.m", {}),
        ("kg.m2", {"kg": 1, "m": 2}),
        ("m-1", {"m": -1}),
        ("N/", {"kg": 1, "m": 1, "s": -2}),
        *((unit, None) for unit in ("furlong", "N*m", "m^2", "2m")),
    ],
)
def test_units_are_reduced_to_base_units_or_refused_by_name(unit, expected):
    if expected is None:
        with pytest.raises(FmuError, match="unit"):
            base_exponents(unit)
    else:
        assert base_exponents(unit) == expected


def test_ports_decide_terminals_and_causality(model, other_model, tmp_path):
    def causalities(folder):
        terminals = ET.parse(os.path.join(folder, "terminalsAndIcons", "terminalsAndIcons.xml"))
        by_name = {v.name: v.causality for v in read_model_description(folder).modelVariables}
        return {
            terminal.get("name"): {m.get("memberName"): by_name[m.get("variableName")] for m in terminal}
            for terminal in terminals.iter("Terminal")
        }

    spring = {"phi": "input", "w": "input", "a": "input", "tau": "output", "tau_mean": "output"}
    torque = {"tau": "input", "phi": "output", "w": "output", "a": "output"}
    for stage, wheel in ((model, spring), (other_model, torque)):
        folder = unpack(export(stage, tmp_path / "stage.fmu", terminals=True), tmp_path / wheel["tau"])
        assert causalities(folder) == {"pinion": spring, "wheel": wheel}


def described(fmu: Path) -> ET.Element:
    with zipfile.ZipFile(fmu) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


@pytest.mark.parametrize(
    ("stage", "observe", "least", "said"),
    [
        (
            "planetary54", (), 300,
            {"ring_planet3.pairs": "mesh of planet 3 with the ring: tooth pairs in contact",
             "pin.planet2.mx_mean": "pin planet 2, about x: ", "carrier.tau": "shaft carrier: ",
             "sun.gear.w": "rotor sun: "},
        ),
        (
            "fzg_c", ("wheel",), 200,
            {"wheel.motion.ry": "gear wheel, rigid about y: ", "wheel.mode_14": "gear wheel, mode 14: "},
        ),
    ],
)  # fmt: skip
def test_every_variable_is_described_in_words_of_its_own(stage, observe, least, said):
    """Meshes, supports, shafts and modes by name: nothing else in the list tells planets apart."""
    model = gearfmu.assemble(stage, observe=observe)
    texts = {v.name: v.description for v in named(model.kernel_variables(), model.stage)}
    assert len(set(texts.values())) == len(texts) > least
    assert all(texts[name].startswith(words) for name, words in said.items())


def test_units_have_one_name_each_and_are_shown_as_engineers_read_them(native):
    root = described(native)
    known = {unit.get("name"): base_exponents(unit.get("name")) for unit in root.iter("Unit")}
    twins = {(a, b) for a in known for b in known if a < b and known[a] == known[b]}
    assert twins == {("J", "N.m")}, "energy and torque are two things of one dimension"
    shown = {(real.get("unit"), real.get("displayUnit")) for real in root.iter("Real")}
    assert {("m", "um"), ("rad", "deg"), ("rad/s", "rev/min")} <= shown
    offered = {unit.get("name"): [d.get("name") for d in unit.iter("DisplayUnit")] for unit in root.iter("Unit")}
    assert all(display in (offered[unit] or [None]) for unit, display in shown)


def test_nominal_sizes_follow_the_stage(native):
    """By hand: 600 N·m, 6000 rpm; z = 16, m = 4.5 mm, 20° make r_b = 33.8 mm and 17.7 kN. One digit is kept."""
    root = described(native)
    sizes = {real.get("unit"): float(real.get("nominal")) for real in root.iter("Real") if real.get("nominal")}
    assert sizes == {"N.m": 600.0, "N": 2e4, "rad/s": 600.0, "m": 1e-5}
    assert all(v[0].get("nominal") is None for v in root.iter("ScalarVariable") if v.get("causality") != "output")


def test_a_model_is_its_makers(model, native, tmp_path):
    """Without the options nothing is said of rights; no name of ours stands for the user's model."""
    said = {"author": "A. Müller", "copyright": "© 2026 Müller", "license": "proprietary"}
    root = described(export(model, tmp_path / "own.fmu", **said))
    assert {name: root.get(name) for name in said} == said
    assert not set(said) & set(described(native).attrib)


def test_every_kernel_that_is_installed_goes_in(model, tmp_path, monkeypatch):
    """Those that a machine lacks do not; a platform that is asked for and missing is an error."""
    library = library_path()
    there = {"linux64": library, "win64": library.with_name("kernel.dll"), host_platform(): library}

    def only(platform: str = "host") -> Path:
        if platform not in there and platform != "host":
            raise BuildError(f"no kernel for {platform}")
        return library if platform == "host" else there[platform]

    (tmp_path / "kernel.dll").write_bytes(b"MZ")
    there["win64"] = tmp_path / "kernel.dll"
    monkeypatch.setattr(package, "library_path", only)
    with zipfile.ZipFile(export(model, tmp_path / "all.fmu")) as archive:
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert folders == {"win64", "linux64", host_platform()}
    with pytest.raises(BuildError, match="darwin64"):
        export(model, tmp_path / "none.fmu", platforms=("darwin64",))


@pytest.mark.parametrize(
    "system, processor, name",
    [
        ("Linux", "x86_64", "linux64"),
        ("Linux", "aarch64", "aarch64-linux"),
        ("Windows", "AMD64", "win64"),
        ("Darwin", "arm64", "darwin64"),
        ("Linux", "riscv64", None),
        ("Windows", "ARM64", None),
    ],
)
def test_no_other_processor_is_called_linux64(monkeypatch, system, processor, name):
    monkeypatch.setattr(build._platform, "system", lambda: system)
    monkeypatch.setattr(build._platform, "machine", lambda: processor)
    if name is None:
        with pytest.raises(BuildError, match=processor):
            host_platform()
    else:
        assert host_platform() == name


def test_same_model_same_bytes(model, native, python, tmp_path, monkeypatch):
    monkeypatch.setattr(time, "time", lambda: 4e9)
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    for fmu, runtime in ((native, "native"), (python, "python")):
        assert export(model, tmp_path / "again.fmu", runtime=runtime).read_bytes() == fmu.read_bytes()


def test_identifiers_are_c_names_that_tell_contents_apart():
    names = [content_identifier(name, [b"a"]) for name in ("fzg_c", "2 gears-à", "", "x" * 200)]
    assert all(name.isidentifier() and name.isascii() and len(name) < 64 for name in names)
    contents = ([b"a"], [b"b"], [b"a", b""], [b"", b"a"], [b"ab"], [b"a", b"b"])
    assert len({content_identifier("s", content) for content in contents}) == len(contents)


def test_python_slave_needs_no_numpy_and_its_module_carries_its_content(model, python, tmp_path):
    def slave(fmu):
        with zipfile.ZipFile(fmu) as archive:
            name = archive.read("resources/slavemodule.txt").decode().strip()
            return name, archive.read(f"resources/{name}.py").decode()

    name, text = slave(python)
    imported = {
        node.module if isinstance(node, ast.ImportFrom) else alias.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
    }
    assert {module.split(".")[0] for module in imported} <= {"__future__", "pythonfmu", *sys.stdlib_module_names}
    renamed = slave(export(small_model(), tmp_path / "same.fmu", runtime="python"))[0]
    other = slave(export(small_model("fzg_c"), tmp_path / "other.fmu", runtime="python"))[0]
    assert renamed == name != other and name.isidentifier()


def test_licences_travel_along(native, python):
    def text(fmu, name):
        with zipfile.ZipFile(fmu) as archive:
            return archive.read(f"documentation/licenses/{name}").decode()

    assert "BSD 3-Clause" in text(native, "license.txt") and "MODELISAR" in text(native, "license.txt")
    assert "Permission is hereby granted" in text(python, "pythonfmu.txt")


@pytest.mark.parametrize(
    "options, word",
    [({"runtime": "java"}, "runtime"), ({"platforms": ()}, "platforms"), ({"platforms": ("amiga",)}, "amiga")],
)
def test_unknown_options_are_named(model, tmp_path, options, word):
    with pytest.raises(Exception, match=word):
        export(model, tmp_path / "x.fmu", **options)
    assert not list(tmp_path.iterdir())


def test_the_kernel_makes_ready_for_the_step_of_the_description():
    row = next(line for line in HEADER.read_text(encoding="utf-8").splitlines() if "GK_USUAL_H" in line)
    assert float(row.split()[2]) == DEFAULT_STEP


# ---- the GUID says what the model was made of: stage, files, bodies, ports, starts; no rounding, no order ------------
MAKES = """
import sys
from gearfmu.body import load_bodies
from gearfmu.stagefile.stage import load_stage
from gearfmu.stage import assemble
spec = load_stage(sys.argv[1])
model = assemble(spec, load_bodies(spec))
print(model.hash, model.guid)
"""


def made(**changes: object) -> StageModel:
    spec = load_stage("fzg_c/stage_relief")
    return assemble(rewritten(spec, **changes), load_bodies(spec))


@pytest.mark.parametrize("stage", ["fzg_c", pytest.param("helical_demo", marks=pytest.mark.full)])
def test_other_rounding_leaves_the_guid(stage: str) -> None:
    """Two sets of routines of one linear algebra stand for two versions of numpy: the numbers differ, the GUID does
    not. Where a processor knows one of them only, the hashes agree as well and the test says nothing."""
    spec = load_stage(stage)
    here = assemble(spec, load_bodies(spec))
    environment = os.environ | {"OPENBLAS_CORETYPE": "Prescott"}
    command = [sys.executable, "-c", MAKES, stage]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    hash_there, guid_there = done.stdout.split()
    assert guid_there == here.guid
    if hash_there == here.hash:
        pytest.skip("this linear algebra has one set of routines here")


def test_what_a_model_is_made_of_changes_the_guid() -> None:
    spec = load_stage("fzg_c/stage_relief")
    base = made()
    ports = {name: port.model_copy(update={"k": 1e5}) for name, port in spec.ports.items()}
    others = [
        made(),
        made(torque_max=math.nextafter(spec.written.torque_max, math.inf)),
        made(name="another"),
        made(ports=ports),
        base.with_starts({"level": 1.0}),
        assemble(spec, load_bodies(spec), observe=["pinion"]),
    ]
    guids = [model.guid for model in (base, *others)]
    assert guids[0] == guids[1] != base.hash and len(set(guids)) == len(guids) - 1


def test_the_way_to_a_model_leaves_the_guid() -> None:
    """Torque ports turned into springs are springs of the file; a start that is set twice is set once."""
    spec = load_stage("fzg_c/stage_relief")
    torques = {name: port.model_copy(update={"kind": "torque"}) for name, port in spec.ports.items()}
    springs = {name: port.model_copy(update={"kind": "spring"}) for name, port in spec.ports.items()}
    assert made(ports=torques).driven_by_springs().guid == made(ports=springs).guid != made(ports=torques).guid
    fast = made().with_starts({"level": 1.0})
    assert fast.with_starts({"level": 1.0}).guid == fast.guid
