"""What a scene's drive asks of a stage holds for the stage that has it, whichever table the scene has."""

from __future__ import annotations

import pytest

from gearfmu.cosim.drives import drive_of, in_drivetrain, with_shafts
from gearfmu.spec.forms.expand import as_general
from gearfmu.spec.forms.turning import shafts_of
from gearfmu.spec.scene import load_scene, shipped_scenes
from gearfmu.spec.stage import load_stage


@pytest.mark.parametrize("name", shipped_scenes())
def test_a_stage_with_the_ports_that_a_drive_needs_has_the_same_drive(name):
    """Scenes are run on the stage that has their ports already, an FMU brings its own."""
    scene = load_scene(name)
    bare = as_general(load_stage(scene.stage.name))
    ready = as_general(in_drivetrain(scene, load_stage(scene.stage.name)))
    first, second = drive_of(scene, bare), drive_of(scene, ready)
    assert first.ports == second.ports and first.ports
    assert first.start() == second.start() and first.silent == second.silent
    for port, wanted in first.ports.items():
        assert (ready.ports[port].kind, ready.ports[port].chain) == (wanted.kind, wanted.chain)
    assert with_shafts(scene, shafts_of(ready), ready.ports) == with_shafts(
        with_shafts(scene, shafts_of(ready), ready.ports), shafts_of(ready), ready.ports
    )


def test_alternating_torques_and_clutches_of_a_drive_are_known():
    known = {name: load_scene(name) for name in ("planetary_backfire", "clutch_closure", "planetary_shift")}
    drives = {name: drive_of(s, as_general(load_stage(s.stage.name))) for name, s in known.items()}
    assert drives["planetary_backfire"].frequencies == (300.0,) and not drives["planetary_backfire"].watched
    assert drives["clutch_closure"].watched == () and drives["clutch_closure"].signals  # its clutch is in the stage
    assert set(drives["planetary_shift"].watched) == set(known["planetary_shift"].drivetrain.clutches)
