"""Bodies of a helical pair: files with their optional groups, hands, kept tooth offsets, and the verbs that take
them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from verbs import call

from gearfmu.body import body_path, inspect_file, load_body, reduce_bodies
from gearfmu.body.pictures import drawn_counts
from gearfmu.body.store import save_body
from gearfmu.body.toothed import kept_offsets
from gearfmu.errors import BodyError
from gearfmu.stagefile.stage import load_stage

ROOT = Path(__file__).resolve().parents[2]
COUNTS = "modes = 31\nroll_points = 5\nwidth_functions = 3\n"
MESH = "flank = 3\nthickness = 1\nroot = 2\nrim = 1\nwidth = 2\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> SimpleNamespace:
    """The shipped helical pair on the coarsest mesh, reduced."""
    path = tmp_path_factory.mktemp("helical") / "stage.toml"
    base = f'base = "{ROOT / "reduced_models" / "helical_demo" / "stage.toml"}"\nname = "tiny"\n'
    gears = "".join(f"[gears.{g}.body]\n{COUNTS}[gears.{g}.body.mesh]\n{MESH}" for g in ("pinion", "wheel"))
    path.write_text(base + gears, encoding="utf-8")
    spec = load_stage(path)
    return SimpleNamespace(path=path, spec=spec, bodies=reduce_bodies(spec))


def test_pinion_and_wheel_are_of_opposite_hand(made: SimpleNamespace) -> None:
    angles = [body.flank.beta_b for body in made.bodies]
    assert angles[0] == -angles[1] == pytest.approx(math.asin(math.sin(math.radians(20)) * math.cos(math.radians(20))))
    for body in made.bodies:
        assert np.all(body.flank.parity == 0)
        assert body.flank.tangent.rows.shape == body.flank.rows.shape
        own = body.flank.static[:, :, 0].shape
        assert body.flank.tangent.static_tt.shape == body.flank.tangent.static_nt.shape == own


def test_kept_offsets_are_what_the_kernel_reads() -> None:
    """−3 … 3, all of them where they are needed or no more."""
    for teeth, expected in ((37, [0, 1, 2, 3, 34, 35, 36]), (7, range(7)), (6, range(6))):
        table = np.broadcast_to(np.arange(teeth)[:, None, None, None, None], (2, 2, teeth, 4, 4, 2, 2))
        assert list(kept_offsets(table)[0, 0, :, 0, 0, 0, 0]) == list(expected)


def test_a_body_with_few_offsets_reads_back_by_its_offset(made: SimpleNamespace, tmp_path: Path) -> None:
    body, path = made.bodies[1], tmp_path / "few.h5"
    save_body(body, path)
    again = load_body(path)
    assert again.flank.static.shape[2] == body.flank.static.shape[2] == 7 < body.flank.teeth
    for offset in range(4):
        mirrored = again.flank.static[:, :, -offset].transpose(1, 0, 3, 2, 5, 4)
        assert np.allclose(again.flank.static[:, :, offset], mirrored, rtol=0, atol=1e-14 * np.abs(mirrored).max())
    assert inspect_file(path)["facts"]["tooth_offsets"] == "−3 to 3"
    with pytest.raises(BodyError, match="tooth offsets"):
        replace(body, flank=replace(body.flank, static=body.flank.static[:, :, :6]))


def test_the_drawn_surface_follows_the_helix(made: SimpleNamespace) -> None:
    """Points of the drawn tip circle at the ends of the face width are turned by ± b/2·twist."""
    for body, shape, gear in zip(made.bodies, made.spec.written.geometry.gears, made.spec.gears, strict=True):
        assert drawn_counts(shape, gear.face_width).width > 1
        points, pitch = np.asarray(body.picture.points, float), 2 * np.pi / body.flank.teeth
        radius, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
        for end in (-0.5, 0.0, 0.5):
            z = end * gear.face_width
            layers = np.unique(np.round(points[:, 2], 7))
            near = layers[np.abs(layers - z).argmin()]
            top = (radius > 0.9999 * shape.r_a) & (np.abs(points[:, 2] - near) < 1e-6)
            turn = np.exp(1j * (angle[top] - shape.twist * near) * body.flank.teeth).mean()
            assert abs(np.angle(turn)) < 1e-3 * body.flank.teeth * pitch


@pytest.mark.full
def test_verbs_about_bodies_take_a_helical_stage(made: SimpleNamespace, tmp_path: Path) -> None:
    code, out, _ = call("mesh", made.path, "--gear", "wheel", "--out", tmp_path)
    assert code == 0 and "scaled_jacobian_min" in out
    code, out, _ = call("reduce", made.path)
    assert code == 0 and "0 bodies reduced, 2 read" in out
    code, out, _ = call("inspect", body_path(made.spec, "wheel"), "--json")
    assert code == 0 and json.loads(out)["facts"]["base_helix_angle_deg"] == pytest.approx(-18.7472, abs=1e-3)
    code, out, _ = call("inspect", made.path, "--json")
    derived = json.loads(out)["derived"]
    assert code == 0 and derived["overlap_ratio"] == pytest.approx(1.016, abs=1e-3)
    assert derived["total_contact_ratio"] == pytest.approx(derived["contact_ratio"] + derived["overlap_ratio"])
    code, out, _ = call("modes", made.path, "--body", "pinion", "--count", 4, "--out", tmp_path)
    assert code == 0 and "torsion" in out or "lobes" in out
    code, out, _ = call(
        "frf", made.path, "pinion", "--methods", "modal", "--size", 20, "--lines", 8, "--scale", 0.5, "--out", tmp_path,
    )  # fmt: skip
    assert code == 0 and "modal" in out
