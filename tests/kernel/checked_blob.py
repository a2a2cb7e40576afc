"""The rules of the bytes of a model blob in Python, beside those of the kernel (base/gk_blob.c)."""

from __future__ import annotations

import hashlib

import numpy as np

from gearfmu.errors import ModelError
from gearfmu.stage.assembly.blob import (
    ALIGNMENT,
    DTYPE,
    ENTRY,
    F32,
    F64,
    FORMAT,
    HASHED_FROM,
    HEADER,
    LONGEST_NAME,
    MAGIC,
    MOST_SECTIONS,
    TEXT,
)


def checked_blob(blob: bytes) -> dict[str, np.ndarray | str]:
    """Sections of a blob: one-dimensional read-only arrays (float64, float32, int32) and text, in stored order.

    Raises ModelError at the first rule that is broken: nothing after it can be trusted.
    """
    count = _check_header(blob)
    sections: dict[str, np.ndarray | str] = {}
    end = HEADER.size + count * ENTRY.size
    entries = [_entry(blob, i) for i in range(count)]
    for i, (name, kind, repeated, size, offset) in enumerate(entries):
        if name in sections:
            raise ModelError(f"model blob: section '{name}' is there twice")
        if repeated:
            first = entries[repeated - 1] if repeated <= i else None
            if first is None or first[1:] != (kind, 0, size, offset):
                raise ModelError(f"model blob: section '{name}' does not repeat an earlier one")
        else:
            if offset != aligned(end):
                raise ModelError(f"model blob: section '{name}' does not begin where the one before it ends")
            end = offset + size * DTYPE[kind].itemsize
            if end > len(blob):
                raise ModelError(f"model blob: section '{name}' reaches beyond the end")
        sections[name] = _decode(name, kind, np.frombuffer(blob, DTYPE[kind], size, offset))
    if aligned(end) != len(blob):
        raise ModelError(f"model blob: sections end at {end}, the blob at {len(blob)}")
    return sections


def _decode(name: str, kind: int, values: np.ndarray) -> np.ndarray | str:
    if kind in (F64, F32) and not np.all(np.isfinite(values)):
        raise ModelError(f"model blob: section '{name}' holds a value that is not finite")
    if kind != TEXT:
        return values
    data = values.tobytes()
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = ""
    if text.find("\0") != len(text) - 1 or not text:
        raise ModelError(f"model blob: section '{name}' is not UTF-8 text that ends with NUL")
    return text[:-1]


def _check_header(blob: bytes) -> int:
    """Number of sections of a blob whose header and hash are right."""
    if len(blob) < HEADER.size:
        raise ModelError(f"model blob: {len(blob)} bytes are too few for a header of {HEADER.size}")
    magic, version, digest, size, count = HEADER.unpack_from(blob)
    if magic != MAGIC:
        raise ModelError("model blob: does not begin with GFMB, this is not a gearfmu model")
    if version != FORMAT:
        raise ModelError(
            f"model blob: format version {version}, this package reads version {FORMAT}: assemble the stage again"
        )
    if size != len(blob):
        raise ModelError(
            f"model blob: header says {size} bytes, there are {len(blob)}: the blob is cut short or padded"
        )
    if count > MOST_SECTIONS or HEADER.size + count * ENTRY.size > size:
        raise ModelError(f"model blob: {count} sections do not fit")
    if any(blob[52 : HEADER.size]):
        raise ModelError("model blob: reserved bytes of the header are not zero")
    if digest != hashlib.sha256(blob[HASHED_FROM:]).digest():
        raise ModelError("model blob: contents do not match their SHA-256, the blob is damaged")
    return count


def _entry(blob: bytes, i: int) -> tuple[str, int, int, int, int]:
    """Name, type, 1 + number of the section it repeats or 0, number of elements and offset of section i."""
    raw, kind, repeated, size, offset = ENTRY.unpack_from(blob, HEADER.size + i * ENTRY.size)
    name = raw.rstrip(b"\0").decode("latin-1")
    if not name_is_good(name):
        raise ModelError(f"model blob: the name of section {i} is not 1 to {LONGEST_NAME} printable characters")
    if kind not in DTYPE:
        raise ModelError(f"model blob: section '{name}' is of unknown type {kind}")
    return name, kind, repeated, size, offset


def name_is_good(name: str) -> bool:
    return 0 < len(name) <= LONGEST_NAME and all(" " < c <= "~" for c in name)


def aligned(n: int) -> int:
    return -(-n // ALIGNMENT) * ALIGNMENT
