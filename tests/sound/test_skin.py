"""Skins: closed or refused with the place of the hole, refined without a change, joined to patches."""

from __future__ import annotations

import numpy as np
import pytest
from surfaces import box, rigid

from gearfmu.sound import SoundError, memory_needed, radiation, refined, skin_of
from gearfmu.sound.skin import patches

SIZE = (0.3, 0.2, 0.1)


def test_a_hole_is_told_with_its_place_and_size() -> None:
    points, faces = box(SIZE, (3, 2, 1))
    top = np.flatnonzero((points[faces][:, :, 2] > 0.049).all(axis=1))
    left = [face for face in top if points[faces[face]][:, 0].max() < -0.04 and points[faces[face]][:, 1].max() < 0.01]
    right = [face for face in top if points[faces[face]][:, 0].min() > 0.04]
    with pytest.raises(SoundError) as told:
        skin_of(points, np.delete(faces, left + right, axis=0), rigid(points))
    assert "hole of 4 edges, 141.4 mm across, at (-100, -50, 50) mm" in str(told.value)
    assert "hole of 6 edges, 223.6 mm across, at (100, 0, 50) mm" in str(told.value)


def test_faces_turned_wrongly_are_told() -> None:
    points, faces = box(SIZE, (2, 2, 2))
    with pytest.raises(SoundError, match="inside out"):
        skin_of(points, faces[:, ::-1], rigid(points))
    with pytest.raises(SoundError, match="not closed|turned alike"):
        skin_of(points, [*faces[1:], faces[0][::-1]], rigid(points))


def test_gram_of_rigid_motion_is_that_of_the_box() -> None:
    """Two faces of b·c move along x; about z the normal displacement of a face x = ±a/2 is −y, of y = ±b/2 it is x."""
    points, faces = box(SIZE, (3, 2, 1))
    a, b, c = SIZE
    gram = skin_of(points, faces, rigid(points)).gram
    exact = [2 * b * c, 2 * a * c, 2 * a * b, c * b**3 / 6 + b * c**3 / 6, a * c**3 / 6 + c * a**3 / 6]
    exact += [c * b**3 / 6 + c * a**3 / 6]
    exact[3] = a * b**3 / 6 + a * c**3 / 6  # about x: faces y turn by z, faces z by y
    exact[4] = b * a**3 / 6 + b * c**3 / 6
    assert np.abs(np.diag(gram) / exact - 1).max() < 1e-12
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 1e-15


def test_refining_changes_neither_volume_nor_gram_of_linear_shapes() -> None:
    points, faces = box(SIZE, (1, 1, 1))
    coarse = skin_of(points, faces, rigid(points))
    fine = refined(coarse, 0.04)
    sides = np.linalg.norm(fine.corners - np.roll(fine.corners, 1, axis=1), axis=2)
    assert sides.max() <= 0.04
    assert fine.volume == pytest.approx(coarse.volume, rel=1e-12)
    assert np.abs(fine.gram - coarse.gram).max() < 1e-12 * coarse.gram.max()
    assert skin_of(fine.points, fine.triangles, fine.shapes).volume > 0  # closed still


def test_patches_are_compact_and_on_one_side_of_an_edge() -> None:
    points, faces = box(SIZE, (24, 16, 8))
    skin = skin_of(points, faces, rigid(points))
    label = patches(skin, 200)
    unit = skin.normals / np.linalg.norm(skin.normals, axis=1)[:, None]
    edge = np.sqrt(2 * (0.06 + 0.03 + 0.02) / 200)
    for patch in range(label.max() + 1):
        own = skin.corners[label == patch]
        assert np.ptp(unit[label == patch], axis=0).max() < 1e-9
        assert np.linalg.norm(np.ptp(own, axis=(0, 1))) < 3 * edge


def test_memory_is_estimated_before_it_is_taken() -> None:
    points, faces = box(SIZE, (1, 1, 1))
    skin = skin_of(points, faces, rigid(points))
    assert memory_needed(10_000, 100) > 8e9
    with pytest.raises(SoundError, match="GB, more than"):
        radiation(skin, count=100_000)
