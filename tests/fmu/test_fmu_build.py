"""Building the kernel library: a stale one is noticed, bad wishes are named, only the agreed symbols are exported."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from evidence.fmu_probes.everything import exchange_functions, fmi_functions
from evidence.fmu_probes.symbols import exported_symbols
from gearfmu.kernel import build, library_path
from gearfmu.kernel.build import BuildError


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
