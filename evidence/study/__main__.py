"""Tables of the time step beside `gearfmu study`: python -m evidence.study TABLE SCENE… [--out evidence/study]

cuts: over the cut frequency; order: observed order of the integrators; limits: default, too large and refused steps;
bodies: distance to refined bodies (reduces them: up to an hour); sets: the price list of a planetary set.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evidence.study import cuts, limits, order, refined
from evidence.study.refined import write_bodies_chart
from evidence.study.sets import ladder, set_study
from evidence.study.tidy import tidy
from gearfmu.commands.models import bodies_for_motion
from gearfmu.commands.shared import progress_bar
from gearfmu.report.study import write_chart
from gearfmu.scenefile.scene import SceneSpec, load_scene
from gearfmu.stage.assembly.levels import LEVELS
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.ladder import window
from gearfmu.study.table import read_rows, write_rows


def table(name: str, specs: Sequence[SceneSpec], quick: bool, tell: Any) -> list[Any]:
    """The rows of a table but `sets`."""
    scenes = [window(spec, quick or name in ("order", "limits")) for spec in specs]
    if name == "cuts":
        return [row for scene in scenes for row in cuts.cut_rows(scene, quick, tell)[0]]
    if name == "limits":
        levels = ("fast",) if quick else LEVELS
        return [row for scene in scenes for row in limits.limit_rows(scene, levels, progress=tell)]
    if name == "bodies":
        return refined.body_rows(scenes, refined.cheap(scenes[0]) if quick else None, tell)
    meshing = ("rigid",) if quick else order.LEVELS
    return order.constant_stiffness() + [r for s in scenes for r in order.gear_mesh(s, meshing, progress=tell)]


def write(name: str, specs: Sequence[SceneSpec], out: Path, quick: bool) -> None:
    """Measure and write a table; rows of other scenes in the file stay."""
    path = out / f"{name}.csv"
    with progress_bar(name) as progress:
        rows = table(name, specs, quick, progress)
    names = {spec.name for spec in specs}
    made = {None, *names, *(getattr(row, "scene", None) for row in rows)}
    kept = [row for row in read_rows(path, type(rows[0])) if getattr(row, "scene", None) not in made]
    write_rows(path, type(rows[0]), [*kept, *rows])
    print(tidy(rows, [field for field in vars(rows[0]) if field != "message"]))
    for message in dict.fromkeys(row.message for row in rows if getattr(row, "message", "")):
        print(f"- {message}")
    if name == "bodies":
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
    parser.add_argument("table", choices=("cuts", "order", "limits", "bodies", "sets"))
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    parser.add_argument("--quick", action="store_true", help="few points on a short window")
    chosen = parser.parse_args(given)
    specs = [load_scene(scene) for scene in chosen.scenes]
    for stage in dict.fromkeys(spec.stage.name for spec in specs):
        bodies_for_motion(stage)
    if chosen.table == "sets":
        for spec in specs:
            write_set(spec, chosen.out, chosen.quick)
    else:
        write(chosen.table, specs, chosen.out, chosen.quick)


if __name__ == "__main__":
    main()
