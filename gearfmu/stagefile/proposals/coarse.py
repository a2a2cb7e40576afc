"""The coarse sister of a stage: the same stage on half the element counts, whose bodies are made in seconds.

It is a stage of its own in a folder of its own, `coarse/`, that takes everything else from the stage's file: the
counts shape the fingerprint of a body, so coarse bodies are never taken for those of the stage.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from gearfmu.files import write_text
from gearfmu.stagefile.forms.general import Form, Stage
from gearfmu.stagefile.forms.planetary import PlanetarySpec
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage

FOLDER = "coarse"
SCALE = 0.5  # on all element counts
STATED_ERROR = (
    "Measured on a helical pair z 31/73 (evidence/bodies/coarse.csv): free frequencies to 20 kHz within 0.7 %, "
    "own-tooth compliance 1.4 % low at mid flank and within 6.2 % at its ends."
)

_HEAD = """# The coarse sister of {file}: half the element counts, made anew by every `gearfmu reduce --coarse`.
# {error}
"""


def coarse_stage(stage: str | os.PathLike[str], folder: str | os.PathLike[str] | None = None) -> Path:
    """Write the coarse sister of a stage and return its path: `coarse/<file>` beside the stage's file, or in `folder`.

    Raises SpecError where the stage is not valid.
    """
    source, spec = find_stage(stage), load_stage(stage).written
    target = (source.parent / FOLDER if folder is None else Path(folder)) / source.name
    base = Path(os.path.relpath(source, target.parent)).as_posix()
    text = spec.description.replace("\\", "\\\\").replace('"', '\\"')
    text = f"coarse: {text}" if text else "coarse"
    lines = [f'base = "{base}"', f'name = "{spec.name[:33]}_coarse"', f'description = "{text}"']
    for place, table in _tables(spec):
        lines += ["", f"[{place}]", *(f"{key} = {value!r}" for key, value in table.items())]
    target.parent.mkdir(parents=True, exist_ok=True)
    write_text(target, _HEAD.format(file=base, error=STATED_ERROR) + "\n".join(lines) + "\n")
    return target


def _tables(spec: Form | Stage) -> list[tuple[str, dict[str, Any]]]:
    """Tables that say what is coarser; of bodies meshed elsewhere the counts of our own mesh mean nothing."""
    prefix = {"planetary_set": "", "external_pair": "gears."}.get(spec.kind, "bodies.")
    found = [(f"{prefix}{gear.name}.body.mesh", {"scale": SCALE * gear.body.mesh.scale}) for gear in spec.gears]
    if isinstance(spec, PlanetarySpec):
        found.append(("carrier.mesh", {"scale": min(spec.carrier.mesh.scale, SCALE)}))
    return found
