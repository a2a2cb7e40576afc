"""Builds of the kernel that several tests use. Each is compiled once, whatever the number of pytest's workers, and kept
in build/tests until sources, flags or compiler change."""

from __future__ import annotations

import fcntl
import hashlib
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from gearfmu.kernel.build import FLAGS, PORTABLE, build_library, compile_program, fmi_headers, source_hash, sources

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "tests"
O1 = ("cc", "-O1", PORTABLE, "-Wl,--no-as-needed", "-lm")  # at -O1 sqrt is libm's, which is exact
SANITIZE = ("-O1", "-g1", "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def once(name: str, make: Callable[[Path], object], *own: Path) -> Path:
    """Folder in which `make` has built `name` from the kernel's sources and the files `own`."""
    compiler = subprocess.run(["cc", "--version"], capture_output=True, text=True, check=True).stdout
    key = hashlib.sha256((compiler + source_hash([*sources(), *own])).encode()).hexdigest()[:16]
    folder = KEPT / f"{name}-{key}"
    KEPT.mkdir(parents=True, exist_ok=True)
    with open(KEPT / f"{name}.lock", "w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "whole").exists():
            for old in KEPT.glob(f"{name}-*"):
                shutil.rmtree(old)
            folder.mkdir()
            make(folder)
            (folder / "whole").touch()
    return folder


def double_library() -> Path:
    """The kernel with modal states and rows in double, for comparison to the last digits; at -O1, the same bits in half
    the time of the compiler."""

    def make(folder: Path) -> None:
        build_library(real="double", out=folder / "double.so", compiler=O1)

    return once("double", make) / "double.so"


def inner_library() -> Path:
    """Kernel and inner_probe.c in one library: its inner functions can be called (tests/kernel/inner.py)."""
    probe = ROOT / "tests" / "kernel" / "inner_probe.c"

    def make(folder: Path) -> None:
        files = [p for p in [*sources(), probe] if p.suffix == ".c"]
        _compile(["-O1", "-fPIC", "-shared", f"-I{fmi_headers()}", *files, "-o", folder / "inner.so"])

    return once("inner", make, probe) / "inner.so"


def checked_library(real: str = "float") -> Path:
    """The kernel with GK_ASSERT, where a check that fails ends the process, at -O1 and with a pattern in automatic
    variables that nobody sets (gcc 12 and later, clang). Not for damaged blobs and states, whose numbers the kernel
    does not vouch for."""

    def make(folder: Path) -> None:
        build_library(real=real, pattern=True, out=folder / "kernel.so", compiler=(*O1, "-DGK_CHECK"))

    return once(f"checked-{real}", make) / "kernel.so"


def sanitized_library() -> Path:
    """The kernel with AddressSanitizer and UBSan."""
    return once("sanitized", lambda folder: build_library(sanitize=True, out=folder / "kernel.so")) / "kernel.so"


def sanitized_host(source: Path) -> Path:
    """A program that loads FMUs, with AddressSanitizer and UBSan; leaks are findings too."""
    return once("host", lambda folder: compile_program(source, folder / "host", sanitize=True), source) / "host"


def fuzzer() -> Path:
    """tests/kernel/fuzz_kernel.c on the sanitized kernel."""
    library, program = sanitized_library(), ROOT / "tests" / "kernel" / "fuzz_kernel.c"
    elementary = next(p for p in sources() if p.name == "gk_math.c")  # the fuzzer's own random numbers
    run_path = f"-Wl,-rpath,{library.parent}"

    def make(folder: Path) -> None:
        _compile([*SANITIZE, program, elementary, library, run_path, "-o", folder / "fuzz"])

    return once("fuzz", make, program) / "fuzz"


def _compile(arguments: list[str | Path]) -> None:
    """Run the compiler with the project's flags; fails with its messages."""
    line = ["cc", *FLAGS, f"-I{ROOT / 'gearfmu' / 'kernel' / 'src'}", *map(str, arguments), "-lm"]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, " ".join(line) + "\n" + done.stderr
