"""A planetary set with a ring of 61 teeth, which no number of mounts divides, from its reduction to motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.body.bodies import reduce_body
from gearfmu.stage import Steady, assemble, simulate
from gearfmu.stage.run.te import loaded_te
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.proposals.numbers import Wish, new_from_numbers
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

COARSE = {"modes": 24, "roll_points": 8, "width_functions": 3}


@pytest.mark.full
def test_a_set_with_61_teeth_in_its_ring_is_reduced_and_moves(tmp_path: Path) -> None:
    spec = load_stage(new_from_numbers("mine", Wish((19, 21, 61), 2.5e-3, 20e-3, planets=4), tmp_path))
    mesh = MeshSpec(flank=4, thickness=1, root=2, rim=2, width=2)
    gears = {
        gear.name: gear.model_copy(update={"body": gear.body.model_copy(update={**COARSE, "mesh": mesh})})
        for gear in spec.written.gears
    }
    plate = spec.written.carrier.model_copy(
        update={"mesh": spec.written.carrier.mesh.model_copy(update={"scale": 0.4})}
    )
    spec = rewritten(spec, **gears, carrier=plate)
    bodies = [reduce_body(spec, name) for name in (*gears, "carrier")]
    model = assemble(spec, bodies)
    shares = loaded_te(model, [300.0], 2).sharing
    assert shares == pytest.approx(np.ones(shares.shape), abs=0.05)
    model = model.driven_by_springs()
    trace = simulate(model, Steady(model, 40.0, 300.0), 1e-3, 20e-6, {"level": 1.0})
    assert trace.meta["outcome"] == "completed" and abs(trace["sun_planet1.force_mean"][-1]) > 100
