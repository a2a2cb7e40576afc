"""How fine the sector meshes of `helical_demo` must be: own-tooth compliance of the pinion over element counts.

    python evidence/helical_convergence.py [--gear 0] [--quick]

For each mesh: degrees of freedom of the sector, processor time, and the largest relative difference from the last mesh
of the list of the compliance per load of each width function at its own place (flank 0, six rolls away from the ends).
--quick leaves the finest mesh away.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from gearfmu.body.parts import tooth_flank
from gearfmu.femesh import gear_sector
from gearfmu.geometry import PairGeometry
from gearfmu.reduction.cyclic.flank import Points
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.spec.stage import load_stage
from gearfmu.spec.tables.gear import MeshSpec

NAMES = ("flank", "thickness", "root", "rim", "width")
COUNTS = ((16, 4, 5, 3, 6), (20, 5, 6, 4, 6), (16, 4, 5, 3, 8), (16, 4, 5, 3, 10), (20, 5, 6, 4, 10))
ROLLS, FUNCTIONS = 8, 6


def diagonal(gear: int, counts: tuple[int, ...]) -> tuple[np.ndarray, str]:
    """Compliance (ROLLS − 2, FUNCTIONS), m/N, of every unit load of flank 0 at its own place; and what it cost."""
    started, spec = time.process_time(), load_stage("helical_demo")
    shape, own = PairGeometry.of(spec).gears[gear], spec.gears[gear]
    flank, _ = tooth_flank(shape, own)
    mesh = gear_sector(shape, own.face_width, MeshSpec(**dict(zip(NAMES, counts, strict=True))))
    body = SectorBody(mesh, own.material, flank, Points(flank.chebyshev_rolls(ROLLS), FUNCTIONS))
    table = static_tables(body, []).static_ff[0, 0, 0]
    values = np.einsum("iiaa->ia", table)[1:-1]
    return values, f"{mesh.nodes.size:7d} dof  {time.process_time() - started:6.1f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gear", type=int, default=0, choices=(0, 1))
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    found = {counts: diagonal(options.gear, counts) for counts in COUNTS[: -1 if options.quick else None]}
    reference = next(reversed(found.values()))[0]
    print("flank, thickness, root, rim, width: largest difference by width function, %")
    for counts, (values, cost) in found.items():
        difference = 100 * np.abs(values / reference - 1).max(axis=0)
        print(f"{'/'.join(map(str, counts)):>16} {cost}  " + " ".join(f"{d:6.2f}" for d in difference))


if __name__ == "__main__":
    main()
