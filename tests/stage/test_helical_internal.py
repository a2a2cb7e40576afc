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
from gearfmu.geometry import GearGeometry
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import mesh_shape
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import BodySpec, MeshSpec

HELD = {"effect.bearings": 0.0}  # axes

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


@pytest.mark.full
@pytest.mark.parametrize("torque", [TORQUE, -TORQUE])
def test_all_forces_and_moments_of_pinion_and_ring_balance(torque: float) -> None:
    """The ring's axis is the stage's origin, the pinion stands on +x. Axial force F_t tan β; a right-handed pinion that
    drives is pushed towards +z, as in an external pair, and its ring away from it."""
    kernel = model_at(WHOLE).kernel(**{"level": 1.0, "effect.tip_contact": 0.0})
    kernel.set("pinion.tau", torque)
    kernel.initialize()
    names = ("pinion", "ring")
    force, moment = (
        np.array([[kernel.get(f"bearing.{name}.{kind}{axis}") for axis in axes] for name in names])
        for kind, axes in (("f", "xyz"), ("m", "xy"))
    )
    shape = mesh_shape(stage_at(WHOLE), stage_at(WHOLE).engagements[0]).gears[0]
    assert isinstance(shape, GearGeometry)
    axial = torque / shape.r * math.tan(WHOLE)
    assert force[0, 2] == pytest.approx(axial, rel=1e-6)
    assert np.abs(force.sum(axis=0)).max() < 1e-6 * abs(axial)
    place = np.array([[kernel.get(f"{name}.gear.{axis}") for axis in "xyz"] for name in names])
    place[0, 0] += 45e-3
    about_origin = moment.sum(axis=0) + np.cross(place, force)[:, :2].sum(axis=0)
    print(force, moment, axial, about_origin)
    assert np.abs(about_origin).max() < 1e-4 * np.abs(force).max() * 45e-3  # force times deflection of the bore


@pytest.mark.full
def test_a_vanishing_helix_is_the_spur_pair() -> None:
    """But for the slices, which yield as patches of their own in helical gears and as width functions in spur ones:
    2.1e-4 found, as for an external pair (tests/relations/test_gears_alike.py)."""
    nearly, small, spur = (loaded_te(model_at(beta), [TORQUE], 8).te for beta in (1e-7, 1e-5, 0.0))
    assert np.abs(nearly - spur).max() < 5e-4 * np.abs(spur).max()
    assert np.abs(nearly - small).max() < 1e-6 * np.abs(spur).max(), "no growth with the angle but its own"


@pytest.mark.full
def test_transmission_error_of_an_overlap_ratio_of_one_is_smooth() -> None:
    """Against the spur pair of the same section, over a pitch and from one position to the next; ten slices remain."""
    positions = 24
    helical, spur = (loaded_te(model_at(beta), [TORQUE], positions, **HELD).te[0] for beta in (WHOLE, 0.0))
    steps = [np.abs(np.diff(te)).max() for te in (helical, spur)]
    print(np.ptp(helical), np.ptp(spur), steps)
    assert np.ptp(helical) < 0.15 * np.ptp(spur)
    assert steps[0] < 0.15 * steps[1]


def test_a_ring_of_the_other_hand_is_refused(tmp_path: Path) -> None:
    text = STAGE.read_text(encoding="utf-8")
    twisted = tmp_path / "stage.toml"
    twisted.write_text(
        text.replace("profile_shift = 0.0", 'profile_shift = 0.0\nhelix_angle = "20 deg"'), encoding="utf-8"
    )
    with pytest.raises(SpecError, match="bodies.ring.helix_angle.*one hand: write 20 deg"):
        load_stage(twisted)
