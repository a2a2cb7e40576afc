"""Builds of the kernel for tests: its parts behind the array functions of probe_*.c,
and the whole with any compiler."""

from __future__ import annotations

import ctypes
import importlib.util
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gearfmu.kernel.build import FLAGS, build_library

HERE = Path(__file__).parent
SOURCES = ("base/gk_math.c", "base/gk_blob.c", "base/gk_sha256.c")
MESSAGE = 512
_vector = np.ctypeslib.ndpointer(np.float64, flags="C")


def source_folder() -> Path:
    """Folder of the kernel's C sources."""
    return Path(importlib.util.find_spec("gearfmu.kernel.build").origin).parent / "src"


def compilers() -> dict[str, tuple[str, ...]]:
    """Name → command of every C compiler found here: gcc, clang, zig."""
    found = {name: (name,) for name in ("gcc", "clang") if shutil.which(name)}
    if importlib.util.find_spec("ziglang"):
        found["zig"] = (sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=undefined")
    return found


def compile_probes(out: Path) -> Path:
    """Compile the probe library with the project's flags; returns `out`, fails with the compiler's messages."""
    files = [source_folder() / name for name in SOURCES] + sorted(HERE.glob("probe_*.c"))
    line = ["cc", *FLAGS, "-fvisibility=default", "-fPIC", "-shared", f"-I{source_folder()}", "-o", str(out)]
    line += [*map(str, files), "-lm"]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, " ".join(line) + "\n" + done.stderr
    return out


def build(folder: Path, command: Sequence[str] = ("cc",), flags: Sequence[str] = (), **variant: object) -> Path:
    """The whole kernel into `folder` with this compiler, the project's flags and then `flags`.

    libm is linked: without optimisation a compiler calls sqrt there, which is exact."""
    compiler = command[0] if len(command) == 1 else _one_word(folder / "cc", command)
    return build_library(out=folder / "kernel.so", compiler=(compiler, "-Wl,--no-as-needed", "-lm", *flags), **variant)


def _one_word(script: Path, command: Sequence[str]) -> str:
    """A shell script that runs a command of several words."""
    script.write_text(f'#!/bin/sh\nexec {shlex.join(command)} "$@"\n')
    script.chmod(0o755)
    return str(script)


class Probes:
    """The compiled probe library: elementary functions over arrays and the blob's checks."""

    def __init__(self, path: Path) -> None:
        self._library = ctypes.CDLL(str(path))

    def one(self, name: str, *arguments: np.ndarray) -> np.ndarray:
        """exp, log, sin, cos or acos of every x; atan2 of every y, x."""
        function = getattr(self._library, f"probe_{name}")
        function.argtypes, function.restype = [_vector] * (len(arguments) + 1) + [ctypes.c_size_t], None
        given = [np.ascontiguousarray(values, dtype=np.float64) for values in arguments]
        found = np.empty_like(given[0])
        function(*given, found, found.size)
        return found

    def blob_open(self, blob: bytes, shift: int = 0) -> tuple[int, str, str, int]:
        """Outcome, message, hash and number of sections of a blob that lies `shift` bytes behind an address divisible
        by 64."""
        memory, address = _placed(blob, shift)
        message, digest = ctypes.create_string_buffer(MESSAGE), ctypes.create_string_buffer(65)
        sections = ctypes.c_uint32()
        outcome = self._library.probe_blob_open(
            ctypes.c_void_p(address), ctypes.c_size_t(len(blob)), message, digest, ctypes.byref(sections)
        )
        assert memory is not None
        return outcome, message.value.decode(), digest.value.decode(), sections.value

    def blob_sum(self, blob: bytes, name: str, kind: int) -> tuple[float, int] | None:
        """Sum and number of the elements of a section of type `kind`; None when the kernel does not find it."""
        memory, address = _placed(blob, 0)
        total, count = ctypes.c_double(), ctypes.c_uint64()
        outcome = self._library.probe_blob_sum(
            ctypes.c_void_p(address),
            ctypes.c_size_t(len(blob)),
            name.encode(),
            kind,
            ctypes.byref(total),
            ctypes.byref(count),
        )
        assert memory is not None and outcome == 0
        return None if count.value == 2**64 - 1 else (total.value, count.value)


def _placed(blob: bytes, shift: int) -> tuple[ctypes.Array, int]:
    """A copy of the blob in memory, with the address of its first byte; the memory is kept alive by the first value."""
    memory = ctypes.create_string_buffer(len(blob) + 64 + shift)
    address = -(-ctypes.addressof(memory) // 64) * 64 + shift
    ctypes.memmove(address, blob, len(blob))
    return memory, address
