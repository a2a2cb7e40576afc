"""Mode shapes of bodies: one sector against the whole body, nodal diameters, energies, rigid couplings, mounts."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import scipy.sparse as sp
import small_gear
from blocks import free_body
from PIL import Image

from gearfmu.body import load_bodies
from gearfmu.body.body import turn_sectors
from gearfmu.body.pictures import DRAWN, outline, sector_shapes
from gearfmu.body.sector import body_sector
from gearfmu.errors import BodyError
from gearfmu.fem import hex20, surface
from gearfmu.fem.lanczos import lowest_modes
from gearfmu.femesh.mesh import FeMesh
from gearfmu.femesh.sector import gear_sector
from gearfmu.modes import BodyModes
from gearfmu.modes.bodies import as_stored, body_modes, mounted_ring_modes, whole_modes
from gearfmu.modes.cyclic import cyclic_modes
from gearfmu.modes.deformed import DeformedGear, deformed_gear
from gearfmu.modes.linear import StageModes
from gearfmu.modes.shapes import MOST, Mode, energy_shares, harmonic_shares
from gearfmu.modes.vtu import write_mode, write_series
from gearfmu.reduction.cyclic.modal import elastic_modes
from gearfmu.reduction.toothed import toothed_full_order
from gearfmu.report import modes as pictures
from gearfmu.report.campbell import Family, campbell_columns, crossings, loud, write_campbell
from gearfmu.stage.run.deformation import DeformationError, GearMotion
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import Material

COUNT = 10


def pinion() -> tuple[FeMesh, Material]:
    """One coarse sector of the FZG pinion."""
    spec = load_stage("fzg_c")
    gear = spec.gears[0]
    counts = gear.body.mesh.model_copy(update={"scale": 0.25})
    return gear_sector(gear_geometry(gear, spec.written.pair), gear.face_width, counts), gear.material


def set_body(name: str, scale: float) -> tuple[FeMesh, Material]:
    """One sector of a body of planetary54."""
    spec = load_stage("planetary54")
    return body_sector(spec, name, scale), getattr(spec.written, name).material


@lru_cache
def pinion_modes() -> BodyModes:
    mesh, material = pinion()
    return cyclic_modes("pinion", mesh, material, COUNT)


def frequencies(body: BodyModes) -> np.ndarray:
    """All of them, those of a pair twice."""
    return np.concatenate([[mode.frequency] * len(mode.numbers) for mode in body.modes])


@pytest.fixture(scope="module")
def whole() -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (Hz) and shapes (N, 3, k) of the whole pinion without any symmetry."""
    mesh, material = pinion()
    full = mesh.full()
    free = free_body(*hex20.assemble(full.nodes, full.elements, material), full.nodes, full.elements)
    squared, shapes = lowest_modes(free, COUNT + 2)
    return np.sqrt(squared) / (2 * np.pi), shapes.reshape(len(full.nodes), 3, -1)


def test_frequencies_and_shapes_are_those_of_the_whole_body_and_mass_normalised(whole) -> None:
    """The shapes of one frequency span the same space, by the same orthogonal turn everywhere on the surface."""
    mesh, _ = pinion()
    found = frequencies(pinion_modes())
    assert len(found) >= COUNT and np.allclose(found, whole[0][: len(found)], rtol=1e-7)
    used = np.unique(surface.boundary_faces(mesh.full().elements))
    body = pinion_modes()
    assert np.allclose(body.points, mesh.full().nodes[used])
    for mode in body.modes:
        theirs = whole[1][used][..., [n - 1 for n in mode.numbers]].reshape(-1, len(mode.numbers))
        mine = mode.shape.reshape(len(mode.numbers), -1).T
        turn, *_ = np.linalg.lstsq(theirs, mine, rcond=None)
        assert np.allclose(theirs @ turn, mine, atol=1e-4 * np.abs(mine).max())
        assert np.allclose(turn.T @ turn, np.eye(len(turn)), atol=1e-4)


def test_count_is_kept_and_pairs_stay_whole() -> None:
    mesh, material = pinion()
    for count, expected in ((1, 2), (5, 5)):
        body = cyclic_modes("pinion", mesh, material, count)
        numbers = [n for mode in body.modes for n in mode.numbers]
        assert numbers == list(range(1, expected + 1))
        assert np.allclose(frequencies(body), frequencies(pinion_modes())[:expected], rtol=1e-9)


