"""An FMU that brings its C sources: what a compiler makes of them is the FMU's own binary."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import fmpy
import pytest
from fmpy import read_model_description
from lxml import etree
from small_stage import unpack

from evidence.fmu_probes.everything import findings
from evidence.fmu_probes.probes import Subject
from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.errors import FmuError
from gearfmu.fmu import export
from gearfmu.kernel.build import host_platform

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3BuildDescription.xsd"


@pytest.fixture(scope="module")
def with_sources(model, tmp_path_factory) -> Path:
    return export(model, tmp_path_factory.mktemp("sources") / "stage.fmu", sources=True)


def test_the_build_description_follows_its_schema_and_names_every_file(with_sources, tmp_path):
    folder = Path(unpack(with_sources, tmp_path))
    document = etree.parse(folder / "sources" / "buildDescription.xml")
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(document)
    named = document.xpath("//SourceFile/@name")
    description = read_model_description(str(folder))
    listed = etree.parse(folder / "modelDescription.xml").xpath("//CoSimulation/SourceFiles/File/@name")
    assert named == listed
    there = {path.relative_to(folder / "sources").as_posix() for path in (folder / "sources").rglob("*.c")}
    assert set(named) == there and len(named) > 20
    assert document.xpath("//BuildConfiguration/@modelIdentifier") == [description.coSimulation.modelIdentifier]


def test_sources_do_not_change_the_rest(with_sources, native):
    assert not findings(with_sources, ())
    assert with_sources.stat().st_size - native.stat().st_size < 400_000


def test_the_python_runtime_has_none(model, tmp_path):
    with pytest.raises(FmuError, match="runtime native"):
        export(model, tmp_path / "stage.fmu", runtime="python", sources=True)


@pytest.mark.full
@pytest.mark.needs("gcc")
def test_the_sources_make_the_binary(with_sources, tmp_path):
    """Compiled as buildDescription.xml says, with nothing else: the same bits as the binary that came with them."""
    folder = Path(unpack(with_sources, tmp_path))
    shipped = Subject(str(folder)).initialized().run(100)
    code, identifier = folder / "sources", read_model_description(str(folder)).coSimulation.modelIdentifier
    document = etree.parse(code / "buildDescription.xml")
    options = document.xpath("string(//SourceFileSet/@compilerOptions)").split()
    files = [str(code / name) for name in document.xpath("//SourceFile/@name")]
    folders = [f"-I{code / name}" for name in document.xpath("//IncludeDirectory/@name")]
    libraries = [f"-l{name}" for name in document.xpath("//Library/@name")]
    built = folder / "built.so"
    subprocess.run(
        ["gcc", "-shared", "-fPIC", *options, *folders, "-o", str(built), *files, *libraries], check=True, cwd=tmp_path
    )
    binary = next((folder / "binaries" / host_platform()).glob(f"{identifier}.*"))
    apart = tmp_path / "apart"
    shutil.copytree(folder, apart)
    shutil.move(built, apart / binary.relative_to(folder))
    assert Subject(str(apart)).initialized().run(100) == shipped
    assert re.search(rb"GCC: ", (apart / binary.relative_to(folder)).read_bytes())


@pytest.mark.full
@pytest.mark.needs("gcc")
def test_sources_export_their_interface_alone_whatever_the_flags(with_sources, tmp_path):
    """Two such FMUs in one host do not meet in each other's functions: no flag of ours, not even hidden visibility."""
    folder = Path(unpack(with_sources, tmp_path))
    code = folder / "sources"
    files = etree.parse(code / "buildDescription.xml").xpath("//SourceFile/@name")
    command = ["gcc", "-shared", "-fPIC", "-O0", f"-I{code}", "-o", "plain.so", *(str(code / name) for name in files)]
    subprocess.run([*command, "-lm"], check=True, cwd=tmp_path)
    binary = next((folder / "binaries" / host_platform()).glob("*.so"))
    assert exported_symbols(tmp_path / "plain.so") == exported_symbols(binary)
