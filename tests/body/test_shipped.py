"""The bodies that ship: not stale, small, physically right, and remade by the program as they are."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import load_stage_bodies, reduce_stage
from gearfmu.body.reduce import body_path
from gearfmu.spec.library import shipped_stages
from gearfmu.spec.stage import load_stage


@pytest.mark.parametrize("stage", shipped_stages())
def test_no_shipped_body_is_stale_or_large(stage):
    spec = load_stage(stage)
    for index, body in enumerate(load_stage_bodies(spec)):
        assert body_path(spec, index).stat().st_size <= 8e6
        assert body.frf.max_error < 0.01


def bore_held(body, offset: int = 0) -> np.ndarray:
    """Compliance (R, R) of uniform loads on flank 0 of teeth 0 and `offset` relative to the bore, m/N."""
    z, normal = body.teeth, _uniform_resultant(body)
    angle = 2 * np.pi * offset / z
    c, s = np.cos(angle), np.sin(angle)
    turned = normal @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    planar = [0, 1, 5]
    fb = body.static_fb[0, :, 0]
    other = fb.copy()
    other[:, 0], other[:, 1] = c * fb[:, 0] - s * fb[:, 1], s * fb[:, 0] + c * fb[:, 1]
    bb = body.static_bb[np.ix_(planar, planar)]
    return body.static_ff[0, 0, offset, :, :, 0, 0] - normal @ other[:, planar].T - fb[:, planar] @ turned.T + normal @ bb @ turned.T


def _uniform_resultant(body) -> np.ndarray:
    """Force x, y and moment z (R, 3) of the uniform unit load at each roll point: mean normal over the strip, and r_b."""
    arc = body.roll**2 / (2 * body.r_b)
    low, high = body.roll_range**2 / (2 * body.r_b)
    first, last = np.clip(arc - body.strip_half_width, low, high), np.clip(arc + body.strip_half_width, low, high)
    share = (np.arange(400) + 0.5) / 400
    roll = np.sqrt(2 * body.r_b * (first[:, None] + (last - first)[:, None] * share))
    tau = body.psi_b - roll / body.r_b
    return np.stack([-np.sin(tau).mean(1), np.cos(tau).mean(1), np.full(len(arc), body.r_b)], axis=1)


def at_roll(body, matrix: np.ndarray, roll: float) -> float:
    from scipy.interpolate import BarycentricInterpolator

    weights = BarycentricInterpolator(body.roll, np.eye(len(body.roll)))(roll)
    return float(weights @ matrix @ weights)


def test_stiffness_of_one_tooth_pair_is_that_of_iso_6336():
    """Pitch point, neighbours off, 300 N/mm, bores rigid: secant stiffness per width within 15 % of c'th = 15.78 N/(mm µm).

    Elastic displacement relative to the bores plus the line-contact law of DESIGN's strip: C_loc = 2(1−ν²)/(πEL)(ln(4w/b) − 1).
    """
    spec = load_stage("fzg_c")
    bodies = load_stage_bodies(spec)
    pair, width, force = spec.pair, spec.gears[0].face_width, 300e3 * spec.gears[0].face_width
    r_b = [body.r_b for body in bodies]
    tangent = np.sqrt(pair.center_distance**2 - sum(r_b) ** 2)
    rolls = [tangent * r / sum(r_b) for r in r_b]
    modulus = 206e9 / (1 - 0.3**2)
    radius = rolls[0] * rolls[1] / sum(rolls)
    hertz = np.sqrt(4 * force / width * radius / (np.pi * modulus / 2))
    total = 0.0
    for body, roll in zip(bodies, rolls, strict=True):
        local = 2 / (np.pi * modulus * width) * (np.log(4 * body.strip_half_width / hertz) - 1)
        total += at_roll(body, bore_held(body), roll) + local
    stiffness = 1 / (total * width) * 1e-9
    print(f"c'th = {stiffness:.2f} N/(mm µm)")
    assert stiffness == pytest.approx(15.78, rel=0.15)


def test_neighbour_teeth_move_along_less_than_the_loaded_one():
    for body in load_stage_bodies(load_stage("fzg_c")):
        middle = len(body.roll) // 2
        own, neighbour = (bore_held(body, m)[middle, middle] for m in (0, 1))
        assert 0 < neighbour < 0.25 * own
        assert abs(bore_held(body, body.teeth // 2)[middle, middle]) < 0.1 * own


@pytest.mark.full
def test_gearfmu_reduce_remakes_the_shipped_bodies(tmp_path):
    """Same input hash, frequencies to 1e-8, statics and frequency response to 1e-6."""
    spec = load_stage("fzg_c")
    for shipped, made in zip(load_stage_bodies(spec), reduce_stage(spec, tmp_path), strict=True):
        assert made.input_hash == shipped.input_hash
        assert np.allclose(made.frequency, shipped.frequency, rtol=1e-8)
        for name in ("static_ff", "static_fb", "static_bb"):
            stored = getattr(shipped, name)
            assert np.abs(getattr(made, name) - stored).max() <= 1e-6 * np.abs(stored).max()
        assert np.allclose(made.frf.error, shipped.frf.error, rtol=1e-6, atol=1e-9)
        assert Path(body_path(spec, 0, tmp_path)).is_file()
