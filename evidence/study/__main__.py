"""Tables beside those of `gearfmu study`: python -m evidence.study TABLE SCENE… [--out evidence/study]

bodies: distance to refined bodies (reduces them: up to an hour); sets: the price list of a planetary set.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from evidence.study.refined import BodyRow, body_rows, cheap, write_bodies_chart
from evidence.study.sets import ladder, set_study
from evidence.study.tidy import tidy
from gearfmu.commands.models import bodies_for_motion
from gearfmu.commands.shared import progress_bar
from gearfmu.report.study import write_chart
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.ladder import window
from gearfmu.study.table import read_rows, write_rows


def write_bodies(specs: Sequence[SceneSpec], out: Path, quick: bool) -> None:
    """Distances to refined bodies and their chart; rows of other scenes in the file stay."""
    path, scenes = out / "bodies.csv", [window(spec, quick) for spec in specs]
    with progress_bar("bodies") as progress:
        rows = body_rows(scenes, cheap(scenes[0]) if quick else None, progress)
    made = {row.scene for row in rows}
    kept = [row for row in read_rows(path, BodyRow) if row.scene not in made]
    write_rows(path, BodyRow, [*kept, *rows])
    print(tidy(rows))
    write_bodies_chart([*kept, *rows], path)


def write_set(spec: SceneSpec, out: Path, quick: bool) -> None:
    """The price list of a scene's set, and its chart."""
    with progress_bar(spec.name) as progress:
        found = set_study(spec, out, quick, progress)
    print(tidy(found.rows), *(f"- {note}" for note in found.notes), sep="\n")
    levels = ladder(found.rows, load_stage(spec.stage.name).written.set.planets)
    write_chart(levels, spec.stage.slices, out / spec.name, f"{spec.name}: {spec.description}")


def main(given: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=("bodies", "sets"))
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    parser.add_argument("--quick", action="store_true", help="few points on a short window")
    chosen = parser.parse_args(given)
    specs = [load_scene(scene) for scene in chosen.scenes]
    for stage in dict.fromkeys(spec.stage.name for spec in specs):
        bodies_for_motion(stage)
    if chosen.table == "bodies":
        return write_bodies(specs, chosen.out, chosen.quick)
    for spec in specs:
        write_set(spec, chosen.out, chosen.quick)


if __name__ == "__main__":
    main()
