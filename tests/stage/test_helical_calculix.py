"""Helical pairs beside an independent finite-element program: CalculiX's columns of
evidence/peers/calculix/helical.csv, our side computed here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evidence.peers.calculix import helical
from evidence.peers.calculix.positions import read

pytestmark = pytest.mark.full  # four reductions


@pytest.mark.parametrize("helix", [20, 30])
def test_te_within_2_5_percent_peak_to_peak_10_and_layer_loads_6(
    helix: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Axes parallel and tilted. Layer loads of the largest one, also where lines of contact end inside the width; peak
    to peak where all positions of a pitch are there."""
    bodies = helical.bodies(tmp_path_factory.mktemp("helical"), helix)
    loads: dict[tuple[str, float], list[tuple[float, float]]] = {}
    for row in read(helical.HERE / "helical.csv"):
        case = helical.case_of(row)
        if case.helix != helix:
            continue
        ours, theirs = helical.ours(case, bodies), helical.shares(row)
        te, off = float(row["te_um"]), np.abs(ours.share - theirs).max() / theirs.max()
        print(f"{case.name}: te {te:.3f} and {1e6 * ours.te:.3f} µm, largest difference of a layer {off:.1%}")
        assert 1e6 * ours.te == pytest.approx(te, rel=0.025) and off < 0.06
        loads.setdefault((case.axes, case.torque), []).append((te, 1e6 * ours.te))
    assert {axes for axes, _ in loads} == {"parallel", "tilted"}
    whole: list[Any] = [np.ptp(curve, axis=0) for curve in loads.values() if len(curve) == helical.POSITIONS]
    assert whole and all(mine == pytest.approx(theirs, rel=0.1) for theirs, mine in whole)
