"""A kernel stays within the memory that it asked for: ten slices in a spatial stage whose bodies store few modes, so
that the tables of contacts are most of it."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import pytest

from gearfmu.body import Body, load_bodies
from gearfmu.kernel import instance
from gearfmu.stage import assemble
from gearfmu.stagefile.stage import load_stage

GUARD, PATTERN = 1 << 22, 0xA5


@pytest.mark.parametrize("level", [0.0, 2.0])
def test_nothing_is_written_beyond_the_buffers(monkeypatch: pytest.MonkeyPatch, level: float) -> None:
    guards = []

    def guarded(size: int) -> tuple[ctypes.Array, int]:
        """`aligned`, with a pattern behind the `size` bytes."""
        buffer = ctypes.create_string_buffer(size + 64 + GUARD)
        address = ctypes.addressof(buffer) + (-ctypes.addressof(buffer)) % 64
        ctypes.memset(address + size, PATTERN, GUARD)
        guards.append((buffer, address + size))
        return buffer, address

    monkeypatch.setattr(instance, "aligned", guarded)
    instance._opened.cache_clear()  # models that are open already have their buffers
    spec = load_stage("helical_demo")
    kernel = assemble(spec, [of_few_modes(body) for body in load_bodies(spec)]).kernel(level=level, slices=10.0)
    kernel.initialize()
    kernel.step(0.0, 1e-5)
    kernel.transmission(0.0, 150.0)
    assert len(guards) >= 5
    for _, end in guards:
        assert ctypes.string_at(end, GUARD) == bytes([PATTERN]) * GUARD


def of_few_modes(body: Body) -> Body:
    """The body with its first dozen modes, without rows along the profile, spin and picture; statics stay whole."""
    n = 12 if body.flank.part[12] != 2 else 11
    kept = {name: getattr(body.flank, name)[:n] for name in ("diameter", "part", "parity")}
    flank = replace(body.flank, **kept, rows=body.flank.rows[..., :n].copy(), tangent=None)
    own = {name: getattr(body, name)[:n] for name in ("frequency", "damping_ratio")}
    return replace(body, **own, rows=body.rows[:, :n].copy(), flank=flank, spin=None, picture=None)
