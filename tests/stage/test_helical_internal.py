"""A helical pinion in a helical ring on fixed axes, of finite elements: balance of all forces and moments, the spur
pair as the limit, transmission error over the overlap, hands that do not fit."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import Body
from gearfmu.body.toothed import reduced_gear
from gearfmu.errors import SpecError
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import BodySpec, MeshSpec

STAGE = Path(__file__).parents[2] / "evidence" / "peers" / "calculix" / "internal" / "stage.toml"
TORQUE, WIDTH, MODULE, ANGLE = 100.0, 20e-3, 2.5e-3, math.radians(20)  # N·m on the pinion; m, m, rad: of the section
WHOLE = math.atan(math.pi * MODULE / WIDTH)  # rad: overlap ratio one
COARSE = BodySpec(
    strip_half_width=4.5e-4, modes=24, roll_points=8, width_functions=6,
    mesh=MeshSpec(flank=5, thickness=1, root=2, rim=2, width=6),
)  # fmt: skip


def stage_at(beta: float) -> Stage:
    """The spur pair with a helix of the same transverse section (but for the rack's rounding), both gears held along
    the axis and against tilting."""
    spur, cosine = load_stage(STAGE), math.cos(beta)
    assert isinstance(spur, Stage)
    angles = {"normal_module": MODULE * cosine, "pressure_angle": math.atan(math.tan(ANGLE) * cosine)}
    common = angles | {"helix_angle": beta, "body": COARSE}
    pinion, ring = spur.bodies["pinion"], spur.bodies["ring"]
    rack = pinion.rack.model_copy(update={"dedendum": 1.25 / cosine, "fillet_radius": 0.38 / cosine})
    bodies = {
        "pinion": pinion.model_copy(update=common | {"rack": rack}),
        "ring": ring.model_copy(update=common | {"dedendum": 1.25 / cosine, "fillet_radius": 0.3 / cosine}),
    }
    held = tuple(s.model_copy(update={"axial": 2e8, "tilt": 1e8}) for s in spur.supports)
    return spur.model_copy(update={"bodies": bodies, "supports": held, "slices": 10})


@lru_cache(maxsize=4)
def bodies_at(beta: float) -> tuple[Body, ...]:
    return tuple(reduced_gear(gear) for gear in stage_at(beta).gears)


def model_at(beta: float) -> StageModel:
    return assemble(stage_at(beta), bodies_at(beta))


def test_a_helix_of_the_same_transverse_section_has_the_same_path_of_contact() -> None:
    meshes = [mesh_shape(stage, stage.engagements[0]) for stage in (stage_at(WHOLE), stage_at(0.0))]
    helical, spur = (mesh.path for mesh in meshes)
    assert helical == pytest.approx(spur, rel=1e-12)
    assert meshes[0].base_pitch == pytest.approx(meshes[1].base_pitch, rel=1e-12)
    assert meshes[0].gears[0].overlap_ratio(WIDTH) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.full
def test_twice_the_parts_of_its_lines_of_contact() -> None:
    """Seven and fourteen: every order up to the eighth by 1 dB or 7 nm, margin 1.3."""
    seven, fourteen = (loaded_te(model_at(WHOLE), [TORQUE], 48, slices=n).harmonics(8)[0] for n in (7.0, 14.0))
    change = np.abs(20 * np.log10(seven / fourteen))
    assert np.abs(seven - fourteen)[change > 1.0].max(initial=0.0) < 7e-9


def test_a_ring_of_the_other_hand_is_refused(tmp_path: Path) -> None:
    text = STAGE.read_text(encoding="utf-8")
    twisted = tmp_path / "stage.toml"
    twisted.write_text(
        text.replace("profile_shift = 0.0", 'profile_shift = 0.0\nhelix_angle = "20 deg"'), encoding="utf-8"
    )
    with pytest.raises(SpecError, match="bodies.ring.helix_angle.*one hand: write 20 deg"):
        load_stage(twisted)
