"""Pictures, .vtu files and the Campbell diagram: whole, to scale, and what the names say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from PIL import Image
from small import pinion_modes

from gearfmu.modes.linear import StageModes
from gearfmu.modes.shapes import Mode
from gearfmu.modes.vtu import write_mode
from gearfmu.report import modes as pictures
from gearfmu.report.campbell import Family, campbell_columns, crossings, loud, write_campbell


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