def test_projection_around_the_axis_finds_the_nodal_diameters() -> None:
    body = pinion_modes()
    for mode in body.modes:
        shares = sum(harmonic_shares(body.points, shape) for shape in mode.shape) / len(mode.shape)
        assert np.argmax(shares) == mode.nodal_diameter and shares.max() > 0.8


def test_projection_of_known_fields() -> None:
    angle, z = (a.ravel() for a in np.meshgrid(2 * np.pi * np.arange(48) / 48, [-1.0, 1.0]))
    points = np.stack([np.cos(angle), np.sin(angle), z], axis=1)
    field = np.stack([0 * angle, 0 * angle, 3 * np.cos(2 * angle + 0.3) + np.sin(5 * angle)], axis=1)
    expected = np.zeros(MOST + 1)
    expected[[2, 5]] = 0.9, 0.1
    assert np.allclose(harmonic_shares(points, field), expected, atol=1e-12)


def test_names_and_energies_of_the_lowest_pinion_modes() -> None:
    """Disc bending with 2 nodal diameters comes first, then 2 lobes, then the umbrella (shipped mesh: the same)."""
    modes = pinion_modes().modes[:3]
    assert [(m.nodal_diameter, m.motion, m.name) for m in modes] == [
        (2, "out-of-plane", "disc bending"),
        (2, "in-plane", "2 lobes"),
        (0, "out-of-plane", "umbrella"),
    ]
    for mode in modes:
        assert mode.energy.sum() == pytest.approx(1) and np.argmax(mode.energy) == (0 if mode.parity > 0 else 2)


def test_energy_of_rigid_motions() -> None:
    mesh, material = pinion()
    full = mesh.full()
    mass = hex20.assemble(full.nodes, full.elements, material)[1][::3, ::3]
    turning = np.cross([0, 0, 1.0], full.nodes)
    assert np.allclose(energy_shares(full.nodes, mass, turning), [0, 1, 0], atol=1e-12)
    assert np.allclose(energy_shares(full.nodes, mass, np.eye(3)[[2] * len(full.nodes)]), [0, 0, 1], atol=1e-12)
    assert np.allclose(energy_shares(full.nodes, mass, np.eye(3)[[0] * len(full.nodes)]), [0.5, 0.5, 0], atol=1e-3)


def test_stored_frequencies_are_compared() -> None:
    body = pinion_modes()
    stored = frequencies(body)
    damping = np.linspace(0.01, 0.02, len(stored))
    assert [m.damping_ratio for m in as_stored(body, stored, damping).modes] == [
        damping[m.numbers[0] - 1] for m in body.modes
    ]
    with pytest.raises(BodyError, match=r"pinion: frequencies .* differ by 1\.0e-04 .*gearfmu reduce --force"):
        as_stored(body, stored * 1.0001, damping)


def test_a_ring_by_sectors_and_as_a_whole() -> None:
    """Two methods: 54 sectors, and all teeth at once without symmetry."""
    mesh, material = set_body("ring", 0.2)
    sectors = cyclic_modes("ring", mesh, material, 8)
    whole = whole_modes(
        toothed_full_order(load_stage("planetary54").by_file["ring"], None, 0.2), mesh.full(), {}, material, 8
    )
    assert np.allclose(frequencies(sectors)[:8], frequencies(whole)[:8], rtol=1e-7)
    assert [m.nodal_diameter for m in whole.modes] == [m.nodal_diameter for m in sectors.modes]
    assert [m.parity for m in whole.modes] == [m.parity for m in sectors.modes]
    for mode, other in zip(whole.modes, sectors.modes, strict=True):
        assert np.allclose(mode.energy, other.energy, atol=1e-3) and len(mode.numbers) == len(other.numbers)


def test_springs_at_the_rim_hold_the_ring() -> None:
    """Soft mounts: six modes of the rigid ring below its elastic ones, √(Σk/m) in each direction."""
    spec = load_stage("planetary54")
    soft = spec.written.ring.mounts.model_copy(update={"stiffness": 1e4})
    spec = rewritten(spec, ring=spec.written.ring.model_copy(update={"mounts": soft}))
    told: list[str] = []
    found = mounted_ring_modes(spec, 7, lambda what, share: told.append(what), scale=0.2)
    assert told == ["finite elements"]
    mesh, material = set_body("ring", 0.2)
    mass = mesh.teeth * hex20.assemble(mesh.nodes, mesh.elements, material)[1][::3, ::3].sum()
    expected = np.sqrt(6 * 1e4 / mass) / (2 * np.pi)
    held = frequencies(found)
    assert (np.abs(held[:6] / expected - 1) < 1e-3).sum() == 3, "x, y and z"
    assert held[6] == pytest.approx(frequencies(cyclic_modes("ring", mesh, material, 2))[0], rel=1e-3)


