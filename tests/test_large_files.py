"""Files of a megabyte or more in the repository are listed here: everyone downloads them, for ever."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LARGE = 1e6  # bytes
LISTED = {
    "reduced_models/helical_demo/pinion.h5",
    "reduced_models/helical_demo/wheel.h5",
    "reduced_models/two_stage/pinion1.h5",
    "reduced_models/two_stage/pinion2.h5",
}
LIBRARY = 15e6  # bytes of all bodies


def tracked() -> list[str]:
    """Files of the repository that are there; skips where this is no checkout."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def test_large_files_are_listed() -> None:
    assert {name for name in tracked() if (ROOT / name).stat().st_size > LARGE} == LISTED


def test_the_library_of_bodies_stays_small() -> None:
    bodies = [ROOT / name for name in tracked() if name.startswith("reduced_models/")]
    assert bodies and sum(path.stat().st_size for path in bodies) < LIBRARY
