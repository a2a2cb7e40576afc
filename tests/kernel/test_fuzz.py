"""Damaged model blobs and states under AddressSanitizer and UBSan: refused with a message or run with a named outcome,
never a crash or garbage. Random damage reaches the checks behind the hash: the SHA-256 is computed anew after nearly
every change."""

from __future__ import annotations

import functools
import struct
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import builds
import numpy as np
import pytest
from exact_bars import Bar
from small_model import bars_blob, pair_blob, with_nodes

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

SEED = 20150712
REFUSED = ("open", "1")


@functools.lru_cache
def originals() -> tuple[bytes, ...]:
    return (
        pair_blob(("chain", "spring")),
        pair_blob(("torque", "fixed")),
        pair_blob(("spring", "torque")),
        bars_blob((Bar(0.1), Bar(0.2)), (5, 10), 1e-6),
        with_nodes(pair_blob(("torque", "spring")), penalty=1e14),
    )


def sound(number: int) -> bytes:
    return originals()[number % len(originals())]


def damaged(number: int) -> bytes:
    """Case `number`; the same on every machine."""
    return mutated(sound(number), np.random.default_rng([SEED, number]))


@pytest.fixture(scope="module")
def fuzzer() -> Path:
    """fuzz_kernel.c on the sanitized kernel, with the checks that a compiler makes quickly."""
    return builds.fuzzer(builds.QUICKLY)


@pytest.fixture(scope="module")
def whole_fuzzer() -> Path:
    """The same with all checks of UBSan."""
    return builds.fuzzer()


@dataclass(frozen=True)
class Findings:
    """lines: case, call, outcome, complaint (may be missing) of every case finished; end:
    exit code and what the sanitizer wrote."""

    lines: list[list[str]]
    end: tuple[int, str]

    @property
    def outcomes(self) -> Counter:
        return Counter((line[1], line[2]) for line in self.lines)

    @property
    def complaints(self) -> list[list[str]]:
        return [line for line in self.lines if len(line) > 3]


def feed(program: Path, make: Callable[[int], bytes], numbers: Iterable[int]) -> Findings:
    """Run the fuzzer over the cases `numbers`."""
    blobs = ((number, make(number)) for number in numbers)
    cases = b"".join(struct.pack("<QQ", number, len(blob)) + blob for number, blob in blobs)
    done = subprocess.run([program], input=cases, capture_output=True)
    lines = [line.split() for line in done.stdout.decode().splitlines()]
    return Findings(lines, (done.returncode, done.stderr.decode()[:4000]))


def check(found: Findings, first: int, count: int) -> None:
    assert found.end[0] == 0, f"case {first + len(found.lines)} ended the program: {found.end}"
    assert len(found.lines) == count
    wrong = [f"case {first + int(line[0])}: {' '.join(line[1:])}" for line in found.complaints]
    assert not wrong, wrong[:20]


def runs_sound_blobs(fuzzer: Path, count: int) -> None:
    found = feed(fuzzer, sound, range(count))
    check(found, 0, count)
    assert found.outcomes[REFUSED] == 0 and found.outcomes["step", "0"] > count / 2


def test_sound_blobs_with_random_parameters_and_inputs(fuzzer: Path) -> None:
    runs_sound_blobs(fuzzer, 40)


@pytest.mark.full
def test_many_sound_blobs(whole_fuzzer: Path) -> None:
    runs_sound_blobs(whole_fuzzer, 200)


def test_some_damaged_blobs(fuzzer: Path) -> None:
    found = feed(fuzzer, damaged, range(200))
    check(found, 0, 200)
    assert found.outcomes[REFUSED] > 60 and found.outcomes["step", "0"] > 20


def test_energy_at_rest_that_overflows_is_refused(fuzzer: Path) -> None:
    check(found := feed(fuzzer, damaged, [71842]), 71842, 1)
    assert found.outcomes == {("initialize", "7"): 1}


@pytest.mark.full
@pytest.mark.parametrize("part", range(10))
def test_forty_thousand_damaged_blobs(whole_fuzzer: Path, part: int) -> None:
    for first in range(10_000 * part, 10_000 * part + 4_000, 500):
        check(feed(whole_fuzzer, damaged, range(first, first + 500)), first, 500)
