"""R10, continuity over the gears themselves: a vanishing helix angle of either hand is a spur gear, neighbouring
numbers of teeth have neighbouring results, and a wider search finds no other contacts."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inner import Inner
from kinds import COARSE, KINDS, assembled

from gearfmu.body import Body
from gearfmu.body.toothed import reduced_gear
from gearfmu.stage.run.te import loaded_te
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash

TORQUE, POSITIONS = 300.0, 8  # N·m, over a pitch
COARSEST = COARSE.model_copy(
    update={"modes": 12, "mesh": COARSE.mesh.model_copy(update={"flank": 2, "rim": 1, "width": 2})}
)
SMALL = 1e-3  # rad: the flank leans by 7 µm over half the width
# of the transmission error: slices of helical gears yield as their own patches, those of spur gears as the width
# functions say; 1.3e-4 on these bodies
HELIX = 5e-4
LEAN = 1e-5  # of it, from a tenth of the angle to all of it
TEETH = 0.01  # of the mean transmission error, second difference over one tooth
COUNTS = COARSEST.model_dump(exclude={"strip_half_width"}, exclude_unset=True)
BODIES: dict[str, Body] = {}  # by fingerprint


@cache
def transmission_error(teeth: int = 24, helix: float = 0.0, held: bool = False) -> np.ndarray:
    """(POSITIONS,) m of the FZG pair on coarse bodies: its wheel with other teeth at the distance that fits, or a helix
    angle (rad); held: bearings hold tilt and axial motion, as helical gears need."""
    spec = load_stage(KINDS["pair"].file)
    wheel, more = spec.written.gears[1], (teeth - 24) * spec.written.pair.normal_module
    changes: dict[str, Any] = {
        "pair.helix_angle": helix,
        "pair.center_distance": spec.written.pair.center_distance + 0.5 * more,
        "gears.wheel.teeth": teeth,
        "gears.wheel.tip_diameter": wheel.tip_diameter + more,
        "gears.wheel.bore_diameter": wheel.bore_diameter + more,
    }
    for gear in ("pinion", "wheel"):
        changes |= {f"gears.{gear}.body.{field}": number for field, number in COUNTS.items()}
        changes |= {f"gears.{gear}.bearing.axial": 1e9, f"gears.{gear}.bearing.tilt": 1e7} if held else {}
    stage = load_stage(KINDS["pair"].file, changes)
    for gear in stage.gears:
        if (known := expected_hash(stage, gear.name)) not in BODIES:
            BODIES[known] = reduced_gear(gear)
    found = {gear.name: BODIES[expected_hash(stage, gear.name)] for gear in stage.gears}
    return loaded_te(assembled(stage, found), [TORQUE], POSITIONS).te[0]


def test_a_vanishing_helix_angle_of_either_hand_is_a_spur_gear() -> None:
    """Spur gears take a way of their own: half of the slices, no tilt, one gap for all. What is left between both ways
    is a step, not a growth with the angle."""
    spur, left, right = (transmission_error(helix=angle, held=True) for angle in (0.0, -SMALL, SMALL))
    planar = transmission_error()
    assert np.allclose(left, right, rtol=1e-6, atol=1e-12), "hands are mirror images"
    for other in (left, right, planar):
        assert np.abs(other - spur).max() < HELIX * np.abs(spur).max()
    nearer = transmission_error(helix=SMALL / 10, held=True)
    assert np.abs(nearer - right).max() < LEAN * np.abs(spur).max()


@pytest.mark.full
def test_neighbouring_numbers_of_teeth_have_neighbouring_results() -> None:
    mean = np.array([transmission_error(teeth=z).mean() for z in range(22, 28)])
    assert np.all(np.diff(mean) != 0.0)
    assert np.abs(np.diff(mean, 2)).max() < TEETH * mean.mean(), mean


@pytest.mark.parametrize("name", ["pair", "internal"])
def test_a_wider_search_finds_the_same_contacts(inner_library: Path, name: str) -> None:
    """Those within the narrower distance, with the same gaps and rows to the last bit."""
    model = KINDS[name].model()
    inner = Inner(inner_library, model.blob, {"level": 0.0})
    for turned in np.linspace(0.0, 0.3, 7):
        pose = np.array([0.0, 0.0, turned, 0.0, 0.0, -turned * ratio_of(name)])
        wide = {(p.flank, p.tooth): p for p in inner.places(pose, 1e-3)}
        narrow = {(p.flank, p.tooth): p for p in inner.places(pose, 2e-4)}
        assert narrow.keys() == {key for key, p in wide.items() if p.gap < 2e-4}
        for key, p in narrow.items():
            assert p.gap == wide[key].gap and np.array_equal(p.gradient, wide[key].gradient)


def ratio_of(name: str) -> float:
    a, b = KINDS[name].stage.gears
    return (-1.0 if KINDS[name].stage.internal(KINDS[name].stage.engagements[0]) else 1.0) * a.teeth / b.teeth
