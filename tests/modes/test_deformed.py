"""Gears deformed by modal amplitudes: against the pictures that the finite elements made, turned, and as .vtu."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import scipy.sparse as sp
import small_gear

from gearfmu.body import load_bodies
from gearfmu.body.body import turn_sectors
from gearfmu.body.pictures import DRAWN, outline, sector_shapes
from gearfmu.femesh.sector import gear_sector
from gearfmu.modes.deformed import DeformedGear, deformed_gear
from gearfmu.modes.vtu import write_series
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.stage.run.deformation import DeformationError, GearMotion
from gearfmu.stagefile.stage import load_stage


@pytest.fixture(scope="module", params=["sun", "ring"])
def body(request: pytest.FixtureRequest) -> Any:
    return load_bodies(load_stage("planetary54"))[("sun", "planet", "ring").index(request.param)]


def moved(body: Any, amplitudes: dict[int, float], rigid: tuple[float, ...] = (0.0,) * 6, **at: float) -> DeformedGear:
    """One frame; amplitudes in kg^½·m by number of the mode, from 0."""
    modes, values = np.array(list(amplitudes), int), np.array([list(amplitudes.values())], float)
    motion = GearMotion(body.how.hash, modes + 1, values / math.sqrt(body.total_mass), np.array([rigid]))
    return deformed_gear("gear", body, motion, **at)


def test_one_mode_is_the_shape_that_the_finite_elements_found() -> None:
    """Unfolded here over all teeth from complex sector shapes: displacement e^(iν2πj/z) φ on sector j, real part."""
    sector, drawn = small_gear.coarse(), gear_sector(small_gear.GEAR, small_gear.WIDTH, DRAWN)
    surface, z = outline(drawn, sector.mesh.nodes), small_gear.GEAR.z
    modes = elastic_modes(sector, 40, sample=surface.sample)
    teeth = SimpleNamespace(teeth=z, diameter=modes.nodal_diameter, part=modes.part)
    picture = SimpleNamespace(shapes=sector_shapes(surface, modes))
    body = SimpleNamespace(
        how=SimpleNamespace(hash="0" * 64), total_mass=1.0, modes=len(modes.frequency), toothed=teeth, picture=picture
    )
    everywhere = elastic_modes(sector, 40, sample=sp.eye_array(len(sector.mesh.nodes), format="csr")).surface
    assert everywhere is not None and len(set(modes.nodal_diameter)) > 2
    for index in np.flatnonzero(modes.part != 2):
        shape = everywhere[index] + 1j * everywhere[index + 1] if modes.part[index] else everywhere[index]
        turn = np.exp(2j * np.pi * modes.nodal_diameter[index] * np.arange(z) / z)
        own = np.multiply.outer(turn, surface.sample @ shape).real
        expected = turn_sectors(own).reshape(-1, 3)
        found = moved(body, {index: 1.0}).elastic(0)
        assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_a_pair_turns_a_tooth_on(body: Any) -> None:
    """Amplitudes cos ν2π/z and −sin… of a pair: the first member's pattern, one tooth further."""
    first = int(np.flatnonzero(body.flank.part == 1)[3])
    angle = 2 * math.pi * body.flank.diameter[first] / body.flank.teeth
    turned = moved(body, {first: math.cos(angle), first + 1: math.sin(angle)}).elastic(0)
    back = moved(body, {first: 1.0}, angle=2 * math.pi / body.flank.teeth).elastic(0)
    shifted = np.roll(back.reshape(body.flank.teeth, -1, 3), 1, axis=0).reshape(-1, 3)
    assert np.abs(turned - shifted).max() < 1e-6 * np.abs(turned).max()


def test_rigid_motion_and_the_angle_of_the_gear(body: Any) -> None:
    """Both turn with the gear: lengths and axial parts stay, and a rotation about the axis moves points by r·θ."""
    amplitudes, rigid = {0: 1e-6, 5: 2e-6}, (1e-6, 0.0, 3e-6, 0.0, 0.0, 1e-4)
    here, there = moved(body, amplitudes, rigid), moved(body, amplitudes, rigid, angle=0.7)
    for kind in ("elastic", "rigid"):
        own, turned = getattr(here, kind)(0), getattr(there, kind)(0)
        assert np.allclose(np.linalg.norm(own, axis=1), np.linalg.norm(turned, axis=1), rtol=1e-9, atol=0)
        assert np.allclose(own[:, 2], turned[:, 2], atol=1e-18) and not np.allclose(own[:, 0], turned[:, 0])
    only = moved(body, {0: 0.0}, (0.0, 0.0, 0.0, 0.0, 0.0, 1e-4))
    assert np.allclose(np.linalg.norm(only.rigid(0), axis=1), 1e-4 * np.hypot(*only.surface[0][:, :2].T), atol=0)


def test_another_body_and_one_without_surface_are_refused(body: Any) -> None:
    motion = moved(body, {0: 1.0}).motion
    with pytest.raises(DeformationError, match="another reduced body"):
        deformed_gear("ring", replace(body, how=replace(body.how, hash="0" * 64)), motion)
    with pytest.raises(DeformationError, match="gearfmu reduce STAGE --force"):
        deformed_gear("ring", replace(body, picture=replace(body.picture, shapes=None)), motion)


def test_a_series_reads_back(body: Any, tmp_path: Path) -> None:
    gear = moved(body, {0: 1e-6, 1: 2e-6}, (0.0, 0.0, 1e-6, 0.0, 0.0, 0.0))
    twice = replace(gear, motion=replace(gear.motion, amplitude=np.vstack([gear.motion.amplitude] * 2),
                                         motion=np.vstack([gear.motion.motion] * 2)))  # fmt: skip
    path = write_series(twice, [0.033, 0.066], tmp_path)
    entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    assert [(e.get("timestep"), e.get("file")) for e in entries] == [
        ("0.033", "gear_0000.vtu"),
        ("0.066", "gear_0001.vtu"),
    ]
    found = meshio.read(tmp_path / "gear_0001.vtu")
    assert len(found.points) == len(gear.surface[0]) and len(found.cells[0].data) == len(gear.surface[1])
    assert np.allclose(found.point_data["elastic"], gear.elastic(0), atol=1e-12)
    assert np.allclose(found.point_data["displacement"][:, 2] - found.point_data["elastic"][:, 2], 1e-6, atol=1e-12)
