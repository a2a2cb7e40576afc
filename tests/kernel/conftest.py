"""Shared by the kernel's tests: the folder's helper modules can be imported by name,
and libraries are compiled once."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from probes import Probes, build, compile_probes  # noqa: E402  (found through the line above)


@pytest.fixture(scope="session")
def probes(tmp_path_factory: pytest.TempPathFactory) -> Probes:
    """gk_math.c, gk_blob.c and gk_sha256.c behind array functions,
    with the project's flags and the system's compiler."""
    return Probes(compile_probes(tmp_path_factory.mktemp("probes") / "probes.so"))


@pytest.fixture(scope="session")
def system_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The kernel as the system's compiler builds it with the project's flags."""
    return build(tmp_path_factory.mktemp("system"))


@pytest.fixture(scope="session")
def double_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The kernel with modal states and rows in double, for comparison to the last digits."""
    return build(tmp_path_factory.mktemp("double"), real="double")
