"""The pictures of modes in the docs: sheets of the lowest modes of bodies, and a Campbell diagram.

    python -m evidence.pictures.mode_pictures [pinion] [campbell] [carrier] [ring]  (all when none is named)

Each runs `gearfmu modes` as a user would, in a temporary folder, and writes its picture with a palette of 256 colours
(a third of the bytes) to docs/pictures/modes_<body>.png and docs/pictures/campbell.png. The ring is the 936 000
unknowns of planetary54, the carrier its 67 000.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from gearfmu.files import written_whole

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "pictures"
ARGUMENTS = {
    "pinion": ("fzg_c", "--body", "pinion"),
    "campbell": ("fzg_c", "--torque", "302 N*m"),
    "carrier": ("planetary54", "--body", "carrier"),
    "ring": ("planetary54", "--body", "ring"),
}


def main() -> None:
    for name in sys.argv[1:] or ARGUMENTS:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "gearfmu.cli", "modes", *ARGUMENTS[name], "--out", folder]
            subprocess.run(command, check=True, env=os.environ)
            (found,) = Path(folder).glob("*_campbell.png" if name == "campbell" else "*_sheet.png")
            picture = Image.open(found).convert("RGB").quantize(256, dither=Image.Dither.NONE)
            target = PICTURES / ("campbell.png" if name == "campbell" else f"modes_{name}.png")
            with written_whole(target) as path:
                picture.save(path, format="png", optimize=True)
            print(target, target.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
