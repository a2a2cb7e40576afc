"""Pitch errors by hand: a tooth out of its place by F_pi moves its flanks by F_pi cos α along their normals, towards
the other gear on one side and away from it on the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfmu.body import Body
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stored import expected_hash

LIGHT, LOAD, POSITIONS = 1e-3, 302.0, 64
DEVIATION = 50e-6
ALONG_NORMAL = DEVIATION * math.cos(math.radians(20.0))
TEETH = (16, 24)


def with_deviations(spec: Stage, *tables: dict[int, float]) -> Stage:
    """The stage with index deviations (tooth → m) of pinion and wheel."""
    pairs = zip(spec.written.gears, tables, strict=True)
    gears = tuple(gear.model_copy(update={"index_deviation": table}) for gear, table in pairs)
    return rewritten(spec, gears=gears)


def light_te(spec: Stage, bodies: list[Body], *tables: dict[int, float], torque: float = LIGHT) -> np.ndarray:
    return loaded_te(assemble(with_deviations(spec, *tables), bodies), [torque], POSITIONS).te[0]


@pytest.mark.parametrize("gear", [0, 1])
def test_a_protruding_tooth_holds_the_pinion_back_while_it_is_in_mesh(
    gear: int, spec: Stage, bodies: list[Body]
) -> None:
    """Unloaded te is −F_pi cos α as long as tooth 0 is on its flank, 0 once only its neighbour is in mesh, and never
    below; in mesh for the contact ratio less the stretch at the other end where the neighbours have not come yet."""
    tables: list[dict[int, float]] = [{}, {}]
    tables[gear] = {0: DEVIATION}
    te = light_te(spec, bodies, *tables)
    held, free = np.abs(te + ALONG_NORMAL) < 2e-9, np.abs(te) < 2e-9
    assert held.sum() > 0.4 * POSITIONS and free.sum() > 0.3 * POSITIONS
    assert np.all(te > -ALONG_NORMAL - 2e-9) and np.all(te < 2e-9)
    assert held[0] and free[-1] and np.all(np.diff(held.astype(int)) <= 0) and np.all(np.diff(free.astype(int)) >= 0)


def test_coast_flanks_see_the_other_side(spec: Stage, bodies: list[Body], pair: PairGeometry) -> None:
    """The flank that leads on the drive side trails on the coast side: what protrudes there has a negative sign."""
    te = light_te(spec, bodies, {0: -DEVIATION}, {}, torque=-LIGHT)
    held = np.abs(te + pair.normal_backlash - ALONG_NORMAL) < 5e-9
    assert held.mean() > 0.4 and np.all(te < -pair.normal_backlash + ALONG_NORMAL + 5e-9)
    receding = light_te(spec, bodies, {0: DEVIATION}, {}, torque=-LIGHT)
    assert np.all(receding < -pair.normal_backlash + 5e-9)


def test_all_teeth_out_by_the_same_are_a_turned_gear(spec: Stage, bodies: list[Body], plain: StageModel) -> None:
    """But for the elastic rows, which stay with the teeth's nominal places and directions (F_pi/r = 1.4 mrad)."""
    tables = ({k: DEVIATION for k in range(TEETH[0])}, {})
    te = loaded_te(assemble(with_deviations(spec, *tables), bodies), [LOAD], 16).te[0]
    assert np.allclose(te + ALONG_NORMAL, loaded_te(plain, [LOAD], 16).te[0], rtol=0, atol=1e-7)


def test_bodies_and_models_without_deviations_are_what_they_were(
    spec: Stage, bodies: list[Body], plain: StageModel
) -> None:
    changed = with_deviations(spec, {3: DEVIATION}, {})
    assert [expected_hash(changed, name) for name in ("pinion", "wheel")] == [
        expected_hash(spec, name) for name in ("pinion", "wheel")
    ]
    assert assemble(changed, bodies).hash != plain.hash
    none, own = (read_blob(m.blob) for m in (assemble(with_deviations(spec, {3: 0.0}, {}), bodies), plain))
    assert all(np.array_equal(none[name], own[name]) for name in own if name not in ("made_of", "guid"))
