"""Helical pairs beside an independent finite-element program: CalculiX's columns of
evidence/peers/calculix/helical.csv, our side computed here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evidence.peers.calculix import helical
from evidence.tables import read_rows
from gearfmu.body import Body
from gearfmu.stage import assemble
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of

pytestmark = pytest.mark.full  # four reductions


def error(case: helical.Case, bodies: list[Body], slices: int) -> float:
    """Of the kernel with bores held, m."""
    model = assemble(helical.stage(case.helix, case.axes), bodies)
    kernel = statics_of(model, **{"effect.bearings": 0.0, "slices": float(slices)})
    return kernel.transmission(-case.position / helical.POSITIONS * place_of(model, None).pitch, case.torque).te


@pytest.mark.parametrize("helix", [20, 30])
def test_te_within_2_5_percent_peak_to_peak_10_and_layer_loads_6(
    helix: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Axes parallel and tilted. Layer loads of the largest one, also where lines of contact end inside the width; peak
    to peak where all positions of a pitch are there, with five and seven slices within 15 %."""
    bodies = helical.bodies(tmp_path_factory.mktemp("helical"), helix)
    loads: dict[tuple[str, float], list[tuple[float, float]]] = {}
    for row in read_rows(helical.HERE / "helical.csv"):
        case = helical.case_of(row)
        if case.helix != helix:
            continue
        ours, theirs = helical.ours(case, bodies), helical.shares(row)
        te, off = float(row["te_um"]), np.abs(ours.share - theirs).max() / theirs.max()
        assert 1e6 * ours.te == pytest.approx(te, rel=0.025) and off < 0.06
        loads.setdefault((case.axes, case.torque), []).append((te, 1e6 * ours.te))
    assert {axes for axes, _ in loads} == {"parallel", "tilted"}
    whole: list[Any] = [np.ptp(curve, axis=0) for curve in loads.values() if len(curve) == helical.POSITIONS]
    assert whole and all(mine == pytest.approx(theirs, rel=0.1) for theirs, mine in whole)
    for axes, torque in (load for load, curve in loads.items() if len(curve) == helical.POSITIONS):
        cases = [helical.Case(helix, axes, torque, place) for place in range(helical.POSITIONS)]
        wanted = np.ptp([te for te, _ in loads[axes, torque]])
        for slices in (5, 7):
            mine = 1e6 * np.ptp([error(case, bodies, slices) for case in cases])
            assert mine == pytest.approx(wanted, rel=0.15)
