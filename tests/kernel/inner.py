"""The kernel compiled together with inner_probe.c: places of contact, local law and step limit of a prepared model."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import reuse

from gearfmu.kernel import Kernel

POSE = 6


@dataclass(frozen=True)
class Place:
    """One tooth pair: flank 0 drive, 1 coast; gap m; gradient (6,) with respect to xA, yA, φA, xB, yB, φB; rolls m;
    1/ρA + 1/ρB in 1/m."""

    flank: int
    tooth: int
    gap: float
    gradient: np.ndarray
    roll: tuple[float, float]
    curvature: float


class Inner:
    """A prepared kernel whose inner functions can be called."""

    def __init__(self, library: Path, blob: bytes, parameters: dict[str, float] | None = None) -> None:
        self.kernel = Kernel(blob, parameters, library)
        self.kernel.prepare()
        self._lib = ctypes.CDLL(str(library))
        self._lib.probe_mu.restype = ctypes.c_double

    def _handles(self) -> tuple[ctypes.c_void_p, ctypes.c_void_p]:
        return ctypes.c_void_p(self.kernel._model), ctypes.c_void_p(self.kernel._setup)

    def places(self, pose: np.ndarray, reach: float = 1e-3) -> list[Place]:
        """All places at pose (xA, yA, φA, xB, yB, φB) whose undeformed gap is below `reach`."""
        full, out = (ctypes.c_double * POSE)(*pose), (ctypes.c_double * (8 * 12))()
        count = self._lib.probe_places(*self._handles(), full, ctypes.c_double(reach), out)
        rows = [out[12 * i : 12 * i + 12] for i in range(count)]
        return [Place(int(r[0]), int(r[1]), r[2], np.array(r[3:9]), (r[9], r[10]), r[11]) for r in rows]

    def rows(self, engagement: int, pose: np.ndarray, reach: float = 1e-3) -> np.ndarray:
        """(k, 27) per place and slice: flank, slice, z of its middle (m); gap and sliding per motion of the pose
        (12,): of either gear x, y, φ, z, and tilt about x and y."""
        full, out = (ctypes.c_double * 12)(*pose), (ctypes.c_double * (8 * 64 * 27))()
        count = self._lib.probe_rows(*self._handles(), engagement, full, ctypes.c_double(reach), out)
        return np.array(out[: 27 * count]).reshape(count, 27)

    def law(self, force: float, curvature: float) -> tuple[float, float, float]:
        """Approach (m), slope (m/N) and energy (J) of one slice."""
        out = (ctypes.c_double * 3)()
        self._lib.probe_law(*self._handles(), ctypes.c_double(curvature), ctypes.c_double(force), out)
        return tuple(out)

    def part(self, opens: np.ndarray, force: float) -> tuple[float, float, float, float]:
        """Approach (m), slope (m²/N) and energy (J/m) of a part of a line of contact under a line load (N/m), three of
        whose gaps open by so much more (m) than the least; what it yields per line load beside its law, m²/N."""
        out = (ctypes.c_double * 4)()
        self._lib.probe_part(*self._handles(), (ctypes.c_double * 3)(*opens), ctypes.c_double(force), out)
        return tuple(out)

    def line(self, side: float, rolls: tuple[float, float], functions: int) -> tuple[np.ndarray, np.ndarray]:
        """Ends (n, 2) of the parts of a line of contact, z in m, by the rolls at mid-width (m) and the side of the
        flanks, ±1; means (n, functions) of the width functions of gear A."""
        slices = int(self.kernel.get("slices"))
        out = (ctypes.c_double * (2 + slices * (2 + functions)))()
        rolls_of_both = (ctypes.c_double * 2)(*rolls)
        self._lib.probe_line(*self._handles(), ctypes.c_double(side), rolls_of_both, out)
        rows = np.array(out[2:]).reshape(slices, -1)
        assert tuple(out[:2]) == (rows[0, 0], rows[-1, 1]) or np.allclose(out[:2], (rows[0, 0], rows[-1, 1]))
        return rows[:, :2], rows[:, 2:]

    def spread(self, ends: tuple[float, float], force: float) -> np.ndarray:
        """(slices,) N: a force that is even between two places z (m) of the width."""
        out = (ctypes.c_double * int(self.kernel.get("slices")))()
        self._lib.probe_spread(*self._handles(), (ctypes.c_double * 2)(*ends), ctypes.c_double(force), out)
        return np.array(out)

    def force_gamma(self, gamma: float) -> None:
        """Keep this γ whatever the limit of the step says; after `kernel.initialize`."""
        reuse.keep(self.kernel)
        self._lib.probe_set_gamma(self._handles()[1], ctypes.c_double(gamma))

    def runout(self, pose: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(12,) each: where the toothings of the first engagement stand at a pose of their gears, and how they move
        there. Of either gear x, y, φ, z, and tilt about x and y."""
        full, moving = (ctypes.c_double * 12)(*pose), (ctypes.c_double * 12)(*motion)
        self._lib.probe_runout(*self._handles(), full, moving)
        return np.array(full), np.array(moving)

    def mu(self, h: float, gamma: float = 1.0) -> float:
        """μ′ at step h (s)."""
        memory = ctypes.c_void_p(self.kernel._work), ctypes.c_void_p(self.kernel._data)
        return self._lib.probe_mu(*self._handles(), *memory, ctypes.c_double(h), ctypes.c_double(gamma))
