"""Shared by the kernel's tests: the folder's helper modules can be imported by name,
and libraries are compiled once."""

from __future__ import annotations

from pathlib import Path

import pytest
from probes import Probes, compile_probes

from gearfmu.kernel import library_path


@pytest.fixture(scope="session")
def probes(tmp_path_factory: pytest.TempPathFactory) -> Probes:
    """gk_math.c, gk_blob.c and gk_sha256.c behind array functions,
    with the project's flags and the system's compiler."""
    return Probes(compile_probes(tmp_path_factory.mktemp("probes") / "probes.so"))


@pytest.fixture(scope="session")
def system_library() -> Path:
    """The kernel as it ships: the system's compiler with the project's flags."""
    return library_path()
