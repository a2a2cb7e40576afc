"""What the coarse sister of a stage costs and how far its bodies are from the stage's own: table and CSV.

    python -m evidence.bodies.coarse [STAGE …] [--out coarse.csv]

A stage is a path or a shipped name; without one, a pair z 31/73 is proposed (m_n = 2.5 mm, beta = 22 deg,
b = 30 mm, 180 N*m).
Bodies of the stage that are up to date are read, all others made in folders that do not stay. Frequencies: the lowest
elastic ones, 0 to 20 kHz, counted within their nodal diameter. Compliance: own tooth, load uniform across the width, on
every stored roll point (largest difference) and at mid flank.
"""

from __future__ import annotations

import argparse
import csv
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from gearfmu.api.models import load, reduce
from gearfmu.body import Body, current_bodies
from gearfmu.files import written_whole
from gearfmu.stagefile.proposals.coarse import coarse_stage
from gearfmu.stagefile.proposals.numbers import Wish, new_from_numbers

TO = 20e3  # Hz
PAIR = Wish((31, 73), 2.5e-3, 30e-3, center=141e-3, helix=math.radians(22), torque=180.0)


def families(body: Body) -> list[np.ndarray]:
    """Frequencies (Hz) below `TO` by nodal diameter, ascending."""
    low = body.frequency < TO
    return [body.frequency[low & (body.flank.diameter == nu)] for nu in np.unique(body.flank.diameter[low])]


def frequency_difference(coarse: Body, own: Body) -> float:
    """Largest relative difference of frequencies that both have below `TO`."""
    found = [
        np.abs(a[: min(len(a), len(b))] / b[: min(len(a), len(b))] - 1).max(initial=0.0)
        for a, b in zip(families(coarse), families(own), strict=False)
    ]
    return float(max(found))


def own_tooth(body: Body) -> np.ndarray:
    """(2, R) m/N: compliance of either flank under a load uniform across the width, at every roll point."""
    own = body.flank.static[:, :, 0, :, :, 0, 0]
    return np.array([np.diagonal(own[flank, flank]) for flank in (0, 1)])


def row(coarse: Any, own: Any) -> dict[str, Any]:
    """Differences of one body, per cent, and costs."""
    facts = {
        "body": own.name,
        "coarse_cpu_s": coarse.how.provenance["cpu_s"],
        "own_cpu_s": own.how.provenance["cpu_s"],
        "coarse_GB": coarse.how.provenance["peak_memory_GB"],
        "own_GB": own.how.provenance["peak_memory_GB"],
    }
    if own.flank is None:
        count = 20
        difference = float(np.abs(coarse.frequency[:count] / own.frequency[:count] - 1).max())
        return facts | {"frequencies_%": 100 * difference}
    first, second = (own_tooth(body) for body in (coarse, own))
    change, middle = first / second - 1, len(own.flank.roll) // 2
    return facts | {
        "frequencies_%": 100 * frequency_difference(coarse, own),
        "compliance_%": 100 * float(np.abs(change).max()),
        "compliance_mid_flank_%": 100 * float(change[0, middle]),
    }


def rows_of(stage: str | Path, folder: Path) -> list[dict[str, Any]]:
    """A row for every body of a stage."""
    spec = load(stage)
    kept = len(current_bodies(spec)) == len(spec.files)
    own = reduce(spec, None if kept else folder / "own")
    coarse = reduce(coarse_stage(stage, folder / "coarse"))
    return [{"stage": spec.name} | row(*pair) for pair in zip(coarse, own, strict=True)]


def averaging(stage: Path) -> Path:
    """The stage with averaging bores, as shipped stages have them."""
    text = stage.read_text(encoding="utf-8")
    stage.write_text(text.replace('bore_coupling = "rigid"', 'bore_coupling = "averaging"'), encoding="utf-8")
    return stage


def main() -> None:
    """Table on the terminal and CSV."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="*", metavar="STAGE")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_suffix(".csv"))
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as home:
        stages = arguments.stages or [averaging(Path(new_from_numbers("pair_31_73", PAIR, home)))]
        for number, stage in enumerate(stages):
            rows += rows_of(stage, Path(home) / str(number))
    names = list(dict.fromkeys(name for entry in rows for name in entry))
    with written_whole(arguments.out) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        for entry in rows:
            shown = {key: f"{value:.3g}" if isinstance(value, float) else value for key, value in entry.items()}
            print(shown)
            writer.writerow(shown)


if __name__ == "__main__":
    main()
