"""One tooth more: a commented stage file, three numbers changed, bodies made anew, transmission error of both pairs.

The mesh is coarse so that this takes a minute; leave `scale` away for real work. Run: python examples/own_stage.py
[FOLDER]
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import gearfmu as gf
from gearfmu.stagefile.proposals.new import new_stage

TORQUE = 302.0  # N·m on the pinion
CHANGES = {
    "teeth = 24": "teeth = 25",
    '"91.5 mm"': '"93.75 mm"',  # half a module more
    '"118.36 mm"': '"122.86 mm"',  # one module more
    "# scale = 1.0": "scale = 0.5",
}

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
shutil.rmtree(folder / "one_more", ignore_errors=True)
path = new_stage("one_more", like="fzg_c", folder=folder)
text = path.read_text(encoding="utf-8")
for old, new in CHANGES.items():
    assert old in text, f"{path} has no {old}"
    text = text.replace(old, new)
path.write_text(text, encoding="utf-8")

for stage in ("fzg_c", path):
    spec = gf.load(stage)
    te = 1e6 * gf.te(spec, TORQUE, 32).te[0]
    ratio = spec.written.geometry.tip_circle_contact_ratio
    print(
        f"{spec.name}: contact ratio {ratio:.3f}, transmission error mean {te.mean():.2f} µm, "
        f"peak to peak {te.max() - te.min():.2f} µm"
    )
