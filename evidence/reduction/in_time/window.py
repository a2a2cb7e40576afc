"""A window of both scenes in CalculiX's direct time integration (*DYNAMIC, DIRECT), the same meshes, against ours.

    python -m evidence.reduction.in_time.window [carrier_planet] [hammering] [--work DIR] [--compare]

Both programs take HHT-α with the same α and step over 0.2 ms (4 and 10 µs); the finite elements are not reduced. The
mesh is coarser than that of compare.py, because CalculiX factorises twice a step or more. Writes window_<scene>.csv
(time and every channel of both) and window.csv (largest and rms difference over the rms of CalculiX) beside this file;
--compare integrates ours again and leaves CalculiX's columns as they are. Needs ccx (Debian: calculix-ccx); ten minutes
of one core.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from evidence.peers.calculix.ccx import require_ccx, run
from evidence.reduction.in_time.channels import channels
from evidence.reduction.in_time.scenes import Meshes, Scene, carrier_planet, hammering
from evidence.reduction.in_time.tables import read_columns, read_rows, write_columns, write_rows
from evidence.reduction.in_time.transient import Motion, Scheme, integrate
from evidence.reduction.in_time.transient_deck import Deck

HERE = Path(__file__).parent

SCENES = {"carrier_planet": carrier_planet, "hammering": hammering}
MESHES = Meshes(carrier=0.35, gear=0.17)
SCHEMES = {"carrier_planet": Scheme(4e-6, 0.2e-3), "hammering": Scheme(10e-6, 0.2e-3)}


def calculix(scene: Scene, work: Path) -> dict[str, np.ndarray]:
    """The channels of CalculiX's run."""
    work.mkdir(parents=True, exist_ok=True)
    deck, path = Deck(scene, SCHEMES[scene.name]), work / f"{scene.name}.inp"
    deck.write(path)
    print(f"{scene.name}: ccx took {run(path):.0f} s", file=sys.stderr, flush=True)
    return channels(scene, motion_of(scene, deck.read(path.with_suffix(".dat"))))


def motion_of(scene: Scene, read: dict[str, np.ndarray]) -> Motion:
    """What CalculiX printed as a Motion; the tension of contacts follows from their gaps, springs have none."""
    steps, scheme = len(read["contact"]), SCHEMES[scene.name]
    assert steps == scheme.steps + 1, f"{steps - 1} of {scheme.steps} increments in the file"
    joints, touching = scene.assembly.joints, scene.kinds == "contact"
    tension = np.zeros((steps, joints.count))
    tension[:, touching] = np.minimum(read["contact"] + joints.gap[touching], 0.0) * joints.stiffness[touching]
    interfaces = {name: read[name] for name in scene.solids}
    return Motion(np.arange(steps) * scheme.step, interfaces, tension, np.zeros(steps), 0)


def differences(name: str, ours: dict[str, np.ndarray], theirs: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """A row a channel that is not nothing."""
    rows = []
    for channel, values in theirs.items():
        size, off = np.sqrt(np.mean(values**2)), ours[channel] - values
        if size > 0:
            rms, most = np.sqrt(np.mean(off**2)) / size, np.abs(off).max() / size
            rows.append({"scene": name, "channel": channel, "rms": float(rms), "largest": float(most)})
    return rows


def compared(name: str, work: Path, again: bool) -> list[dict[str, Any]]:
    """Both runs of a scene, their curves written; rows of their differences. again : CalculiX's curves are there."""
    scene, scheme, path = SCENES[name](MESHES), SCHEMES[name], HERE / f"window_{name}.csv"
    mark = " | CalculiX"
    theirs = (
        {key.removesuffix(mark): values for key, values in read_columns(path).items() if key.endswith(mark)}
        if again
        else calculix(scene, work)
    )
    ours = channels(scene, integrate(scene.assembly, scheme))
    table = {"time_s": np.arange(scheme.steps + 1) * scheme.step}
    table |= {f"{key}{mark}": values for key, values in theirs.items()}
    table |= {f"{key} | ours": values for key, values in ours.items()}
    write_columns(path, table)
    return differences(name, ours, theirs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--work", type=Path, default=Path("out/in_time"), help="decks, logs and results of ccx")
    parser.add_argument("--compare", action="store_true")
    chosen = parser.parse_args()
    if unknown := [name for name in chosen.scenes if name not in SCENES]:
        parser.error(f"no scene {', '.join(unknown)}; there are {', '.join(SCENES)}")
    if not chosen.compare:
        require_ccx()
    path = HERE / "window.csv"
    for name in chosen.scenes or SCENES:
        found = compared(name, chosen.work, chosen.compare)
        for row in found:
            print(f"{row['scene']}  {row['channel']}  {row['rms']:.1e}  {row['largest']:.1e}", flush=True)
        write_rows(path, [*(row for row in read_rows(path) if row["scene"] != name), *found])


if __name__ == "__main__":
    main()
