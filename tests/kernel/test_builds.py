"""One source, the same bits: whatever the compiler, the optimisation and the contents of uninitialised memory."""

from __future__ import annotations

import hashlib
import struct
from functools import lru_cache
from pathlib import Path

import pytest
from probes import build, compilers
from small_model import pair_blob

from gearfmu.kernel import Kernel

FLAG_SETS = {"O0": ("-O0",), "O1": ("-O1",), "O2": ("-O2",), "O3": (), "native": ("-march=native",)}
QUICK = {("gcc", "O0"), ("clang", "O3")}
VARIANTS = [
    pytest.param(c, f, marks=[] if (c, f) in QUICK else [pytest.mark.full]) for c in compilers() for f in FLAG_SETS
]
WATCHED = ("mesh.force", "mesh.te", "energy.stored", "energy.residual", "bearing.pinion.fx", "wheel.gear.phi")


@lru_cache
def bits(library: Path) -> str:
    """SHA-256 over states and outputs of short runs: every integrator through reversals of torque,
    dg4 with a slipping clutch."""
    digest = hashlib.sha256()
    for integrator in range(4):
        digest.update(run(library, ("torque", "spring"), integrator, 200))
    digest.update(run(library, ("chain", "spring"), 0, 300))
    return digest.hexdigest()


def run(library: Path, ports: tuple[str, str], integrator: int, steps: int) -> bytes:
    """Outputs and last state of a run with a swinging input; the contact opens and closes."""
    kernel = Kernel(pair_blob(ports), {"integrator": integrator, "h": 2e-6 if integrator == 3 else 7.5e-6}, library)
    if ports[0] == "chain":
        kernel.set("pinion.w", 30.0)
        kernel.set("pinion.clutch.capacity", 120.0)
    kernel.initialize()
    record = []
    for i in range(steps):
        if ports[0] == "torque":
            kernel.set("pinion.tau", 200.0 if i // 40 % 2 else -150.0)
        else:
            kernel.set("pinion.phi", 30.0 * i * 2e-5)
        kernel.step(i * 2e-5, 2e-5)
        record += [kernel.get(name) for name in WATCHED]
    assert max(map(abs, record[:: len(WATCHED)])) > 100  # the teeth did meet
    return struct.pack(f"<{len(record)}d", *record) + kernel.save()


@pytest.mark.parametrize(("compiler", "flags"), VARIANTS)
def test_same_bits_from_every_compiler(system_library: Path, compiler: str, flags: str, tmp_path: Path) -> None:
    assert bits(build(tmp_path, compilers()[compiler], FLAG_SETS[flags])) == bits(system_library)


def test_same_bits_with_patterned_memory(system_library: Path, tmp_path: Path) -> None:
    """Automatic variables that nobody sets hold a pattern instead of zeros or leftovers (gcc 12 and later, clang)."""
    compiler = next(iter(compilers().values()))
    assert bits(build(tmp_path, compiler, pattern=True)) == bits(system_library)


def test_a_second_run_repeats_the_first(system_library: Path) -> None:
    """Nothing of an instance stays behind in the library."""
    first = run(system_library, ("chain", "spring"), 0, 60)
    run(system_library, ("torque", "spring"), 0, 30)
    assert run(system_library, ("chain", "spring"), 0, 60) == first
