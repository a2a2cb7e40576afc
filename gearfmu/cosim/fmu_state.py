"""Serialised states of our FMUs and of the kernel: the same bytes of gk_data, behind a head and the settings in an FMU
(src/fmi2/fmi2_state.c)."""

from __future__ import annotations

import struct

HEAD = struct.Struct("<8sQQ64s3d4IQ")  # face_head of fmi2_face.h
SIZE, CHECK, LAST_GOOD, MODE, BYTES = 1, 2, 6, 8, 11  # places in it
CHECKED_FROM = struct.calcsize("<8sQQ")
STEP_MODE = 4  # MODE_STEP


def kernel_bytes(state: bytes) -> bytes:
    """The kernel's part of an FMU's serialised state, as `Kernel.save` gives it."""
    head = HEAD.unpack_from(state)
    return state[len(state) - head[BYTES] :]


def with_kernel_bytes(fresh: bytes, kernel: bytes, time: float) -> bytes:
    """The serialised state of an FMU in step mode at `time` (s): settings of `fresh`, the state of an instance that is
    not initialised, and a state of the kernel with the same parameters."""
    head = list(HEAD.unpack_from(fresh))
    settings = fresh[HEAD.size : len(fresh) - head[BYTES]]
    head[SIZE], head[BYTES] = HEAD.size + len(settings) + len(kernel), len(kernel)
    head[CHECK], head[LAST_GOOD], head[MODE] = 0, time, STEP_MODE
    body = HEAD.pack(*head) + settings + kernel
    head[CHECK] = fnv(body[CHECKED_FROM:])
    return HEAD.pack(*head) + settings + kernel


def fnv(data: bytes) -> int:
    """FNV-1a, 64 bit."""
    check = 14695981039346656037
    for byte in data:
        check = ((check ^ byte) * 1099511628211) & 0xFFFFFFFFFFFFFFFF
    return check
