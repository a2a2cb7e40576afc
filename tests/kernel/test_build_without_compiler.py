"""A machine without C compiler: pip is asked for one, and no message sends the reader in a circle."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gearfmu.kernel import build
from gearfmu.kernel.build import BuildError

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

    assert build.ZIG in asked()
    compiler_in(no_compiler)
    assert "zig" not in asked()


def test_requirements_follow_the_platforms(no_compiler: Path) -> None:
    assert build.build_requirements([]) == [build.ZIG]
    assert build.build_requirements(["none"]) == []
    compiler_in(no_compiler)
    assert build.build_requirements([]) == []
    assert build.build_requirements(["linux64", "win64"]) == [build.ZIG]
    assert f'cross = ["{build.ZIG}"]' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_a_machine_that_zig_does_not_serve_is_not_sent_to_it(
    no_compiler: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda name: None)
    for machine, advised in (("x86_64", True), ("aarch64", False)):
        monkeypatch.setattr(build._platform, "machine", lambda machine=machine: machine)
        assert bool(build.build_requirements([])) is advised
        with pytest.raises(BuildError, match="no C compiler found: install gcc or clang") as refused:
            build._compilers(build.host_platform(), sanitize=False)
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