def test_the_ring_without_mounts_has_no_mounted_modes() -> None:
    spec = load_stage("planetary54")
    spec = rewritten(spec, ring=spec.written.ring.model_copy(update={"mounts": None}))
    with pytest.raises(BodyError, match="the ring has no mounts"):
        mounted_ring_modes(spec, 7)


def test_rigid_couplings_of_the_carrier() -> None:
    """Its bolts and its bore move as rigid bodies, which makes it stiffer than the bare carrier, not softer."""
    spec = load_stage("planetary54")
    found = body_modes(spec, "carrier", 6, scale=0.3)
    mesh, material = set_body("carrier", 0.3)
    assert np.all(frequencies(found)[:6] > frequencies(cyclic_modes("carrier", mesh, material, 6))[:6])
    assert all(mode.damping_ratio == spec.written.carrier.modal_damping for mode in found.modes)
    radius = np.hypot(found.points[:, 0], found.points[:, 1])
    bore = found.points[np.abs(radius - spec.written.carrier.bore_diameter / 2) < 1e-9]
    fields = np.zeros((len(bore), 3, 6))
    fields[:, [0, 1, 2], [0, 1, 2]] = 1.0
    fields[..., 3:] = -np.cross(bore[:, None, :], np.eye(3)[None], axis=-1).transpose(0, 2, 1)
    for mode in found.modes:
        shape = mode.shape[0][np.abs(radius - spec.written.carrier.bore_diameter / 2) < 1e-9].ravel()
        fit, *_ = np.linalg.lstsq(fields.reshape(-1, 6), shape, rcond=None)
        assert np.allclose(fields.reshape(-1, 6) @ fit, shape, atol=1e-9 * np.abs(mode.shape).max())


# ---- pictures, .vtu files and the Campbell diagram: whole, to scale, and what the names say --------------------------
def test_vtu_of_a_pair_holds_both_shapes_as_drawn(tmp_path: Path) -> None:
    body = pinion_modes()
    pair, single = body.modes[0], body.modes[2]
    for mode, suffixes in ((pair, ("", "_2")), (single, ("",))):
        write_mode(body, mode, tmp_path / "mode.vtu")
        read = meshio.read(tmp_path / "mode.vtu")
        assert [block.type for block in read.cells] == ["quad8"] and len(read.cells[0].data) == len(body.faces)
        assert np.allclose(read.points, body.points, atol=1e-8)
        assert set(read.point_data) == {f"{n}{s}" for n in ("displacement", "mass_normalised") for s in suffixes}
        assert np.allclose(read.point_data["displacement"], body.drawn(mode)[0], atol=1e-8)
        assert np.allclose(read.point_data["mass_normalised"], mode.shape[0], rtol=1e-5, atol=1e-5)


def test_divided_faces_keep_area_and_displacement() -> None:
    """What is drawn is the surface of the quadratic elements: its area, to the chords of the finer faces."""
    body = pinion_modes()
    surface = pictures._surface(body)
    corners = (surface.sample @ body.points)[surface.quads]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1).sum()
    radius, bore, width = 41.23e-3, 15e-3, 14e-3
    assert 2 * np.pi * bore * width < area < 4 * np.pi * radius**2 + 4 * np.pi * radius * width
    assert np.allclose(np.asarray(surface.sample.sum(axis=1)).ravel(), 1)
    longest, before = (
        np.linalg.norm(c - np.roll(c, -1, axis=1), axis=2).max() for c in (corners, body.points[body.faces[:, :4]])
    )
    assert longest < 1.3 * max(before / pictures.MOST_PIECES, pictures.LARGEST * 2 * radius)


