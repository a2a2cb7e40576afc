"""Compile gk_math.c, gk_blob.c and gk_sha256.c with the array functions of probe_*.c into a small library, and call it."""
from __future__ import annotations

import ctypes
import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gearfmu.kernel.build import FLAGS

HERE = Path(__file__).parent
SOURCES = ("gk_math.c", "gk_blob.c", "gk_sha256.c")
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


def compile_probes(out: Path, command: Sequence[str] = ("cc",), flags: Sequence[str] = ()) -> Path:
    """Compile the probe library with the project's flags, then `flags`; returns `out`, fails with the compiler's messages."""
    files = [str(source_folder() / name) for name in SOURCES] + [str(p) for p in sorted(HERE.glob("probe_*.c"))]
    line = [*command, *FLAGS, "-fvisibility=default", "-fPIC", "-shared", *flags, f"-I{source_folder()}", "-o", str(out), *files]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, " ".join(line) + "\n" + done.stderr
    return out


class Probes:
    """The compiled probe library: elementary functions over arrays and the blob's checks."""

    def __init__(self, path: Path) -> None:
        self._library = ctypes.CDLL(str(path))

    def one(self, name: str, x: np.ndarray) -> np.ndarray:
        """exp, log, sin, cos or acos of every x."""
        function = getattr(self._library, f"probe_{name}")
        function.argtypes, function.restype = [_vector, _vector, ctypes.c_size_t], None
        x = np.ascontiguousarray(x, dtype=np.float64)
        y = np.empty_like(x)
        function(x, y, x.size)
        return y

    def atan2(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Angle of every (x, y)."""
        function = self._library.probe_atan2
        function.argtypes, function.restype = [_vector, _vector, _vector, ctypes.c_size_t], None
        y, x = np.ascontiguousarray(y, dtype=np.float64), np.ascontiguousarray(x, dtype=np.float64)
        angle = np.empty_like(y)
        function(y, x, angle, y.size)
        return angle

    def blob_open(self, blob: bytes, shift: int = 0) -> tuple[int, str, str, int]:
        """Outcome, message, hash and number of sections of a blob that lies `shift` bytes behind an address divisible by 64."""
        memory, address = _placed(blob, shift)
        message, digest, sections = ctypes.create_string_buffer(MESSAGE), ctypes.create_string_buffer(65), ctypes.c_uint32()
        outcome = self._library.probe_blob_open(
            ctypes.c_void_p(address), ctypes.c_size_t(len(blob)), message, digest, ctypes.byref(sections))
        assert memory is not None
        return outcome, message.value.decode(), digest.value.decode(), sections.value

    def blob_sum(self, blob: bytes, name: str, kind: int) -> tuple[float, int] | None:
        """Sum and number of the elements of a section of type `kind`; None when the kernel does not find it."""
        memory, address = _placed(blob, 0)
        total, count = ctypes.c_double(), ctypes.c_uint64()
        outcome = self._library.probe_blob_sum(
            ctypes.c_void_p(address), ctypes.c_size_t(len(blob)), name.encode(), kind, ctypes.byref(total), ctypes.byref(count))
        assert memory is not None and outcome == 0
        return None if count.value == 2**64 - 1 else (total.value, count.value)


def _placed(blob: bytes, shift: int) -> tuple[ctypes.Array, int]:
    """A copy of the blob in memory, with the address of its first byte; the memory is kept alive by the first value."""
    memory = ctypes.create_string_buffer(len(blob) + 64 + shift)
    address = -(-ctypes.addressof(memory) // 64) * 64 + shift
    ctypes.memmove(address, blob, len(blob))
    return memory, address
