"""Arrays in a page: one block of bytes, compressed, that its script unpacks (`web/report.js`, function `unpack`).

Numbers of even steps are stored as the first and the step; up to EXACT of them are stored as doubles; longer curves
in LEVELS steps of their range, as differences, high bytes and low bytes apart, which deflate packs three times closer
than floats. Curves of more than MOST points are stored by the lowest and the highest of COLUMNS parts. The CSV files
beside the page have every digit.
"""

from __future__ import annotations

import base64
import gzip
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

EXACT, LEVELS, MISSING = 256, 65534, 65535
MOST, COLUMNS = 40_000, 8_000
BYTE_LEVELS, BYTE_MISSING = 254, 255
EVEN = 1e-9  # of the whole range


class Pack:
    """Arrays and the plain structure that names them by number. The page carries `text()`."""

    def __init__(self) -> None:
        self._known: dict[bytes, int] = {}
        self._heads: list[dict[str, Any]] = []
        self._bytes = bytearray()

    def add(self, values: np.ndarray) -> int:
        """Number of the array (n,) of numbers, NaN where there is none."""
        values = np.ascontiguousarray(values, dtype=float)
        return self._once(values.tobytes(), lambda: self._curve(values))

    def add_map(self, values: np.ndarray, low: float, high: float) -> int:
        """Number of the map (Y, X), stored as bytes between low and high."""
        share = np.clip((values - low) / max(high - low, 1e-300), 0, 1)
        steps = np.where(np.isfinite(values), np.rint(share * BYTE_LEVELS), BYTE_MISSING).astype(np.uint8)
        head = {"kind": "u1", "n": steps.size, "low": low, "high": high, "columns": steps.shape[1]}
        return self._once(steps.tobytes() + repr(head).encode(), lambda: self._store(head, steps.tobytes()))

    def add_raw(self, values: np.ndarray) -> int:
        """Number of an array that is stored as it is: int8, uint16, int32, float32 or float64."""
        kind = {"int8": "i1", "uint16": "u2", "int32": "i4", "float32": "f4", "float64": "f8"}[values.dtype.name]
        head = {"kind": kind, "n": values.size}
        data = values.astype(values.dtype.newbyteorder("<")).tobytes()
        return self._once(kind.encode() + data, lambda: self._store(head, data))

    def text(self, content: dict[str, Any]) -> str:
        """Base64 of the compressed block: length of the JSON, the JSON, the arrays from an offset of 8 bytes on."""
        head = json.dumps({**content, "arrays": self._heads}, separators=(",", ":"), allow_nan=False).encode()
        head += b" " * (-(4 + len(head)) % 8)
        return squeezed(struct.pack("<I", len(head)) + head + bytes(self._bytes))

    def _once(self, key: bytes, make: Callable[[], dict[str, Any]]) -> int:
        if key not in self._known:
            head = make()
            self._known[key] = len(self._heads)
            self._heads.append(head)
        return self._known[key]

    def _store(self, head: dict[str, Any], data: bytes) -> dict[str, Any]:
        self._bytes += b"\0" * (-len(self._bytes) % 8)
        head = {**head, "at": len(self._bytes)}
        self._bytes += data
        return head

    def _curve(self, values: np.ndarray) -> dict[str, Any]:
        n = values.size
        if n > 2 and np.isfinite(values).all():
            step = (values[-1] - values[0]) / (n - 1)
            if np.abs(values - (values[0] + step * np.arange(n))).max() <= EVEN * abs(values[-1] - values[0]):
                return {"kind": "even", "n": n, "start": float(values[0]), "step": float(step)}
        if n <= EXACT:
            return self._store({"kind": "f8", "n": n}, values.tobytes())
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        steps = np.full(n, MISSING, dtype=np.uint16)
        steps[np.isfinite(values)] = np.rint((finite - low) / ((high - low) or 1.0) * LEVELS)
        change = np.diff(steps, prepend=np.uint16(0)).astype("<u2")
        planes = np.stack([change & 255, change >> 8]).astype(np.uint8)
        return self._store({"kind": "steps", "n": n, "low": low, "high": high}, planes.tobytes())


def squeezed(data: bytes) -> str:
    """Base64 of gzip, the same bytes every time."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def reduced(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A curve over ascending x (n,) with more than MOST points: the lowest and the highest of every one of COLUMNS
    parts; others as they are."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if x.size <= MOST:
        return x, y
    starts = np.linspace(0, x.size, COLUMNS, endpoint=False).astype(int)
    ends = np.stack([np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)], axis=1)
    return np.repeat(x[starts], 2), ends.ravel()
