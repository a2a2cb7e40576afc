"""Displacement of flank nodes by stored rows against the finite elements themselves (docs/theory.md, 2.7): error of
every mode of the pinion of fzg_c, rms over the nodes of a flank, by band of frequency; with the strips' rows as they
are, and taken to points as the kernel does.

    python evidence/nodal_rows.py [--scale 0.6] [--modes 400]

scale: of the element counts. Some minutes at 0.6.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from gearfmu.body.parts import tooth_flank
from gearfmu.femesh import sector_mesh
from gearfmu.geometry import GearGeometry
from gearfmu.reduction.cyclic import modal
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.spec.stage import load_stage
from gearfmu.stage.build.tables import ROLLS, blend, resampling

POINTS = 20  # of a flank in the kernel (gk_grid.h)
BANDS = (0, 20e3, 60e3, 120e3, 180e3, 300e3)  # Hz


def cubic(values: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Cubic convolution of values (n, …) on an even grid at u, 0 … n − 1 (gk_grid.c)."""
    count = len(values)
    cell = np.minimum(u.astype(int), count - 2)
    x = (u - cell).reshape(-1, *[1] * (values.ndim - 1))
    ends = 3 * values[0] - 3 * values[1] + values[2], 3 * values[-1] - 3 * values[-2] + values[-3]
    padded = np.concatenate([ends[:1], values, ends[1:]])
    weights = (
        -0.5 * x + x**2 - 0.5 * x**3,
        1 - 2.5 * x**2 + 1.5 * x**3,
        0.5 * x + 2 * x**2 - 1.5 * x**3,
        -0.5 * x**2 + 0.5 * x**3,
    )
    return sum(weight * padded[cell + i] for i, weight in enumerate(weights))


@dataclass(frozen=True)
class Strips:
    """Rows (ROLLS, A, n) on an even grid of rolls: means over strips of half-width w (m)."""

    rows: np.ndarray
    roll_range: tuple[float, float]
    r_b: float
    w: float

    @property
    def length(self) -> float:
        """Arc length of the flank, m."""
        low, high = self.roll_range
        return (high**2 - low**2) / (2 * self.r_b)

    def at(self, arc: np.ndarray) -> np.ndarray:
        """Rows of strips whose roll point is at these arc lengths."""
        low, high = self.roll_range
        return cubic(self.rows, (np.sqrt(low**2 + 2 * self.r_b * arc) - low) / (high - low) * (ROLLS - 1))

    def points(self, arc: np.ndarray) -> np.ndarray:
        """Rows at points: those of the strips whose middles they are, straight on where there is none."""
        whole, w = self.length, self.w
        strip = np.where(arc < w, 2 * arc - w, np.where(arc > whole - w, 2 * arc - (whole - w), arc))
        inside, step = np.clip(strip, 0, whole), 1e-6 * whole
        before, after = np.clip(inside - step, 0, whole), np.clip(inside + step, 0, whole)
        slope = (self.at(after) - self.at(before)) / (after - before)[:, None, None]
        return self.at(inside) + slope * (strip - inside)[:, None, None]


def error(rows: np.ndarray, across: np.ndarray, exact: np.ndarray, mode: int) -> float:
    """rms difference of a mode from the finite elements (k,), over rms; their complex phase is free."""
    found = np.einsum("ka,ka->k", rows[:, :, mode], across).astype(complex)
    if np.iscomplexobj(exact):
        found = found + 1j * np.einsum("ka,ka->k", rows[:, :, mode + 1], across)
    fits = (np.vdot(f, exact) / np.vdot(f, f) * f for f in (found, found.conj()))
    return float(min(np.linalg.norm(exact - fit) for fit in fits) / np.linalg.norm(exact))


def main() -> None:
    """Solve the pinion's modes with their shapes and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scale", type=float, default=0.6)
    parser.add_argument("--modes", type=int, default=400)
    chosen = parser.parse_args()
    modal._SHAPES = chosen.modes  # keep all shapes, not only those for pictures
    spec = load_stage("fzg_c")
    gear, geometry = spec.gears[0], GearGeometry.of(spec.gears[0], spec.pair, hand=1)
    flank, points = tooth_flank(geometry, gear, False)
    counts = gear.body.mesh.model_copy(update={"scale": chosen.scale})
    sector = sector_mesh(geometry, gear.face_width, counts)
    modes = modal.elastic_modes(SectorBody(sector, gear.material, flank, points, False), chosen.modes)
    rows = modes.flank_rows.reshape(2, len(points.rolls), points.functions, -1)[0]
    even = blend(resampling(points.rolls, *flank.roll_range), rows, 0)
    strips = Strips(even, flank.roll_range, geometry.r_b, gear.body.strip_half_width)
    node, first = np.unique(sector.flank[0].quads.ravel(), return_index=True)
    roll, z = sector.flank[0].roll.ravel()[first], sector.flank[0].z.ravel()[first]
    normal, degrees = flank.normal(roll, 0, z), np.arange(points.functions)
    across = np.polynomial.legendre.legvander(2 * z / gear.face_width, degrees[-1]) * (2 * degrees + 1)
    arc = np.clip((roll**2 - flank.roll_range[0] ** 2) / (2 * geometry.r_b), 0, strips.length)
    grid = strips.points(np.linspace(0, strips.length, POINTS))
    ways = {"strips": strips.at(arc), "points": cubic(grid, arc / strips.length * (POINTS - 1))}
    shapes = {k: np.einsum("kc,kc->k", s.reshape(-1, 3)[node], normal) for k, s in modes.shapes.items()}
    for low, high in zip(BANDS, BANDS[1:], strict=False):
        own = [k for k in shapes if low <= modes.frequency[k] < high]
        for name, way in ways.items():
            errors = [error(way, across, shapes[k], k) for k in own] or [np.nan]
            told = f"median {np.median(errors):.2%}, largest {max(errors):.2%}"
            print(f"{low / 1e3:.0f} to {high / 1e3:.0f} kHz, {len(own)} modes, {name}: {told}", flush=True)


if __name__ == "__main__":
    main()
