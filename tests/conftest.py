"""What all tests share: needs of a test that a machine may lack, with one message for each."""

from __future__ import annotations

import importlib.util
import shutil
from pathlib import Path

import pytest
from builds import double_library as double_build
from builds import inner_library as inner_build

REMEDY = {
    "chromium": "apt-get install chromium",
    "wine": "apt-get install wine wine64",
    "gcc": "apt-get install gcc",
    "clang": "apt-get install clang",
    "ccx": "apt-get install calculix-ccx",
}


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "needs(*names): programs or Python packages this test cannot do without")


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a test marked `needs("chromium")` or `needs("libcosimpy")` where that is missing, naming the remedy."""
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            if name in REMEDY and shutil.which(name) is None:
                pytest.skip(f"needs the program {name}: {REMEDY[name]}")
            if name not in REMEDY and importlib.util.find_spec(name) is None:
                pytest.skip(f"needs the Python package {name}: pip install {name}")


@pytest.fixture(scope="session")
def double_library() -> Path:
    """The kernel with modal states and rows in double, for comparison to the last digits."""
    return double_build()


@pytest.fixture(scope="session")
def inner_library() -> Path:
    """Kernel and inner_probe.c in one library."""
    return inner_build()
