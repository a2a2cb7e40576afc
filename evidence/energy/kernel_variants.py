"""Kernels that differ from the product in one place, for tests and benchmarks: states in double, controls that must be
seen to fail."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from gearfmu.kernel.build import FLAGS, HERE, PORTABLE, build_library, fmi_headers

WITHOUT_ETA = {r"(BALANCE|COUPLED_CHANGE) = 1e-\d+": r"\1 = 1e30"}
LOOSE_SOLVER = {r"\bSOLVED = 1e-\d+": "SOLVED = 1e-5"}
WRONG_MATRIX = {r"rigid_mobility = 0\.25 \* h \* h;": "rigid_mobility = 0.26 * h * h;"}  # D 4 % too large


def double_states(folder: Path) -> Path:
    """The kernel with modal rows and states in double."""
    return build_library(real="double", out=folder / "double.so")


def variant(folder: Path, name: str, edits: Mapping[str, str]) -> Path:
    """The double kernel with every match of the regular expressions in `edits` replaced, as folder/name.so.

    Raises ValueError when an expression matches nowhere or its replacement changes nothing: the sources have changed,
    adapt it here."""
    sources = folder / f"{name}-src"
    shutil.copytree(HERE / "src", sources, dirs_exist_ok=True)
    for pattern, replacement in edits.items():
        changed = 0
        for path in sorted(sources.rglob("*.c")):
            before = path.read_text(encoding="utf-8")
            after = re.sub(pattern, replacement, before)
            path.write_text(after, encoding="utf-8")
            changed += after != before
        if not changed:
            raise ValueError(f"{pattern!r} changes no kernel source: adapt evidence/energy/kernel_variants.py")
    out = folder / f"{name}.so"
    files = [str(p) for p in sorted(sources.rglob("*.c"))]
    command = ["cc", *FLAGS, "-O1", PORTABLE]  # -O1: the same bits in half the time of the compiler
    command += ["-Wno-unused-function"]  # which an edit leaves without a caller
    command += ["-DGK_DOUBLE_MODES", "-fPIC", "-shared", "-Wl,-Bsymbolic", f"-I{fmi_headers()}", f"-I{sources}"]
    subprocess.run([*command, "-o", str(out), *files, "-lm"], check=True)
    return out
