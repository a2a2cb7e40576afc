"""Small bodies of shipped stages for tests: few elements, every tooth."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from gearfmu.body.sector import body_sector
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.modes import BodyModes
from gearfmu.modes.cyclic import cyclic_modes
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import Material

COUNT = 10


def pinion() -> tuple[FeMesh, Material]:
    """One coarse sector of the FZG pinion."""
    spec = load_stage("fzg_c")
    gear = spec.gears[0]
    counts = gear.body.mesh.model_copy(update={"scale": 0.25})
    return gear_sector(gear_geometry(gear, spec.written.pair), gear.face_width, counts), gear.material


def set_body(name: str, scale: float) -> tuple[FeMesh, Material]:
    """One sector of a body of planetary54."""
    spec = load_stage("planetary54")
    return body_sector(spec, name, scale), getattr(spec.written, name).material


@lru_cache
def pinion_modes() -> BodyModes:
    mesh, material = pinion()
    return cyclic_modes("pinion", mesh, material, COUNT)


def frequencies(body: BodyModes) -> np.ndarray:
    """All of them, those of a pair twice."""
    return np.concatenate([[mode.frequency] * len(mode.numbers) for mode in body.modes])
