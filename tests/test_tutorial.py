"""The tutorial's pair carries the load of the scene that it is run in."""

from __future__ import annotations

import re
from pathlib import Path

from gearfmu.scenefile.scene import load_scene
from gearfmu.stagefile.stage import load_stage

PAGE = Path(__file__).parents[1] / "docs" / "tutorial.md"


def test_scenes_load_the_tutorials_pair_within_its_torque_max() -> None:
    """Fault: a pair of 80 N·m run at the scene's 302 N·m. The page states both numbers."""
    page = PAGE.read_text(encoding="utf-8")
    (like, scene) = (re.search(pattern, page) for pattern in (r"new my_pair --like (\S+)", r"gearfmu run (\S+) --fmu"))
    assert like is not None and scene is not None
    most, rig = load_stage(like[1]).written.torque_max, load_scene(scene[1]).test_rig
    assert rig is not None and abs(rig.torque) <= most
    assert f"the scene puts {rig.torque:g} N·m on the pinion" in page and f"{most:g} N·m here" in page
    asked = re.search(r'--fmu my_pair.fmu --torque "(\d+) N\*m"', page)
    assert asked is not None and float(asked[1]) <= most
