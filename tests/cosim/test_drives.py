"""What a scene's drive asks of a stage holds for the stage that has it, whichever table the scene has."""

from __future__ import annotations

import pytest

from gearfmu.cosim.scene_run import drive_of, in_drivetrain
from gearfmu.scenefile.scene import load_scene, shipped_scenes
from gearfmu.stagefile.stage import load_stage


@pytest.mark.parametrize("name", shipped_scenes())
def test_a_stage_with_the_ports_that_a_drive_needs_has_the_same_drive(name):
    """Scenes are run on the stage that has their ports already, an FMU brings its own."""
    scene = load_scene(name)
    bare = load_stage(scene.stage.name)
    ready = in_drivetrain(scene, load_stage(scene.stage.name))
    first, second = drive_of(scene, bare), drive_of(scene, ready)
    assert first.ports == second.ports and first.ports
    assert first.start() == second.start() and first.silent == second.silent
    for port, wanted in first.ports.items():
        assert (ready.ports[port].kind, ready.ports[port].chain) == (wanted.kind, wanted.chain)
    if second.with_shafts is not None:
        own = {name: port.model_copy(update={"k": 2 * port.k}) for name, port in ready.ports.items() if port.k}
        other = drive_of(second.with_shafts({**ready.ports, **own}), ready)
        assert {name: port.k for name, port in other.ports.items()} == {name: own[name].k for name in other.ports}


def test_alternating_torques_and_clutches_of_a_drive_are_known():
    known = {name: load_scene(name) for name in ("planetary_backfire", "clutch_closure", "planetary_shift")}
    drives = {name: drive_of(s, load_stage(s.stage.name)) for name, s in known.items()}
    assert drives["planetary_backfire"].frequencies == (300.0,) and not drives["planetary_backfire"].watched
    assert drives["clutch_closure"].watched == () and drives["clutch_closure"].signals  # its clutch is in the stage
    assert set(drives["planetary_shift"].watched) == set(known["planetary_shift"].drivetrain.clutches)
