"""One source, the same bits: whatever the compiler, the optimisation and the contents of uninitialised memory; and with
GK_ASSERT, of which none fails. A machine without C compiler."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from builds import checked_library
from golden import REALS, moved, results, stored
from probes import build, compilers, source_folder

from gearfmu import cosim
from gearfmu.kernel import binding, instance, library_path
from gearfmu.kernel import build as kernel_build
from gearfmu.kernel.build import FLAGS, BuildError, fmi_headers
from gearfmu.scenefile.scene import load_scene

REALS_OF = {"-O0": ("float",), "-O1": REALS, "-O3": REALS, "-march=native": ("float",)}
BUILDS = [(real, compiler, flag) for compiler in compilers() for flag, reals in REALS_OF.items() for real in reals]
CHECKS = 150  # GK_ASSERT in the sources, at least
QUICK_SCENES = [("pair_loaded", {"duration": "60 ms"}), ("clutch_closure", {"duration": "130 ms"})]  # it has locked
LONG_SCENES = ("pair_loaded", "clutch_closure", "clutch_closure_train", "planetary_closure")


@pytest.mark.full
@pytest.mark.parametrize(("real", "compiler", "flag"), BUILDS)
def test_same_bits_from_every_compiler(real: str, compiler: str, flag: str, tmp_path: Path) -> None:
    """Golden runs: every integrator, kind of stage and effect; of the pair where nothing is optimised."""
    part = "pair/" if flag == "-O0" else ""
    built = build(tmp_path, compilers()[compiler], (flag,), real=real)
    assert not moved(stored(real, part), results(built, part))


FUSED_ONCE = ("problem/gk_nodal.c", "run/gk_amplitudes.c", "run/gk_supports.c", "setup/gk_deviation.c")
WITH_FMA = ("-march=x86-64-v3", "-DGK_PORTABLE")  # processors of 2013 and later
WHOLE = [pytest.param("**/*.c", marks=pytest.mark.full)]


@pytest.mark.skipif(platform.machine() != "x86_64" or "gcc" not in compilers(), reason="needs gcc for x86-64")
@pytest.mark.parametrize("files", [*FUSED_ONCE, *WHOLE])
def test_no_product_and_sum_are_fused(files: str) -> None:
    """gcc's straight-line vectoriser fuses products with a sum beside a difference (vfmaddsub), whatever -ffp-contract
    says: other bits on processors that can, first with deviations and nodal contact."""
    paths = list(source_folder().glob(files))
    assert paths
    for path in paths:
        line = ["gcc", *FLAGS, *WITH_FMA, f"-I{source_folder()}", f"-I{fmi_headers()}", "-S", str(path), "-o", "-"]
        done = subprocess.run(line, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert not re.search(r"\bvfn?m(add|sub)", done.stdout), path.name


# ---- with GK_ASSERT --------------------------------------------------------------------------------------------------
def apart(run: Callable[[], object]) -> int:
    """Exit code of a fork of this process that calls `run`: a check that fails ends it."""
    if child := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    code = 1
    try:
        run()
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def golden_runs(real: str = "float", part: str = "") -> None:
    assert not moved(stored(real, part), results(checked_library(real), part))


def scene(name: str, changes: dict[str, str]) -> None:
    """Runs it on the kernel with checks."""
    checked = binding.load(checked_library())
    instance.load = lambda library=None: checked
    instance._opened.cache_clear()
    assert cosim.run(load_scene(name, changes), unit="kernel").meta["outcome"] == "ok"


def test_no_check_fails_in_runs_of_the_pair() -> None:
    assert apart(partial(golden_runs, part="pair/")) == 0


@pytest.mark.full
@pytest.mark.parametrize("real", REALS)
def test_no_check_fails_in_golden_runs(real: str) -> None:
    assert apart(partial(golden_runs, real)) == 0


@pytest.mark.parametrize(
    ("name", "changes"), [*QUICK_SCENES, *(pytest.param(name, {}, marks=pytest.mark.full) for name in LONG_SCENES)]
)
def test_no_check_fails_in_scenes(name: str, changes: dict[str, str]) -> None:
    assert apart(partial(scene, name, changes)) == 0


def test_a_check_that_fails_ends_the_process_and_says_where() -> None:
    call = f"import ctypes; ctypes.CDLL({str(checked_library())!r}).gk_model_name(None)"
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True)
    assert done.returncode == -6
    assert re.search(r"model/gk_text\.c:\d+: GK_ASSERT\(model\) failed", done.stderr)


def test_the_product_has_no_checks() -> None:
    assert b"GK_ASSERT" not in library_path().read_bytes()
    assert b"GK_ASSERT" in checked_library().read_bytes()


def test_doors_and_accessors_are_checked() -> None:
    files = [*source_folder().rglob("*.c"), *source_folder().rglob("*.h")]
    assert sum(len(re.findall(r"^ *GK_ASSERT\(", path.read_text("utf-8"), re.M)) for path in files) >= CHECKS


# ---- without C compiler: pip is asked for one, and no message sends the reader in a circle ---------------------------
ROOT = Path(__file__).resolve().parents[2]
HOOK = "import setuptools.build_meta as hooks; print(hooks.get_requires_for_build_{what}())"


@pytest.fixture
def no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder as the only one on PATH."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    for name in ("CC", "GEARFMU_PLATFORMS"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path / "bin"


def compiler_in(folder: Path) -> None:
    (folder / "clang").write_text("#!/bin/sh\n", encoding="utf-8")
    (folder / "clang").chmod(0o755)


@pytest.mark.skipif(sys.platform == "win32", reason="the compiler in this test is a shell script")
@pytest.mark.parametrize("what", ["wheel", "editable"])
def test_the_build_hook_asks_for_a_compiler_only_where_there_is_none(
    what: str, no_compiler: Path, tmp_path: Path
) -> None:
    """What pip asks before it builds (PEP 517). The build ended without compiler instead."""
    source = tmp_path / "source"
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        source.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, source)
    for name in ("__init__.py", "errors.py", "kernel/__init__.py", "kernel/build.py"):
        (source / "gearfmu" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "gearfmu" / name, source / "gearfmu" / name)
    command = [sys.executable, "-c", HOOK.format(what=what)]

    def asked() -> str:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        done = subprocess.run(command, cwd=source, capture_output=True, text=True, env=environment, check=True)
        return done.stdout.splitlines()[-1]

    assert kernel_build.ZIG in asked()
    compiler_in(no_compiler)
    assert "zig" not in asked()


def test_requirements_follow_the_platforms(no_compiler: Path) -> None:
    assert kernel_build.build_requirements([]) == [kernel_build.ZIG]
    assert kernel_build.build_requirements(["none"]) == []
    compiler_in(no_compiler)
    assert kernel_build.build_requirements([]) == []
    assert kernel_build.build_requirements(["linux64", "win64"]) == [kernel_build.ZIG]
    assert f'cross = ["{kernel_build.ZIG}"]' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_a_machine_that_zig_does_not_serve_is_not_sent_to_it(
    no_compiler: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel_build.importlib.util, "find_spec", lambda name: None)
    for machine, advised in (("x86_64", True), ("aarch64", False)):
        monkeypatch.setattr(kernel_build._platform, "machine", lambda machine=machine: machine)
        assert bool(kernel_build.build_requirements([])) is advised
        with pytest.raises(BuildError, match="no C compiler found: install gcc or clang") as refused:
            kernel_build._compilers(kernel_build.host_platform(), sanitize=False)
        assert ("pip install ziglang" in str(refused.value)) is advised
        assert "gearfmu[" not in str(refused.value), "installing this package is what failed"


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="Windows wheels are cross-compiled")
def test_pip_builds_a_wheel_without_a_compiler(no_compiler: Path, tmp_path: Path) -> None:
    """In pip's own environment for builds, which downloads the compiler."""
    tree = shutil.ignore_patterns("lib", "build", "*.egg-info", ".git", "__pycache__", ".venv", "docs", "tests")
    shutil.copytree(ROOT, tmp_path / "source", ignore=tree)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", str(tmp_path), str(tmp_path / "source")]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if "No matching distribution" in done.stderr or "Connection" in done.stderr:
        pytest.skip("the package index is out of reach")
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.glob("gearfmu-*.whl"))
