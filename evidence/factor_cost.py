"""What the choice of cuts saves in factorising a whole body: nested dissection by one vector and by combinations of
two.

    python evidence/factor_cost.py [scale]

The carrier of planetary54, its element counts times `scale` (1), K + M·(2π·1 Hz)² by Cholesky. Prints and writes
evidence/factor_cost.csv: unknowns, cuts tried, entries of L, multiplications and additions (10⁹ pairs), processor
seconds of dissection and factor and of a solution for 24 loads.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import numpy as np

from gearfmu.fem import dissection
from gearfmu.fem.factor import Factor
from gearfmu.files import write_text
from gearfmu.reduction.carrier import carrier_full_order
from gearfmu.spec.stage import load_stage

HERE = Path(__file__).parent


def main() -> None:
    body = carrier_full_order(load_stage("planetary54"), float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
    matrix = body.stiffness + (2 * np.pi) ** 2 * body.mass
    lines = ["dof,cuts,entries_M,pairs_G,dissection_s,factor_s,solve_24_s"]
    for cuts in (1, dissection._CUTS):
        dissection._CUTS = cuts
        dissection._dissection.cache_clear()
        clock = time.process_time()
        dissection.nested_dissection(body.cells)
        ordered = time.process_time()
        factor = Factor(matrix, body.cells, body.node_of_dof)
        factored = time.process_time()
        factor.solve(np.ones((body.size, 24)))
        solved = time.process_time()
        own = np.array([front.stop - front.start for front in factor._fronts], float)
        below = np.array([len(front.below) for front in factor._fronts], float)
        entries, pairs = own * (own + 1) / 2 + own * below, own**3 / 6 + own**2 * below / 2 + own * below**2 / 2
        times = f"{ordered - clock:.2f},{factored - ordered:.2f},{solved - factored:.2f}"
        lines.append(f"{body.size},{cuts},{1e-6 * entries.sum():.1f},{1e-9 * pairs.sum():.1f},{times}")
    write_text(HERE / "factor_cost.csv", "\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
