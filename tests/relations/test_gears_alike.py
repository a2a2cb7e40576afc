"""R10, continuity over the gears themselves: a vanishing helix angle of either hand is a spur gear, neighbouring
numbers of teeth have neighbouring results, and a wider search finds no other contacts."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from inner import Inner
from kinds import COARSE, KINDS, assembled

from gearfmu.body import Body
from gearfmu.body.toothed import reduced_gear
from gearfmu.stage.run.te import loaded_te
from gearfmu.stagefile.tables.connections import SupportSpec

TORQUE, POSITIONS = 300.0, 8  # N·m, over a pitch
COARSEST = COARSE.model_copy(
    update={"modes": 12, "mesh": COARSE.mesh.model_copy(update={"flank": 2, "rim": 1, "width": 2})}
)
SMALL = 1e-3  # rad: the flank leans by 7 µm over half the width
HELIX = (
    5e-4  # of the transmission error: slices of helical gears yield as their own patches, those of spur gears as the
)
# width functions say; 1.3e-4 on these bodies
LEAN = 1e-5  # of it, from a tenth of the angle to all of it
TEETH = 0.01  # of the mean transmission error, second difference over one tooth
BODIES: dict[tuple[str, int, float], Body] = {}  # by gear, number of teeth of the wheel, helix angle


@cache
def transmission_error(teeth: int = 24, helix: float = 0.0, held: bool = False) -> np.ndarray:
    """(POSITIONS,) m of the FZG pair on coarse bodies: its wheel with other teeth at the distance that fits, or a helix
    angle (rad); held: bearings hold tilt and axial motion, as helical gears need."""
    stage = KINDS["pair"].stage
    pinion, wheel = stage.gears
    more = (teeth - wheel.teeth) * wheel.normal_module
    changed = {
        pinion.name: pinion.model_copy(update={"body": COARSEST, "helix_angle": helix}),
        wheel.name: wheel.model_copy(
            update={
                "body": COARSEST,
                "helix_angle": -helix,
                "teeth": teeth,
                "tip_diameter": wheel.tip_diameter + more,
                "bore_diameter": wheel.bore_diameter + more,
            }
        ),
    }
    axes = {name: rotor.axis for name, rotor in stage.rotors.items()}
    axes[stage.rotor_of(wheel.name)] = (axes[stage.rotor_of(wheel.name)][0] + 0.5 * more, 0.0)
    rotors = {name: rotor.model_copy(update={"axis": axes[name]}) for name, rotor in stage.rotors.items()}

    def support(old: SupportSpec) -> SupportSpec:
        return old.model_copy(update={"axial": 1e9, "tilt": 1e7}) if held else old

    other = stage.model_copy(
        update={"bodies": changed, "rotors": rotors, "supports": tuple(map(support, stage.supports))}
    )
    found = {gear.name: BODIES.get((gear.name, teeth, helix)) or reduced_gear(gear) for gear in other.gears}
    BODIES.update({(name, teeth, helix): body for name, body in found.items()})
    return loaded_te(assembled(other, found), [TORQUE], POSITIONS).te[0]


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
