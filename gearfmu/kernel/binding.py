"""ctypes declarations of gk.h and the one loaded library."""

from __future__ import annotations

import ctypes
import mmap
import sys
from ctypes import POINTER, c_char, c_char_p, c_double, c_int, c_size_t, c_uint32, c_uint64, c_void_p
from functools import lru_cache
from pathlib import Path

from gearfmu.errors import ModelError
from gearfmu.kernel.build import library_path

ABI = 7
MESSAGE = 512
OUTCOMES = (
    "ok",
    "bad_blob",
    "bad_variable",
    "bad_value",
    "bad_call",
    "bad_step",
    "step_too_large",
    "no_equilibrium",
    "diverged",
    "penetration",
    "energy",
)
TYPES = ("Real", "Integer", "Boolean", "Enumeration")
CAUSALITIES = ("input", "output", "parameter")


class VariableInfo(ctypes.Structure):
    """gk_variable_info."""

    _fields_ = [
        ("reference", c_uint32),
        ("type", c_int),
        ("causality", c_int),
        ("name", c_char * 64),
        ("unit", c_char * 24),
        ("items", c_char * 64),
        ("description", c_char * 160),
        ("start", c_double),
        ("minimum", c_double),
        ("maximum", c_double),
    ]


class RecordingInfo(ctypes.Structure):
    """gk_recording."""

    _fields_ = [
        ("H", c_double),
        ("first", c_uint64),
        ("steps", c_uint64),
        ("given", c_uint64),
        ("kept", c_uint64),
        ("inputs", c_void_p),
        ("outputs", c_void_p),
        ("input", c_void_p),
        ("output", c_void_p),
        ("done", c_uint64),
    ]


_SIGNATURES = {
    "gk_abi": (c_int, []),
    "gk_outcome_text": (c_char_p, [c_int]),
    "gk_status_text": (c_char_p, [c_int]),
    "gk_model_size": (c_size_t, []),
    "gk_model_open": (c_int, [c_void_p, c_void_p, c_size_t, c_char_p]),
    "gk_model_name": (c_char_p, [c_void_p]),
    "gk_model_hash": (c_char_p, [c_void_p]),
    "gk_model_guid": (c_char_p, [c_void_p]),
    "gk_variable_count": (c_int, [c_void_p]),
    "gk_variable": (c_int, [c_void_p, c_int, POINTER(VariableInfo)]),
    "gk_setup_size": (c_size_t, [c_void_p]),
    "gk_data_size": (c_size_t, [c_void_p]),
    "gk_work_size": (c_size_t, [c_void_p]),
    "gk_defaults": (c_int, [c_void_p, c_void_p]),
    "gk_set": (c_int, [c_void_p, c_void_p, c_uint32, c_double]),
    "gk_get": (c_int, [c_void_p, c_void_p, c_uint32, POINTER(c_double)]),
    "gk_set_many": (c_int, [c_void_p, c_void_p, c_void_p, c_size_t, c_void_p]),
    "gk_get_many": (c_int, [c_void_p, c_void_p, c_void_p, c_size_t, c_void_p]),
    "gk_prepare": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, c_char_p]),
    "gk_initialize": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, c_double]),
    "gk_step": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_double]),
    "gk_time": (c_double, [c_void_p]),
    "gk_record": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, POINTER(RecordingInfo)]),
    "gk_te": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_double, c_int]),
    "gk_te_at": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, c_int, POINTER(c_double), POINTER(c_int)]),
    "gk_rest": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, POINTER(c_double), POINTER(c_double)]),
    "gk_linearise_room": (c_int, [c_void_p, c_void_p, c_void_p]),
    "gk_linearise": (c_int, [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p]),
    "gk_adopt": (c_int, [c_void_p] * 6),
    "gk_profile": (c_int, [c_void_p, c_int, POINTER(c_char_p), POINTER(c_uint64)]),
    "gk_state_size": (c_size_t, [c_void_p]),
    "gk_state_check": (c_int, [c_void_p, c_void_p, c_void_p, c_size_t]),
}


@lru_cache(maxsize=8)
def load(path: Path | None = None) -> ctypes.CDLL:
    """The library at `path` (default: the built one), symbols kept to itself; ModelError when it speaks another
    gk.h."""
    library = ctypes.CDLL(str(path or library_path()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    if library.gk_abi() != ABI:
        raise ModelError(
            f"{path or library_path()} has version {library.gk_abi()} of the kernel interface, this Python {ABI}: "
            "reinstall gearfmu"
        )
    return library


def status_words(status: int) -> list[str]:
    """What the bits of solver.status say, in words."""
    words, bit = [], 0
    while (text := load().gk_status_text(bit)) is not None:
        words += [text.decode()] if status >> bit & 1 else []
        bit += 1
    return words


def aligned(size: int) -> tuple[ctypes.Array, int]:
    """Zeroed memory of `size` bytes whose returned address is a multiple of 64; keep the array as long as the address.

    Pages that nothing touches cost nothing: the kernel's sizes are those of the largest setup.
    """
    own = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if sys.platform != "win32" else {}
    memory = (ctypes.c_char * max(size, 1)).from_buffer(mmap.mmap(-1, max(size, 1), **own))
    return memory, ctypes.addressof(memory)
