"""Shared by the kernel's tests: the folder's helper modules can be imported by name,
and libraries are compiled once."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from probes import Probes, compile_probes  # noqa: E402  (found through the line above)

from gearfmu.kernel import library_path  # noqa: E402


@pytest.fixture(scope="session")
def probes(tmp_path_factory: pytest.TempPathFactory) -> Probes:
    """gk_math.c, gk_blob.c and gk_sha256.c behind array functions,
    with the project's flags and the system's compiler."""
    return Probes(compile_probes(tmp_path_factory.mktemp("probes") / "probes.so"))


@pytest.fixture(scope="session")
def system_library() -> Path:
    """The kernel as it ships: the system's compiler with the project's flags."""
    return library_path()
