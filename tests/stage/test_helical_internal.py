"""A helical pinion in a helical ring on fixed axes: the path of contact of its section, hands that do not fit.
What its teeth carry: test_helical_set.py."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gearfmu.errors import SpecError
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage

STAGE = Path(__file__).parents[1] / "reference" / "internal_pair" / "stage.toml"
WIDTH, MODULE, ANGLE = 20e-3, 2.5e-3, math.radians(20)  # m, m, rad: of the section
WHOLE = math.atan(math.pi * MODULE / WIDTH)  # rad: overlap ratio one


def stage_at(beta: float) -> Stage:
    """The spur pair with a helix of the same transverse section."""
    spur, cosine = load_stage(STAGE), math.cos(beta)
    angles = {"normal_module": MODULE * cosine, "pressure_angle": math.atan(math.tan(ANGLE) * cosine)}
    bodies = {name: gear.model_copy(update=angles | {"helix_angle": beta}) for name, gear in spur.bodies.items()}
    return spur.model_copy(update={"bodies": bodies})


def test_a_helix_of_the_same_transverse_section_has_the_same_path_of_contact() -> None:
    meshes = [mesh_shape(stage, stage.engagements[0]) for stage in (stage_at(WHOLE), stage_at(0.0))]
    helical, spur = (mesh.path for mesh in meshes)
    assert helical == pytest.approx(spur, rel=1e-12)
    assert meshes[0].base_pitch == pytest.approx(meshes[1].base_pitch, rel=1e-12)
    assert meshes[0].gears[0].overlap_ratio(WIDTH) == pytest.approx(1.0, rel=1e-12)


def test_a_ring_of_the_other_hand_is_refused(tmp_path: Path) -> None:
    text = STAGE.read_text(encoding="utf-8")
    twisted = tmp_path / "stage.toml"
    twisted.write_text(
        text.replace("profile_shift = 0.0", 'profile_shift = 0.0\nhelix_angle = "20 deg"'), encoding="utf-8"
    )
    with pytest.raises(SpecError, match="bodies.ring.helix_angle.*one hand: write 20 deg"):
        load_stage(twisted)