@pytest.mark.full
def test_pictures_are_coloured_and_framed_alike(tmp_path: Path) -> None:
    body = pinion_modes()
    sizes = set()
    for number in (0, 2):
        path = tmp_path / f"{number}.png"
        pictures.write_mode_picture(body, body.modes[number], path)
        pixels = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3)
        sizes.add(pixels.shape)
        assert 0.2 < (pixels < 250).any(axis=1).mean() < 0.9 and len(np.unique(pixels // 16, axis=0)) > 200
    assert len(sizes) == 1
    pictures.write_contact_sheet(replace(body, modes=body.modes[:2]), tmp_path / "sheet.png")
    assert min(Image.open(tmp_path / "sheet.png").size) > 350
    assert not list(tmp_path.glob("*.tmp*"))


@pytest.mark.parametrize(
    ("energy", "parity", "diameter", "motion", "name"),
    [
        ((0.1, 0.0, 0.9), -1, 0, "out-of-plane", "umbrella"),
        ((0.0, 1.0, 0.0), -1, 0, "out-of-plane", "counter-torsion"),
        ((0.2, 0.0, 0.8), -1, 1, "out-of-plane", "tilting"),
        ((0.0, 1.0, 0.0), 1, 0, "in-plane", "torsion"),
        ((1.0, 0.0, 0.0), 1, 0, "in-plane", "breathing"),
        ((0.7, 0.3, 0.0), 1, 3, "in-plane", "3 lobes"),
        ((0.1, 0.2, 0.7), 0, 2, "out-of-plane", "disc bending"),
    ],
)
def test_names(energy: tuple, parity: int, diameter: int, motion: str, name: str) -> None:
    mode = Mode((1,), 1.0, 0.01, parity, diameter, 1.0, np.array(energy), np.zeros((1, 1, 3)))
    assert (mode.motion, mode.name) == (motion, name)
    assert name in pictures.heading(mode) and f"ν = {diameter}" in pictures.heading(mode, short=True)


MESH = Family("mesh", (0,), 20.0)


def two_modes() -> StageModes:
    frequency = np.array([[500.0, 2000.0], [520.0, 2000.0]])
    shares = np.zeros((2, 2, 4))
    shares[..., 0] = 1
    return StageModes(
        100.0, np.array([0, 0.5]), frequency, np.full((2, 2), 0.01), shares, np.array([[[9e9], [1.0]]] * 2)
    )


def test_crossings_by_hand() -> None:
    """510 Hz and 20 teeth: order 1 at 25.5 rev/s, order 2 at half of that …; a mode that no te drives is left out."""
    found = crossings(two_modes(), [MESH], 2 * np.pi * 20)
    assert loud(two_modes()).tolist() == [[True], [False]]
    assert [(c.family, c.order, c.mode) for c in found] == [(MESH, k, 1) for k in range(2, 9)]
    assert [c.speed for c in found] == pytest.approx([2 * np.pi * 510 / (20 * k) for k in range(2, 9)])


def test_campbell_table_and_picture(tmp_path: Path) -> None:
    columns = campbell_columns(two_modes())
    assert columns["frequency_Hz"].tolist() == [510, 2000] and columns["lowest_Hz"].tolist() == [500, 2000]
    assert columns["mesh_share"].tolist() == [1, 1]
    write_campbell(two_modes(), "pinion", [MESH], 2 * np.pi * 20, tmp_path / "campbell.png")
    assert min(Image.open(tmp_path / "campbell.png").size) > 600


def test_campbell_picture_of_many_meshes_is_whole(tmp_path: Path) -> None:
    """Fault: a legend of ten entries in rows of six squeezed the diagram into the left half and was cut off."""
    eight, names = np.repeat(two_modes().mesh_force, 8, axis=2), tuple(f"sun_planet{k}" for k in range(1, 9))
    modes = replace(two_modes(), mesh_force=eight, meshes=names)
    families = [Family(name, (k,), 20.0 + k) for k, name in enumerate(names)]
    write_campbell(modes, "carrier", families, 2 * np.pi * 20, tmp_path / "campbell.png")
    ink = np.asarray(Image.open(tmp_path / "campbell.png").convert("L")) < 200
    height, width = ink.shape
    assert not ink[:, -3:].any() and not ink[:2].any(), "nothing is cut off"
    assert ink[height // 3 : 2 * height // 3, -width // 10 :].any(), "the diagram reaches the right side"


# ---- gears deformed by modal amplitudes ------------------------------------------------------------------------------
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
