"""Builds of the kernel that several tests use. Each is compiled once, whatever the number of pytest's workers, and kept
in build/tests until sources, flags or compiler change."""

from __future__ import annotations

import fcntl
import hashlib
import re
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

from gearfmu.files import written_whole
from gearfmu.kernel.build import FLAGS, PORTABLE, compile_program, fmi_headers, source_hash, sources

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "tests"
SANITIZE = ("-O0", "-g1", "-fno-omit-frame-pointer", "-fno-sanitize-recover=all", "-fsanitize=address")
# in half the time of the compiler; AddressSanitizer sees what the rest of them look for: pointers that are null or past
QUICKLY = ("-fsanitize=bounds,shift,signed-integer-overflow,integer-divide-by-zero,float-cast-overflow,vla-bound,bool",)
WHOLLY = ("-fsanitize=undefined",)
FLAVOURS = {
    "checked float": ("-DGK_CHECK",),
    "double": ("-DGK_DOUBLE_MODES",),
    "checked double": ("-DGK_CHECK", "-DGK_DOUBLE_MODES"),
}


def once(name: str, make: Callable[[Path], object], *own: Path) -> Path:
    """Folder in which `make` has built `name` from the kernel's sources, this file and the files `own`."""
    compiler = subprocess.run(["cc", "--version"], capture_output=True, text=True, check=True).stdout
    key = hashlib.sha256((compiler + source_hash([*sources(), Path(__file__), *own])).encode()).hexdigest()[:16]
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


def objects(kind: str) -> Path:
    """Folder of the kernel's objects, one of FLAVOURS, at -O1 and with a pattern in automatic variables that nobody
    sets (gcc 12 and later, clang)."""
    name = f"objects-{kind.replace(' ', '-')}"
    return once(name, lambda folder: _compile([*_flags(kind), "-c", *_c_files()], folder))


def checked_library(real: str = "float") -> Path:
    """The kernel with GK_ASSERT, where a check that fails ends the process. Not for damaged blobs and states, whose
    numbers the kernel does not vouch for."""
    return _linked(f"checked-{real}", f"checked {real}", []) / "kernel.so"


def double_library() -> Path:
    """The kernel with modal states and rows in double, for comparison to the last digits; without GK_ASSERT, as some of
    its models have no supports."""
    return _linked("double", "double", []) / "kernel.so"


def inner_library() -> Path:
    """Kernel and inner_probe.c in one library: its inner functions can be called (tests/kernel/inner.py)."""
    return _linked("inner", "checked float", [ROOT / "tests" / "kernel" / "inner_probe.c"]) / "kernel.so"


def leaky_library() -> Path:
    """The kernel with a symbol more than an FMU may export."""
    return _linked("leaky", "checked float", [], "-Wl,--defsym=leaked=fmi2GetVersion") / "kernel.so"


def edited_library(name: str, edits: Mapping[str, str], kind: str) -> Path:
    """The kernel with every match of the regular expressions in `edits` replaced; each must change something."""
    changed, idle = {}, set(edits)
    for path in _c_files():
        text = before = path.read_text(encoding="utf-8")
        for pattern, replacement in edits.items():
            text, old = re.sub(pattern, replacement, text), text
            idle -= {pattern} if text != old else set()
        if text != before:
            changed[path.name] = text
    assert not idle, f"{idle} change nothing: adapt them"
    key = hashlib.sha256(repr(sorted(edits.items())).encode()).hexdigest()[:8]
    folder = KEPT / f"edited-{name}-{key}"
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in changed.items():
        with written_whole(folder / file) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return _linked(name, kind, [folder / file for file in changed], "-Wno-unused-function") / "kernel.so"


def sanitized_library(checks: tuple[str, ...] = WHOLLY) -> Path:
    """The kernel with AddressSanitizer and UBSan, not optimised: the compiler takes longer than the tests."""

    def make(folder: Path) -> None:
        own = [*SANITIZE, *checks, PORTABLE, "-fPIC", f"-I{fmi_headers()}", "-shared", "-Wl,-Bsymbolic"]
        _compile([*own, *_c_files(), "-o", "kernel.so"], folder)

    return once("sanitized" if checks == WHOLLY else "sanitized-quickly", make) / "kernel.so"


def sanitized_host(source: Path) -> Path:
    """A program that loads FMUs, with AddressSanitizer and UBSan; leaks are findings too."""
    return once("host", lambda folder: compile_program(source, folder / "host", sanitize=True), source) / "host"


def plain_host(source: Path) -> Path:
    """The same program as the product is compiled."""
    return once("plain-host", lambda folder: compile_program(source, folder / "host"), source) / "host"


def fuzzer(checks: tuple[str, ...] = WHOLLY) -> Path:
    """tests/kernel/fuzz_kernel.c on the sanitized kernel."""
    library, program = sanitized_library(checks), ROOT / "tests" / "kernel" / "fuzz_kernel.c"
    elementary = next(p for p in sources() if p.name == "gk_math.c")  # the fuzzer's own random numbers
    run_path = f"-Wl,-rpath,{library.parent}"

    def make(folder: Path) -> None:
        _compile([*SANITIZE, *checks, program, elementary, library, run_path, "-o", folder / "fuzz"])

    return once("fuzz" if checks == WHOLLY else "fuzz-quickly", make, program) / "fuzz"


def _linked(name: str, kind: str, own: list[Path], *flags: str) -> Path:
    """Folder of kernel.so: `own` sources, and the objects of all others."""

    def make(folder: Path) -> None:
        kept = objects(kind)
        others = [kept / f"{path.stem}.o" for path in _c_files() if path.name not in {one.name for one in own}]
        _compile([*_flags(kind), "-shared", "-Wl,-Bsymbolic", *flags, *own, *others, "-o", "kernel.so"], folder)

    return once(name, make, *own)


def _c_files() -> list[Path]:
    return [path for path in sources() if path.suffix == ".c"]


def _flags(kind: str) -> list[str]:
    """At -O1 sqrt is libm's, which is exact."""
    common = ["-O1", PORTABLE, "-ftrivial-auto-var-init=pattern", "-fPIC", f"-I{fmi_headers()}"]
    return [*common, *FLAVOURS[kind], "-Wl,--no-as-needed"]


def _compile(arguments: list[str | Path], folder: Path | None = None) -> None:
    """Run the compiler in `folder` with the project's flags; fails with its messages."""
    line = ["cc", *FLAGS, f"-I{ROOT / 'gearfmu' / 'kernel' / 'src'}", *map(str, arguments), "-lm"]
    done = subprocess.run(line, capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, " ".join(line) + "\n" + done.stderr
