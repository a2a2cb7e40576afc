"""One source, the same bits: whatever the compiler, the optimisation and the contents of uninitialised memory; and with
GK_ASSERT, of which none fails."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import struct
import subprocess
import sys
import traceback
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

import pytest
from builds import checked_library
from golden import REALS, moved, results, stored
from probes import build, compilers, source_folder
from small_model import pair_blob

from gearfmu import cosim
from gearfmu.kernel import Kernel, binding, instance
from gearfmu.kernel.build import FLAGS, fmi_headers
from gearfmu.scenefile.scene import load_scene

FLAG_SETS = {"O0": ("-O0",), "O1": ("-O1",), "O2": ("-O2",), "O3": (), "native": ("-march=native",)}
VARIANTS = [pytest.param(c, f, marks=pytest.mark.full) for c in compilers() for f in FLAG_SETS]
CHECKS = 150  # GK_ASSERT in the sources, at least
QUICK_SCENES = [("pair_loaded", {"duration": "60 ms"}), ("clutch_closure", {"duration": "130 ms"})]  # it has locked
LONG_SCENES = ("pair_loaded", "clutch_closure", "clutch_closure_train", "planetary_closure")
WATCHED = ("mesh.force", "mesh.te", "energy.stored", "energy.residual", "bearing.pinion.fx", "wheel.gear.phi")


@lru_cache
def bits(library: Path) -> str:
    """SHA-256 over states and outputs of short runs: every integrator through reversals of torque,
    dg4 with a slipping clutch."""
    digest = hashlib.sha256()
    for integrator in range(3):
        digest.update(run(library, ("torque", "spring"), integrator, 200))
    digest.update(run(library, ("chain", "spring"), 0, 300))
    return digest.hexdigest()


def run(library: Path, ports: tuple[str, str], integrator: int, steps: int) -> bytes:
    """Outputs and last state of a run with a swinging input; the contact opens and closes."""
    kernel = Kernel(pair_blob(ports), {"integrator": integrator, "h": 2e-6 if integrator == 2 else 7.5e-6}, library)
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


FUSED_ONCE = ("problem/gk_nodal.c", "run/gk_amplitudes.c", "run/gk_supports.c", "setup/gk_deviation.c")
WITH_FMA = ("-march=x86-64-v3", "-DGK_PORTABLE")  # processors of 2013 and later
WHOLE = [pytest.param("**/*.c", marks=pytest.mark.full)]


@pytest.mark.skipif(platform.machine() != "x86_64" or "gcc" not in compilers(), reason="needs gcc for x86-64")
@pytest.mark.parametrize("files", [*FUSED_ONCE, *WHOLE])
def test_no_product_and_sum_are_fused(files: str) -> None:
    """gcc's straight-line vectoriser fuses products with a sum beside a difference (vfmaddsub), whatever -ffp-contract
    says: other bits on processors that can, first with deviations and nodal contact."""
    paths = list(source_folder().glob(files))
    assert paths
    for path in paths:
        line = ["gcc", *FLAGS, *WITH_FMA, f"-I{source_folder()}", f"-I{fmi_headers()}", "-S", str(path), "-o", "-"]
        done = subprocess.run(line, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert not re.search(r"\bvfn?m(add|sub)", done.stdout), path.name


@pytest.mark.full
@pytest.mark.skipif("gcc" not in compilers(), reason="needs gcc")
def test_a_native_build_runs_every_kind_of_stage_with_the_same_bits(system_library: Path, tmp_path: Path) -> None:
    native = build(tmp_path, ("gcc",), ("-march=native",))
    for stage in ("pair", "deviating", "nodal", "pin_errors"):
        assert results(native, f"{stage}/") == results(system_library, f"{stage}/")


def test_same_bits_with_checks_and_patterned_memory(system_library: Path) -> None:
    assert bits(checked_library()) == bits(system_library)


def test_a_second_run_repeats_the_first(system_library: Path) -> None:
    """Nothing of an instance stays behind in the library."""
    first = run(system_library, ("chain", "spring"), 0, 60)
    run(system_library, ("torque", "spring"), 0, 30)
    assert run(system_library, ("chain", "spring"), 0, 60) == first


# ---- with GK_ASSERT --------------------------------------------------------------------------------------------------
def apart(run: Callable[[], object]) -> int:
    """Exit code of a fork of this process that calls `run`: a check that fails ends it."""
    if child := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    code = 1
    try:
        run()
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def golden_runs(real: str = "float", part: str = "") -> None:
    assert not moved(stored(real, part), results(checked_library(real), part))


def scene(name: str, changes: dict[str, str]) -> None:
    """Runs it on the kernel with checks."""
    checked = binding.load(checked_library())
    instance.load = lambda library=None: checked
    instance._opened.cache_clear()
    assert cosim.run(load_scene(name, changes), unit="kernel").meta["outcome"] == "ok"


def test_no_check_fails_in_runs_of_the_pair() -> None:
    assert apart(partial(golden_runs, part="pair/")) == 0


@pytest.mark.full
@pytest.mark.parametrize("real", REALS)
def test_no_check_fails_in_golden_runs(real: str) -> None:
    assert apart(partial(golden_runs, real)) == 0


@pytest.mark.parametrize(
    ("name", "changes"), [*QUICK_SCENES, *(pytest.param(name, {}, marks=pytest.mark.full) for name in LONG_SCENES)]
)
def test_no_check_fails_in_scenes(name: str, changes: dict[str, str]) -> None:
    assert apart(partial(scene, name, changes)) == 0


def test_a_check_that_fails_ends_the_process_and_says_where() -> None:
    call = f"import ctypes; ctypes.CDLL({str(checked_library())!r}).gk_model_name(None)"
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True)
    assert done.returncode == -6
    assert re.search(r"model/gk_text\.c:\d+: GK_ASSERT\(model\) failed", done.stderr)


def test_the_product_has_no_checks(system_library: Path) -> None:
    assert b"GK_ASSERT" not in system_library.read_bytes()
    assert b"GK_ASSERT" in checked_library().read_bytes()


def test_doors_and_accessors_are_checked() -> None:
    files = [*source_folder().rglob("*.c"), *source_folder().rglob("*.h")]
    assert sum(len(re.findall(r"^ *GK_ASSERT\(", path.read_text("utf-8"), re.M)) for path in files) >= CHECKS
