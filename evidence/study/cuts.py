"""Error and price over the cut frequency: where the levels `fast` and `standard` should be cut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gearfmu.body import load_bodies
from gearfmu.scenefile.scene import SceneSpec
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import LevelSpec
from gearfmu.study.bench import Point, default_step, measure, models_for, paired_price
from gearfmu.study.ladder import base_point, fitting
from gearfmu.study.norm import errors
from gearfmu.study.reference import Reference, make_reference

CUTS = (15e3, 35e3, 50e3, 70e3, 85e3, 100e3, 120e3, 150e3, 200e3)  # Hz
STEPS = (10e-6, 6.7e-6, 5e-6, 2.5e-6)  # s


@dataclass(frozen=True)
class CutRow:
    """A model with the modes below about cut_Hz dynamic (the kernel moves the cut into a gap of the frequencies), at
    one step; h_default_s: the step the kernel would choose. Errors and prices as in a study's rows."""

    scene: str
    cut_Hz: float
    n_dyn: int
    h_default_s: float
    h_s: float
    te_error: float
    te_mean_error: float
    force_error: float
    bearing_error: float
    realtime_factor: float
    cpu_ratio: float


def cut_rows(
    scene: SceneSpec, quick: bool = False, progress: Callable[..., None] | None = None
) -> tuple[list[CutRow], Reference]:
    """Rows over CUTS and STEPS against the scene's reference; a cut that leaves the number of modes as it was is left
    out. Raises what a run of the scene raises."""
    tell, bodies = progress or (lambda fraction, text="": None), load_bodies(load_stage(scene.stage.name))
    model, slices = models_for(scene, bodies), scene.stage.slices
    base, reference = measure(scene, model, base_point(scene)), make_reference(scene, model, slices, quick)
    rows: list[CutRow] = []
    cuts, steps = (CUTS[::4], STEPS[::2]) if quick else (CUTS, STEPS)
    for k, cut in enumerate(cuts):
        cut_model = models_for(scene, bodies, levels=LevelSpec(fast_cut=cut, standard_cut=cut))
        default = default_step(scene, cut_model, Point("fast", slices=slices))
        wanted = {f"{h:.6g}": h for h in (default, *(fitting(scene.coupling.step, h) for h in steps))}
        for h in sorted(wanted.values(), reverse=True):
            tell(k / len(cuts), f"cut {cut / 1e3:g} kHz, {1e6 * h:.3g} µs")
            run = measure(scene, cut_model, Point("fast", h=h, slices=slices))
            if any(row.n_dyn == run.n_dyn and row.cut_Hz < cut for row in rows):
                break
            e, price = errors(run.signals, reference.signals), paired_price(run, base)
            found = (e.te, e.te_mean, e.force, e.bearing, price.realtime_factor, price.cpu_ratio)
            rows.append(CutRow(scene.name, cut, run.n_dyn, default, run.h, *found))
    return rows, reference
