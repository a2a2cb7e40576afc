"""Runs shipped scenes with another build of the kernel: python checked_scenes.py LIBRARY SCENE …

The name of a scene with how each ends, "ok" or the kernel's name of the failure. A GK_ASSERT that fails ends the
process with its place on stderr."""

from __future__ import annotations

import sys
from pathlib import Path

from gearfmu import cosim
from gearfmu.kernel import binding


def main(library: str, *scenes: str) -> None:
    binding.library_path = lambda platform="host": Path(library)
    for scene in scenes:
        print(scene, cosim.run(scene, unit="kernel").meta["outcome"], flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
