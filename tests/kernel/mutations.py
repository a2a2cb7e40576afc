"""Random damage to a blob that reaches the checks behind the hash:
the SHA-256 is computed anew after nearly every change."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np

from gearfmu.stage.assembly.blob import ENTRY, HEADER, seal

EDGES = [0, 1, 2, 3, 7, 63, 64, 65, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**53, 2**61, 2**63 - 1, 2**63]
EDGES += [2**64 - 64, 2**64 - 1]
REALS = [0.0, -0.0, 1.0, -1.0, 5e-324, -1e-300, 1e-12, 1e12, 1e300, -1e300, np.inf, -np.inf, np.nan]


def mutated(blob: bytes, rng: np.random.Generator) -> bytes:
    """A copy with one to three changes: bits, bytes, header and table fields, elements of sections, cuts,
    doubled or zeroed stretches."""
    data = bytearray(blob)
    for _ in range(rng.integers(1, 4)):
        MUTATIONS[rng.integers(len(MUTATIONS))](data, rng)
    if len(data) < HEADER.size or rng.random() < 0.02:
        return bytes(data)
    if rng.random() < 0.9:
        data[40:48] = struct.pack("<Q", len(data))
    return seal(bytes(data))


def _flip_bit(data: bytearray, rng: np.random.Generator) -> None:
    if data:
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))


def _set_byte(data: bytearray, rng: np.random.Generator) -> None:
    if data:
        data[rng.integers(len(data))] = int(rng.integers(256))


def _table_field(data: bytearray, rng: np.random.Generator) -> None:
    """An edge value, or one nearby, in a number of the table of sections (or of the header)."""
    sections = struct.unpack_from("<I", data, 48)[0] if len(data) >= HEADER.size else 0
    places = [48] + [HEADER.size + i * ENTRY.size + at for i in range(min(sections, 64)) for at in (24, 32, 32, 40)]
    place = int(rng.choice(places))
    if place + 8 > len(data):
        return
    old = struct.unpack_from("<Q", data, place)[0]
    new = EDGES[rng.integers(len(EDGES))] if rng.random() < 0.5 else old + int(rng.integers(-9, 10))
    if place == 48 or (place - HEADER.size) % ENTRY.size == 24:
        data[place : place + 4] = struct.pack("<I", new % 2**32)
    else:
        data[place : place + 8] = struct.pack("<Q", new % 2**64)


def _element(data: bytearray, rng: np.random.Generator) -> None:
    """A wrong but well-formed value inside a section: what only the model's own checks can find."""
    sections = struct.unpack_from("<I", data, 48)[0] if len(data) >= HEADER.size else 0
    if not 0 < sections <= 1024 or HEADER.size + sections * ENTRY.size > len(data):
        return
    _, kind, _, count, offset = ENTRY.unpack_from(data, HEADER.size + int(rng.integers(sections)) * ENTRY.size)
    size = {1: 8, 2: 4, 3: 1}.get(kind, 0)
    if not size or not count or offset + count * size > len(data):
        return
    place = offset + size * int(rng.integers(count))
    data[place : place + size] = _another_value(kind, bytes(data[place : place + size]), rng)


def _another_value(kind: int, old: bytes, rng: np.random.Generator) -> bytes:
    if kind == 1:
        value = struct.unpack("<d", old)[0]
        scaled = [-value, value * 2, value * 1e-3, value * 1e6, value * (1 + 1e-9)]
        return struct.pack("<d", REALS[rng.integers(len(REALS))] if rng.random() < 0.5 else scaled[rng.integers(5)])
    if kind == 2:
        value = struct.unpack("<i", old)[0]
        near = value + int(rng.integers(-3, 4)) if rng.random() < 0.5 else EDGES[rng.integers(len(EDGES))]
        return struct.pack("<I", near % 2**32)
    return bytes([int(rng.integers(1, 128))])


def _cut(data: bytearray, rng: np.random.Generator) -> None:
    start = int(rng.integers(len(data) + 1)) if rng.random() < 0.3 else max(0, len(data) - 64)
    del data[start:]


def _extend(data: bytearray, rng: np.random.Generator) -> None:
    data += bytes(int(rng.choice([1, 8, 64, 4096])))


def _stretch(data: bytearray, rng: np.random.Generator) -> None:
    """A stretch of bytes copied from elsewhere, or zeroed."""
    n = int(rng.integers(1, 65))
    if len(data) > 2 * n:
        source, target = (int(v) for v in rng.integers(0, len(data) - n, 2))
        data[target : target + n] = data[source : source + n] if rng.random() < 0.5 else bytes(n)


MUTATIONS: list[Callable[[bytearray, np.random.Generator], None]] = [
    _flip_bit,
    _set_byte,
    _table_field,
    _table_field,
    _element,
    _element,
    _element,
    _element,
    _cut,
    _extend,
    _stretch,
]
