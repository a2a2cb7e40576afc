"""The bodies that ship: not stale, small, physically right, and remade by the program as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import Body, body_path, load_bodies, reduce_bodies
from gearfmu.body.layout import value_of
from gearfmu.body.sound import kept_radiation, sound_path
from gearfmu.stagefile.reading.files import library_roots, shipped_stages
from gearfmu.stagefile.stage import load_stage

LARGEST = 1.4e6  # bytes of a file: surface in all modes, rows along the profile and own-tooth tables included
LIBRARY = 15e6  # bytes of all of them
ROUNDED = 5e-6  # of what is scaled to ones: tables in steps of 2^-23 to 2^-22 of the largest, rows of 2^-21 to 2^-20


@pytest.mark.parametrize("stage", shipped_stages())
def test_no_shipped_body_is_stale_large_or_incomplete(stage: str) -> None:
    spec = load_stage(stage)
    for body in load_bodies(spec):
        assert body_path(spec, body.name).stat().st_size <= LARGEST
        if body.skin is not None:
            assert body.error.max_error < 0.1 and body.error.trusted_to > 6e3 and body.sensors is not None
            assert kept_radiation(body, sound_path(body_path(spec, body.name))).reach > 1.6e3
            continue
        trusted = body.error.max_error < (1e-6 if body.flank is None else 0.01)
        assert trusted or spec.written is spec  # those of a train say how far they reach
        assert not spec.carriers or tuple(body.error.band) == pytest.approx((50.0, 10e3))
        assert body.flank is None or (body.flank.knows_profile and body.spin is not None)


def test_the_bodies_of_the_library_are_small_together():
    root = library_roots()[0]
    assert 0 < sum(path.stat().st_size for path in root.rglob("*.h5")) <= LIBRARY


def test_a_symmetric_load_does_not_notice_that_motion_out_of_the_plane_is_held():
    """Even width functions move the bore neither along z nor about x and y, statically or by any mode, nor couple to
    them through the bore or the inertia; odd ones do, so zero is not the answer to everything."""
    planar, out = [0, 1, 5], [2, 3, 4]
    for body in load_bodies(load_stage("fzg_c")):
        even = np.arange(body.flank.node.shape[2]) % 2 == 0
        symmetric = body.flank.parity > 0
        scale = np.abs(body.flank.node[:, :, ~even][..., out]).max(axis=(0, 1, 2))
        assert np.all(scale > 0) and np.all(np.abs(body.flank.node[:, :, even][..., out]) < 1e-9 * scale)
        scale = np.abs(body.rows[out][:, ~symmetric]).max(axis=1, keepdims=True)
        assert np.all(scale > 0) and np.all(np.abs(body.rows[out][:, symmetric]) < 1e-9 * scale)
        scale = np.abs(body.rows[planar]).max(axis=1, keepdims=True)
        assert np.all(np.abs(body.rows[planar][:, ~symmetric]) < 1e-9 * scale)
        assert np.all(body.flank.rows[:, :, even][..., ~symmetric] == 0)
        size = np.sqrt(body.static.diagonal())
        assert np.abs(body.static / np.outer(size, size))[np.ix_(planar, out)].max() < 1e-9
        assert np.abs(body.inertia[2, :2]).max() < 1e-9 * body.inertia[2, 2]


@pytest.mark.parametrize("stage", ["fzg_c", "helical_demo", "planetary54"])
@pytest.mark.parametrize("modes", [0, 40, 400])
def test_residual_of_any_cut_is_positive_semidefinite(stage: str, modes: int) -> None:
    """C_static − Σ N Nᵀ/ω² of both flanks of a tooth along normal and profile, of these and the bore, and of a
    carrier's nodes, whichever modes are dynamic."""
    for body in load_bodies(load_stage(stage)):
        if body.flank is None:
            assert eigenvalues(body, body.static, body.rows, modes)[0] > -1e-9
            continue
        points = body.flank.node[..., 0].size
        nn, nt, tt = (
            table.transpose(0, 2, 4, 1, 3, 5).reshape(points, points)
            for table in (body.flank.static[:, :, 0], body.flank.tangent.static_nt, body.flank.tangent.static_tt)
        )
        bore = body.flank.node.reshape(points, 6)
        normal, profile = (of.rows.reshape(points, -1) for of in (body.flank, body.flank.tangent))
        for static, rows in (
            (np.block([[nn, bore], [bore.T, body.static]]), np.vstack([normal, body.rows])),
            (np.block([[nn, nt], [nt.T, tt]]), np.vstack([normal, profile])),
        ):
            found = eigenvalues(body, static, rows, modes)
            assert found[0] > -ROUNDED * (1 + body.flank.internal) * found[-1] and found[-1] > 0


def eigenvalues(body: Body, static: np.ndarray, rows: np.ndarray, modes: int) -> np.ndarray:
    """Of what the first modes leave of a static compliance whose diagonal is scaled to ones."""
    residual = static - (rows[:, :modes] / (2 * np.pi * body.frequency[:modes]) ** 2) @ rows[:, :modes].T
    scale = np.sqrt(static.diagonal())
    return np.linalg.eigvalsh(residual / np.outer(scale, scale))


@pytest.mark.full
@pytest.mark.parametrize(("stage", "near"), [("fzg_c", 1e-6), ("planetary54", 1e-8)])
def test_gearfmu_reduce_remakes_the_shipped_bodies(stage: str, near: float, tmp_path: Path) -> None:
    """Same hashes, frequencies to `near` (modes end by one step, of error 1e-7), statics to 1e-6, of the pair the error
    of the frequency response to 1e-3 of itself. Above twice the band that is trusted, oscillators of the carrier, of a
    Krylov space, follow the rounding of the factors: to 2e-5."""
    spec = load_stage(stage)
    for made, old in zip(reduce_bodies(spec, tmp_path), load_bodies(spec), strict=True):
        assert made.how.hash == old.how.hash and body_path(spec, made.name, tmp_path).is_file()
        theirs = old.frequency[: 400 if stage == "fzg_c" else 100]
        limit = np.where((made.flank is None) & (theirs > 20e3), 2e-5, near)
        assert np.all(np.abs(made.frequency[: len(theirs)] - theirs) <= limit * theirs)
        for field in ("static",) if made.flank is None else ("flank.static", "flank.node", "static"):
            offsets = [0, 1, 2, 3, -3, -2, -1] if field == "flank.static" else slice(None)  # those that every file has
            axis = (slice(None), slice(None), offsets) if field == "flank.static" else offsets
            stored = value_of(old, field)[axis]
            assert np.abs(value_of(made, field)[axis] - stored).max() <= 1e-6 * np.abs(stored).max()
        assert stage != "fzg_c" or np.allclose(made.error.error, old.error.error, rtol=1e-3, atol=1e-9)
