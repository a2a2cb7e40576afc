"""A gear as it was deformed at chosen times of a run: its drawn surface, and how far every point of it has moved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearfmu.body import Body
from gearfmu.body.body import Shapes, turn_sectors, whole_surface
from gearfmu.geometry.plane import about_z
from gearfmu.stage.run.deformation import DeformationError, GearMotion


@dataclass(frozen=True)
class DeformedGear:
    """A gear's surface and its motion over F frames, in axes fixed to it; `deformed_gear` checks that they belong
    together. body: Body with its `picture.shapes`; angle: of its tooth or space 0 from +x, rad: 0 in the gear's own
    axes, its phase in those of the stage where it stands at φ = 0."""

    name: str
    body: Body
    motion: GearMotion
    angle: float = 0.0

    @cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (P, 3) m and quadrilaterals (Q, 4), normals outward, at rest."""
        points, quads = whole_surface(self._shapes, self.body.toothed.teeth)
        return self._turned(points.astype(float)), quads

    def elastic(self, frame: int) -> np.ndarray:
        """Displacement (P, 3) m of the surface's points in its modes, rigid motion left out: √m Σ q̂_k φ_k."""
        flat = self._shapes.modes.reshape(self.body.modes, -1)
        of_sectors = self._of_sectors(frame) @ flat
        return self._turned(turn_sectors(of_sectors.reshape(self.body.toothed.teeth, -1, 3)).reshape(-1, 3))

    def rigid(self, frame: int) -> np.ndarray:
        """The same by rigid motion alone, x + θ × r."""
        shift, tilt = self._turned(self.motion.motion[frame].reshape(2, 3))
        return shift + np.cross(tilt, self.surface[0])

    def _turned(self, vectors: np.ndarray) -> np.ndarray:
        return vectors @ about_z(-self.angle)

    @property
    def _shapes(self) -> Shapes:
        assert self.body.picture is not None and self.body.picture.shapes is not None
        return self.body.picture.shapes

    def _of_sectors(self, frame: int) -> np.ndarray:
        """(z, n), kg^½·m: what amplitudes of the modes every sector sees in its own frame, as if it were sector 0
        (docs/architecture.md: rows of a pair on tooth j)."""
        flank, q = self.body.toothed, np.zeros(self.body.modes)
        q[self.motion.modes - 1] = math.sqrt(self.body.total_mass) * self.motion.amplitude[frame]
        angle = 2 * np.pi * np.outer(np.arange(flank.teeth), flank.diameter) / flank.teeth
        c, s = np.cos(angle), np.sin(angle)
        seen, first, second = c * q, flank.part == 1, flank.part == 2
        seen[:, first] += s[:, first] * q[second]
        seen[:, second] -= s[:, second] * q[first]
        return seen


def deformed_gear(name: str, body: Body, motion: GearMotion, angle: float = 0.0) -> DeformedGear:
    """The gear `name` of a run with its Body, tooth 0 at `angle` (rad). DeformationError for another body than
    the run's, and for one whose file has no surface in all modes."""
    if body.how.hash != motion.body_hash:
        raise DeformationError(f"{name}: the run was made with another reduced body than the one at hand: run it again")
    if body.picture is None or body.picture.shapes is None:
        raise DeformationError(
            f"{name}: the file of its body was made before surfaces were kept in all modes: make it again with "
            "'gearfmu reduce STAGE --force'"
        )
    return DeformedGear(name, body, motion, angle)
