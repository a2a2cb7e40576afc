"""Shared by the kernel's tests: the folder's helper modules can be imported by name."""

from __future__ import annotations

import pytest
from probes import Probes, compile_probes


@pytest.fixture(scope="session")
def probes(tmp_path_factory: pytest.TempPathFactory) -> Probes:
    """gk_math.c, gk_blob.c and gk_sha256.c behind array functions,
    with the project's flags and the system's compiler."""
    return Probes(compile_probes(tmp_path_factory.mktemp("probes") / "probes.so"))
