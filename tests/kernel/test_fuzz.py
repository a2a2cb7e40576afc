"""Damaged model blobs and states under AddressSanitizer and UBSan:
refused with a message or run with a named outcome, never a crash or garbage."""

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
from mutations import mutated
from small_model import bars_blob, pair_blob, with_nodes

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
