"""How far a scene is from one with refined bodies: what the error of the bodies is, beside that of time.

Bodies of a finer mesh and with more modes are reduced in memory (minutes to an hour); what remains is a small table.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib import rc_context

from evidence.study.dashpot import same_loss
from gearfmu.body import load_bodies, reduce_body
from gearfmu.report.study import QUANTITIES
from gearfmu.report.style import panels, saved, styled
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stage.assembly.teeth import ROLLS
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.study.bench import Point, Run, measure, models_for
from gearfmu.study.norm import errors

H = 1.25e-6  # s, of all runs: the error of time is the same in both
SCALE, MODES = 1.3, 2  # factors of the refined mesh (on all counts) and of the number of modes
FINEST_SLICES = 10


@dataclass(frozen=True)
class BodyRow:
    """Distance of level full with the shipped bodies from the scene with `refined`: errors as in a study's rows.

    dof: of the two gears' sectors · cpu_s: processor time of the reductions, 0 for what needs none.
    """

    scene: str
    refined: str
    dof: str
    n_dyn: int
    slices: int
    rolls: int
    te_error: float
    te_mean_error: float
    force_error: float
    bearing_error: float
    cpu_s: float


@dataclass(frozen=True)
class Variant:
    """A refinement: what to call it, gears as they are to be reduced (None: the shipped bodies), slices, rolls. Reduced
    anew, the contact's dashpots take the constant with which they lose the same (dashpot.py)."""

    name: str
    gears: tuple[Any, ...] | None
    slices: int
    rolls: int


def variants(spec: Stage, slices: int, scale: float = SCALE, modes: int = MODES) -> list[Variant]:
    """One thing refined at a time, then all of them."""
    finer = [_refined(gear, scale, 1) for gear in spec.written.gears]
    more = [_refined(gear, 1.0, modes) for gear in spec.written.gears]
    both = [_refined(gear, scale, modes) for gear in spec.written.gears]
    return [
        Variant(f"slices {FINEST_SLICES}", None, FINEST_SLICES, ROLLS),
        Variant(f"rolls {2 * ROLLS}", None, slices, 2 * ROLLS),
        Variant(f"rolls {4 * ROLLS}", None, slices, 4 * ROLLS),
        Variant(f"modes × {modes}", tuple(more), slices, ROLLS),
        Variant(f"mesh × {scale:g}", tuple(finer), slices, ROLLS),
        Variant("all of them", tuple(both), FINEST_SLICES, 2 * ROLLS),
    ]


def cheap(scene: SceneSpec) -> list[Variant]:
    """The variants that need no finite elements."""
    return [v for v in variants(load_stage(scene.stage.name), scene.stage.slices) if v.gears is None]


def _refined(gear: Any, scale: float, modes: int) -> Any:
    mesh = gear.body.mesh.model_copy(update={"scale": gear.body.mesh.scale * scale})
    return gear.model_copy(
        update={"body": gear.body.model_copy(update={"mesh": mesh, "modes": gear.body.modes * modes})}
    )


def body_rows(
    scenes: Sequence[SceneSpec],
    chosen: Sequence[Variant] | None = None,
    progress: Callable[..., None] | None = None,
    h: float = H,
) -> list[BodyRow]:
    """Rows of all scenes, which share one stage, for every variant (default: all of `variants`)."""
    tell, spec = progress or (lambda fraction, text="": None), load_stage(scenes[0].stage.name)
    own_bodies, rows = load_bodies(spec), []
    slices = scenes[0].stage.slices
    own = {scene.name: _run(scene, own_bodies, Variant("own", None, slices, ROLLS), h) for scene in scenes}
    chosen = variants(spec, slices) if chosen is None else chosen
    for k, variant in enumerate(chosen):
        tell(k / len(chosen), variant.name)
        started, bodies = clock.process_time(), own_bodies
        if variant.gears:
            changed = rewritten(spec, gears=variant.gears)
            bodies = [reduce_body(changed, gear.name) for gear in variant.gears]
        cpu = clock.process_time() - started if variant.gears else 0.0
        rows += [_row(scene, variant, own[scene.name], bodies, (h, cpu)) for scene in scenes]
    return rows


def _run(scene: SceneSpec, bodies: Sequence[Any], variant: Variant, h: float) -> Run:
    changes: dict[str, Any] = {}
    if variant.gears:
        spec = load_stage(scene.stage.name)
        contact = spec.written.contact.model_copy(update={"damping": same_loss(spec, load_bodies(spec), bodies)})
        changes = {"gears": variant.gears, "contact": contact}
    model = models_for(scene, bodies, variant.rolls, **changes)
    return measure(scene, model, Point("full", h=h, slices=variant.slices))


def _row(scene: SceneSpec, variant: Variant, own: Run, bodies: Sequence[Any], cost: tuple[float, float]) -> BodyRow:
    run = _run(scene, bodies, variant, cost[0])
    e, dof = errors(own.signals, run.signals), "/".join(str(body.how.mesh["dof_sector"]) for body in bodies)
    head = (scene.name, variant.name, dof, run.n_dyn, variant.slices, variant.rolls)
    return BodyRow(*head, e.te, e.te_mean, e.force, e.bearing, cost[1])


def write_bodies_chart(rows: Sequence[BodyRow], path: Path) -> list[Path]:
    """Distance of level full to refined bodies as bars, SVG and PNG beside each other; rows: of `body_rows`."""
    refined, scenes = list(dict.fromkeys(r.refined for r in rows)), list(dict.fromkeys(r.scene for r in rows))
    width = 0.8 / len(scenes)
    with styled(), rc_context({"svg.hashsalt": "bodies"}):
        figure, axes = panels((1.7,) * len(QUANTITIES))
        for name, panel in zip(QUANTITIES, axes, strict=True):
            for k, scene in enumerate(scenes):
                found = {r.refined: 100 * getattr(r, f"{name}_error") for r in rows if r.scene == scene}
                place = [i + width * (k - (len(scenes) - 1) / 2) for i, text in enumerate(refined) if text in found]
                panel.bar(place, [found[text] for text in refined if text in found], width, label=scene)
            panel.set_yscale("log")
            panel.yaxis.set_major_formatter("{x:g}")
            panel.set_ylabel(f"{QUANTITIES[name]}, %")
            panel.set_xticks(range(len(refined)), refined)
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return saved(figure, path)
