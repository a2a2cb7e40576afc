"""The FMU in a host written in C: random calls under ASan and UBSan, and the Windows FMU under wine."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from builds import plain_host, sanitized_host, sanitized_library
from fmpy import read_model_description
from small_stage import unpack

from gearfmu.fmu import export
from gearfmu.kernel import library_path
from gearfmu.kernel.build import build_library, compile_program

SOURCE = Path(__file__).with_name("host.c")
STEPS, H = 300, "1e-4"


@dataclass(frozen=True)
class Host:
    """A compiled host and the library it loads."""

    program: Path
    library: Path

    def run(
        self, folder: str, *arguments: str, before: tuple[str, ...] = (), uri: str | None = None, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run with resources and GUID of the FMU in `folder`; returns the finished process."""
        resources, guid = uri or (Path(folder) / "resources").as_uri(), read_model_description(folder).guid
        command = [*before, str(self.program), str(self.library), resources, guid, *arguments]
        return subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, timeout=900)


@pytest.fixture(scope="module")
def sanitized() -> Host:
    """Host and library with AddressSanitizer and UBSan; leaks are findings too."""
    return Host(sanitized_host(SOURCE), sanitized_library())


@pytest.fixture(scope="module")
def plain() -> Host:
    return Host(plain_host(SOURCE), library_path())


def references(folder: str, causality: str) -> list[int]:
    variables = read_model_description(folder).modelVariables
    return [v.valueReference for v in variables if v.causality == causality and v.type == "Real"]


def loaded_run(folder: str) -> list[str]:
    """Arguments of a run in which both shafts are loaded and turn."""
    by_name = {v.name: v.valueReference for v in read_model_description(folder).modelVariables}
    outputs = ",".join(map(str, references(folder, "output")))
    motion = {"pinion.phi": "1e-3+0.03125", "pinion.w": "312.5+0", "wheel.phi": "0+-0.0208333", "wheel.w": "-208.333+0"}
    return ["run", str(STEPS), H, outputs, *(f"{by_name[name]}={value}" for name, value in motion.items())]


def fuzz(host: Host, folder: str, seed: int, calls: int) -> dict[str, int]:
    highest = max(v.valueReference for v in read_model_description(folder).modelVariables)
    done = host.run(folder, "fuzz", str(seed), str(calls), str(highest))
    assert done.returncode == 0, f"seed {seed}: {done.stderr[-3000:]}"
    words = done.stdout.split()
    return dict(zip(words[::2], map(int, words[1::2]), strict=True))


@pytest.mark.full
@pytest.mark.needs("gcc")
@pytest.mark.parametrize("seed", range(1, 22))
def test_random_calls_under_sanitizers(sanitized, unpacked, unpacked_other, seed):
    answers = fuzz(sanitized, (unpacked, unpacked_other)[seed % 2], seed, calls=5000)
    assert min(answers["ok"], answers["error"]) > 500, "the sequence reached both good and bad calls"


@pytest.mark.full
@pytest.mark.needs("wine", "ziglang")
def test_windows_fmu_gives_the_bits_of_linux(model, plain, tmp_path, monkeypatch):
    """Cross-compiled DLL and host under wine, from a folder with a space and letters beyond ASCII."""
    windows = build_library("win64", out=tmp_path / "kernel.dll")
    monkeypatch.setattr("gearfmu.fmu.package.library_path", lambda name: windows if name == "win64" else library_path())
    folder = unpack(export(model, tmp_path / "both.fmu", platforms=("host", "win64")), tmp_path / "bäth tub")
    dll = next((Path(folder) / "binaries" / "win64").glob("*.dll"))
    assert dll.read_bytes() == windows.read_bytes()
    program = compile_program(SOURCE, tmp_path / "host.exe", "win64")
    uri = "file:///Z:" + (Path(folder) / "resources").as_uri().removeprefix("file://")
    under_wine = Host(program, Path(shutil.copy(dll, tmp_path / "stage.dll"))).run(
        folder, *loaded_run(folder), before=("wine",), uri=uri, WINEPREFIX=str(tmp_path / "wine"), WINEDEBUG="-all"
    )
    assert under_wine.returncode == 0, under_wine.stderr[-3000:]
    here = plain.run(folder, *loaded_run(folder))
    assert under_wine.stdout.split() == here.stdout.split()
    assert len(here.stdout.split()) == STEPS * len(references(folder, "output"))
