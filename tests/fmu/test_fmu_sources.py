"""An FMU that brings its C sources: what a compiler makes of them is the FMU's own binary."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from fmpy import read_model_description
from lxml import etree
from small_stage import unpack

from evidence.fmu_probes.everything import exchange_functions, findings, fmi_functions
from evidence.fmu_probes.probes import Subject
from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.errors import FmuError
from gearfmu.fmu import export
from gearfmu.kernel import build, library_path
from gearfmu.kernel.build import BuildError, host_platform

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


# ---- building the kernel library: a stale one is noticed, bad wishes are named, only the agreed symbols are exported -
@pytest.fixture
def package(tmp_path, monkeypatch) -> Path:
    """A copy of the kernel's folder that the search looks into, without library."""
    shutil.copytree(build.HERE / "src", tmp_path / "src")
    monkeypatch.setattr(build, "_package_folders", lambda: [tmp_path])
    return tmp_path


def place_library(package: Path) -> Path:
    """A library there that claims to come from the sources there."""
    library = package / "lib" / build.host_platform() / (build.STEM + build.SUFFIX[build.host_platform()])
    library.parent.mkdir(parents=True)
    library.write_bytes(b"library")
    library.with_suffix(".sources").write_text(build.source_hash(build.sources(package)) + "\n")
    return library


def test_missing_library_names_the_remedy(package, monkeypatch):
    with pytest.raises(BuildError, match="build it with `python -m gearfmu.kernel`"):
        library_path()


STALE = {  # what is done to a source, and whether the library is stale then
    "edited": (lambda file: file.write_text(file.read_text() + "/* edited */\n"), True),
    "one more": (lambda file: file.with_name("gk_new.c").write_text(""), True),
    "one less": (Path.unlink, True),
    "other line ends": (lambda file: file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n")), False),
    "nothing": (Path.touch, False),
}


@pytest.mark.parametrize("change", STALE)
def test_any_change_of_the_sources_makes_it_stale_and_it_is_built_again_then(package, monkeypatch, change):
    monkeypatch.setattr(build, "HERE", package)
    monkeypatch.setattr(build, "build_library", lambda: "built")
    assert build.current_library() == "built"
    library, (edit, stale) = place_library(package), STALE[change]
    edit(package / "src" / "base" / "gk_math.c")
    assert build.current_library() == ("built" if stale else library)
    if stale:
        with pytest.raises(BuildError, match="rebuild it with `python -m gearfmu.kernel`"):
            library_path()
    else:
        assert library_path() == library


def test_sources_of_the_avx2_unit_are_compiled_at_less_cost_where_it_is():
    files = [p for p in build.sources() if p.suffix == ".c"]
    unit = next(p for p in files if p.stem == "gk_wide").read_text()
    for target, cheap in (("x86_64-linux-gnu.2.17", unit.count('.c"\n')), ("aarch64-macos.11.0", 0)):
        lines = build._compilations(["zig", "cc", "-target", target], (), files, Path("out"))
        assert [path.stem for path in lines][0] == "gk_wide"
        assert sum(line[4] == "-O1" for line in lines.values()) == cheap, target


def test_compiler_errors_are_shown_and_leave_the_old_library(tmp_path, monkeypatch):
    broken = tmp_path / "broken.c"
    broken.write_text("int f(void) { return undeclared_name; }\n")
    monkeypatch.setattr(build, "sources", lambda: [broken])
    target = tmp_path / "kept.so"
    target.write_bytes(b"old")
    with pytest.raises(BuildError, match="undeclared_name"):
        build.build_library(out=target, compiler=("cc",))
    assert target.read_bytes() == b"old" and sorted(p.name for p in tmp_path.iterdir()) == ["broken.c", "kept.so"]


@pytest.mark.parametrize("wish, word", [({"platform": "amiga"}, "amiga"), ({"real": "half"}, "half")])
def test_bad_wishes_are_named(wish, word):
    with pytest.raises(BuildError, match=word):
        build.build_library(**wish)


def test_command_line_fails_with_one_line():
    command = [sys.executable, "-m", "gearfmu.kernel", "--platform", "amiga"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("error: ") and done.stderr.count("\n") == 1


def test_exported_symbols_are_the_two_interfaces():
    names = exported_symbols(library_path())
    kernel = {name for name in names if name.startswith("gk_")}
    assert names - kernel == fmi_functions() | exchange_functions(), "those of model exchange are refused"
    assert len(fmi_functions()) == 34 and len(exchange_functions()) == 10
    headers = [path.read_text(encoding="utf-8") for path in (build.HERE / "src").rglob("*.h")]
    prototypes = [line for header in headers for line in header.splitlines() if line.startswith("GK_API ")]
    declared = {line.split("(")[0].split()[-1].lstrip("*") for line in prototypes}
    assert kernel == declared


def test_host_library_needs_no_new_glibc():
    """With ziglang it is built against glibc 2.17, which every supported Linux has."""
    pytest.importorskip("ziglang", reason='needs ziglang: pip install "gearfmu[cross]"')
    versions = {word.decode() for word in library_path().read_bytes().split(b"\0") if word.startswith(b"GLIBC_2.")}
    assert versions and max(tuple(map(int, v.removeprefix("GLIBC_").split("."))) for v in versions) <= (2, 17)
