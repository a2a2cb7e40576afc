"""`gearfmu validate` and the probes of evidence/fmu_probes find what is wrong, and only that: each damage to a good FMU
gives the finding that names it."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

import pytest
from builds import edited_library, leaky_library

import gearfmu as gf
from evidence.fmu_probes.everything import findings
from gearfmu.errors import FmuError, Problem
from gearfmu.fmu import export, validate
from gearfmu.fmu.package import write_archive
from gearfmu.kernel.build import host_platform


@pytest.fixture(scope="module")
def members(model, tmp_path_factory) -> dict[str, bytes]:
    """Of an FMU with all that is looked at."""
    fmu = export(model, tmp_path_factory.mktemp("members") / "stage.fmu", platforms=("host",), terminals=True)
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def binary_of(members: dict[str, bytes]) -> str:
    return next(name for name in members if name.startswith(f"binaries/{host_platform()}/"))


def damaged(members: dict[str, bytes], changes: dict[str, bytes | None], folder: Path) -> Path:
    """The FMU with these members replaced, or left out where None."""
    changed = {name: content for name, content in {**members, **changes}.items() if content is not None}
    return write_archive(folder / "damaged.fmu", changed)


def problems_of(members: dict[str, bytes], changes: dict[str, bytes | None], folder: Path) -> list[Problem]:
    """What `gearfmu validate` says of it."""
    return validate(damaged(members, changes, folder))


def edited(members: dict[str, bytes], old: str, new: str, name: str = "modelDescription.xml") -> dict[str, bytes]:
    text = members[name].decode()
    assert old in text
    return {name: text.replace(old, new, 1).encode()}


def test_good_fmus_have_no_problems(native, python, other):
    assert [findings(fmu) for fmu in (native, python, other)] == [[], [], []]


@pytest.mark.full
@pytest.mark.parametrize(("name", "kind"), [("planetary54", "torque"), ("planetary54", "spring"), ("two_stage", "")])
def test_fmus_of_sets_and_trains_have_none_either(name, kind, tmp_path):
    ports = {"carrier": kind, "sun": kind} if kind else None
    assert findings(export(gf.assemble(name, ports=ports), tmp_path / "stage.fmu")) == []


@pytest.fixture
def unrun(monkeypatch) -> None:
    """The FMU is not run in a process of its own."""
    monkeypatch.setattr(sys.modules["gearfmu.fmu.validate"], "_first_run", lambda *_: ())


@pytest.mark.parametrize(
    "old, new, expected",
    [
        ('<BaseUnit kg="1" m="1" s="-2" />', "", "declare a unit with its SI base units"),
        ('guid="', 'guid="0', "Failed to instantiate model"),
        ('<Unknown index="', '<Unknown index="9', "modelDescription.xml"),
    ],
)
def test_changes_of_the_description(members, tmp_path, old, new, expected):
    problems = problems_of(members, edited(members, old, new), tmp_path)
    assert any(expected in str(problem) for problem in problems), "\n".join(map(str, problems))
    assert all(problem.file.endswith("damaged.fmu") and problem.remedy for problem in problems)


@pytest.mark.parametrize(
    "old, new, expected",
    [
        ('name="mesh.te"', 'name="mesh.tee"', "mesh.te: only in the binary"),
        ('unit="N.m"', 'unit="N"', "unit: N: the binary says N.m"),
        ('start="0.0"', 'start="0.5"', "modelDescription.xml declares start=0.5"),
        ('causality="output"', 'causality="local"', "ModelStructure"),
    ],
)
def test_a_description_that_is_not_the_binarys(unrun, members, tmp_path, old, new, expected):
    found = findings(damaged(members, edited(members, old, new), tmp_path), ("kernel_table", "start_values"))
    assert any(expected in text for text in found), found


def test_terminals_are_looked_at(unrun, members, tmp_path):
    name = "terminalsAndIcons/terminalsAndIcons.xml"
    unknown = problems_of(members, edited(members, '"pinion.phi"', '"pinion.psi"', name), tmp_path)
    assert [problem.value for problem in unknown] == ["is no variable of the FMU"]
    shapeless = problems_of(members, edited(members, "matchingRule=", "matching=", name), tmp_path)
    assert any("matching" in problem.value for problem in shapeless)


def test_missing_and_misnamed_binaries(members, tmp_path):
    name = binary_of(members)
    gone = problems_of(members, {name: None}, tmp_path)
    assert [problem.value for problem in gone] == ["no binary for a platform known here"]
    moved = problems_of(members, {name: None, name + "x.so": members[name]}, tmp_path)
    assert any("is missing" in problem.value for problem in moved)


def test_damaged_model_is_refused_by_the_binary(members, tmp_path):
    problems = problems_of(members, {"resources/model.gkb": members["resources/model.gkb"][:-1]}, tmp_path)
    assert problems and all("export" in p.remedy for p in problems)


@pytest.mark.needs("gcc")
def test_leaked_symbols_are_found(unrun, members, tmp_path):
    leaky = leaky_library().read_bytes()
    found = findings(damaged(members, {binary_of(members): leaky}, tmp_path), ())
    assert len(found) == 1 and "leaked is exported" in found[0]


@pytest.mark.needs("gcc")
def test_a_crash_is_a_finding(members, tmp_path):
    """A binary whose fmi2DoStep holds an invalid instruction."""
    step = r"(fmi2Status fmi2DoStep\([^)]*\)\s*\{)"
    crashing = edited_library("crashing", {step: r"\1 __builtin_trap();"}, "double").read_bytes()
    (problem,) = problems_of(members, {binary_of(members): crashing}, tmp_path)
    assert problem.field == "a run of 10 steps" and "ended with code -" in problem.value


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 cut"])
def test_what_is_no_fmu_at_all(tmp_path, content):
    file = tmp_path / "x.fmu"
    file.write_bytes(content)
    with pytest.raises(FmuError, match="cannot be read as an FMU"):
        validate(file)
    with pytest.raises(FmuError, match="cannot be read as an FMU"):
        validate(tmp_path / "missing.fmu")
