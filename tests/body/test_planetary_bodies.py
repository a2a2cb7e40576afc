"""The bodies of planetary54: not stale, small, physically right; their files; the carrier's body from end to end."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from sections import carrier_moments, section

from gearfmu.body import (
    Body,
    body_path,
    inspect_file,
    load_bodies,
    load_body,
    reduce_bodies,
    reduce_body,
)
from gearfmu.body.layout import SENSORS, entries_of, value_of
from gearfmu.body.store import save_body
from gearfmu.errors import BodyError
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.shapes import carrier_geometry, ring_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

LARGEST = 1.4e6  # bytes of a file, as of other shipped bodies
SPEC = load_stage("planetary54")
NAMES = SPEC.files
COARSE = rewritten(SPEC, carrier=SPEC.written.carrier.model_copy(update={
        "mesh": SPEC.written.carrier.mesh.model_copy(update={"scale": 0.25}), "modes": 48, "method": "rubin"
    }))  # fmt: skip


@pytest.fixture(scope="module")
def shipped() -> dict:
    return dict(zip(NAMES, load_bodies(SPEC), strict=True))


@pytest.fixture(scope="module")
def carrier() -> Body:
    return reduce_body(COARSE, "carrier")


def test_shipped_bodies_are_current_small_and_trusted_over_the_band(shipped):
    for name, body in shipped.items():
        assert body_path(SPEC, name).stat().st_size <= LARGEST
        assert name == "carrier" or (body.flank.knows_profile and body.spin is not None)
        assert body.error.max_error < 0.01 and tuple(body.error.band) == pytest.approx((50.0, 10e3))
    assert [shipped[name].modes for name in NAMES] == [400, 400, 399, 120]  # 400 would split a pair of the ring
    assert shipped["carrier"].error.max_error < 1e-6


def test_shipped_bodies_of_the_helical_set_are_current_small_and_of_their_hands():
    spec = load_stage("helical_set")
    *gears, carrier = load_bodies(spec)
    assert [np.sign(gear.flank.beta_b) for gear in gears] == [1, -1, -1]
    for gear in gears:
        assert body_path(spec, gear.name).stat().st_size <= LARGEST
        assert gear.error.max_error < 0.01 and gear.flank.knows_profile and gear.spin is not None
    assert carrier.error.max_error < 1e-6


def test_masses_and_inertias_are_the_analytic_ones(shipped):
    ring, carrier = ring_geometry(SPEC.written.ring, SPEC.written.set), carrier_geometry(SPEC.bodies["carrier"])
    (area, moment), (middle, about) = section(ring), carrier_moments(carrier)
    volume = ring.z * area * SPEC.written.ring.face_width
    assert shipped["ring"].total_mass == pytest.approx(7850 * volume, rel=1e-5)
    polar = 7850 * ring.z * moment * SPEC.written.ring.face_width
    assert shipped["ring"].inertia[2, 2] == pytest.approx(polar, rel=1e-5)
    assert shipped["carrier"].total_mass == pytest.approx(7850 * carrier.volume, rel=1e-4)
    assert shipped["carrier"].inertia[2, 2] == pytest.approx(7850 * about, rel=1e-4)
    assert shipped["carrier"].centre_of_mass == pytest.approx([0, 0, middle], abs=1e-6)


def test_planet_is_the_sun_with_a_larger_bore(shipped):
    sun, planet = shipped["sun"], shipped["planet"]
    assert (
        sun.total_mass > planet.total_mass
        and sun.flank.internal is planet.flank.internal is False
        and sun.sensors is None
    )
    assert sun.flank.r_b == planet.flank.r_b == pytest.approx(22.5e-3 * np.cos(np.radians(20)))


def test_four_bolts_are_alike(shipped):
    """Turned by a quarter, the carrier is itself: compliance of bolt k in its own frame."""
    body = shipped["carrier"]
    blocks = [body.static[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(4)]
    for k, block in enumerate(blocks):
        c, s = np.cos(np.pi / 2 * k), np.sin(np.pi / 2 * k)
        turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
        size = np.sqrt(np.outer(blocks[0].diagonal(), blocks[0].diagonal()))
        assert np.abs((turn @ block @ turn.T - blocks[0]) / size).max() < 1e-6


@pytest.mark.parametrize("dynamic", [0, 30, 120])
def test_residual_of_the_carrier_is_positive_semidefinite(shipped, dynamic):
    body = shipped["carrier"]
    rows = body.rows[:, :dynamic] / (2 * np.pi * body.frequency[:dynamic])
    scale = np.sqrt(body.static.diagonal())
    values = np.linalg.eigvalsh((body.static - rows @ rows.T) / np.outer(scale, scale))
    assert values.min() > -1e-9


def test_ring_file_holds_the_sensor_on_its_rim(shipped, tmp_path):
    path, ring = tmp_path / "ring.h5", shipped["ring"]
    save_body(ring, path)
    back = load_body(path)
    assert back.flank.internal and np.array_equal(back.sensors.rows, ring.sensors.rows)
    assert np.hypot(*back.sensors.points[0, :2]) == pytest.approx(SPEC.written.ring.rim_diameter / 2, rel=1e-2)
    facts = inspect_file(path)
    assert facts["facts"]["internal"] and not [name for name in facts["facts"] if "mount" in name]
    assert {entry.path for entry in SENSORS} <= {d["path"] for d in facts["datasets"]}


def test_carrier_file_reads_back_and_says_what_it_can_be_trusted_for(carrier, tmp_path):
    path = tmp_path / "carrier.h5"
    save_body(carrier, path)
    back = load_body(path)
    for entry in entries_of(carrier):
        assert np.array_equal(value_of(back, entry.field), value_of(carrier, entry.field)), entry.path
    assert back.how == carrier.how and back.error.ground == carrier.error.ground == ("bore",)
    for one, other in zip(back.nodes, carrier.nodes, strict=True):
        assert (one.name, one.kind, one.components) == (other.name, other.kind, other.components)
    facts = json.loads(json.dumps(inspect_file(path)))
    assert facts["kind"] == "body" and facts["facts"]["method"] == "rubin" and facts["facts"]["modes"] <= 48
    assert facts["frf"]["band_Hz"] == [50.0, 10e3] and facts["frf"]["max_error"] == carrier.error.max_error < 1e-2
    assert facts["facts"]["mass_kg"] == pytest.approx(1.0859, rel=1e-3)


def test_a_damaged_carrier_file_is_refused(carrier, tmp_path):
    path = tmp_path / "carrier.h5"
    save_body(carrier, path)
    raw = bytearray(path.read_bytes())
    raw[5000] ^= 1
    path.write_bytes(raw)
    with pytest.raises(BodyError, match="damaged"):
        load_body(path)


def test_a_carrier_body_that_cannot_be_is_refused(carrier):
    with pytest.raises(BodyError, match="rows has shape"):
        replace(carrier, rows=carrier.rows[:-1])
    with pytest.raises(BodyError, match="not finite"):
        replace(carrier, static=carrier.static * np.nan)
    with pytest.raises(BodyError, match="ascending"):
        replace(carrier, frequency=carrier.frequency[::-1])


def test_missing_and_stale_bodies_are_refused(carrier, tmp_path):
    with pytest.raises(BodyError, match="sun.h5: no such body file"):
        load_bodies(SPEC, tmp_path)
    for name in NAMES:
        (tmp_path / f"{name}.h5").write_bytes(body_path(SPEC, name).read_bytes())
    save_body(carrier, tmp_path / "carrier.h5")
    with pytest.raises(BodyError, match="carrier.h5: stale: made from other numbers"):
        load_bodies(SPEC, tmp_path)
    save_body(replace(carrier, how=replace(carrier.how, algorithm=1)), tmp_path / "carrier.h5")
    with pytest.raises(BodyError, match="carrier.h5: stale: made by version 1 of the reduction.*gearfmu reduce"):
        load_bodies(SPEC, tmp_path)


def test_a_set_is_reduced_whole_and_left_alone_when_it_is_current(carrier, tmp_path):
    mesh = MeshSpec(flank=3, thickness=1, root=2, rim=1, width=1)
    small = {"mesh": mesh, "modes": 12, "roll_points": 4, "width_functions": 1}
    gears = {g.name: g.model_copy(update={"body": g.body.model_copy(update=small)}) for g in COARSE.written.gears}
    spec = rewritten(COARSE, **gears)
    save_body(carrier, tmp_path / "carrier.h5")  # current already
    before, said = (tmp_path / "carrier.h5").stat().st_mtime_ns, []
    bodies = reduce_bodies(spec, tmp_path, progress=lambda what, share: said.append(what))
    assert [body.name for body in bodies] == list(NAMES) and any("ring" in what for what in said)
    assert (tmp_path / "carrier.h5").stat().st_mtime_ns == before and bodies[2].flank.internal
    (tmp_path / "sun.h5").unlink()
    stamps = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.h5")}
    reduce_bodies(spec, tmp_path)
    assert (tmp_path / "sun.h5").is_file()
    assert stamps == {name: (tmp_path / name).stat().st_mtime_ns for name in stamps}


@pytest.mark.full
def test_gearfmu_reduce_remakes_the_shipped_set(shipped, tmp_path):
    """Same hashes, frequencies to 1e-8, statics to 1e-6. Above twice the band that is trusted, oscillators of the
    carrier, of a Krylov space, follow the rounding of the factors: to 2e-5."""
    for made in reduce_bodies(SPEC, tmp_path):
        old = shipped[made.name]
        assert made.how.hash == old.how.hash
        ours, theirs = made.frequency[:100], old.frequency[:100]
        near = np.where((made.name == "carrier") & (theirs > 20e3), 2e-5, 1e-8)
        assert np.all(np.abs(ours - theirs) <= near * theirs)
        for field in ("static",) if made.name == "carrier" else ("flank.static", "flank.node", "static"):
            offsets = [0, 1, 2, 3, -3, -2, -1] if field == "flank.static" else slice(None)  # those that every file has
            axis = (slice(None), slice(None), offsets) if field == "flank.static" else offsets
            stored = value_of(old, field)[axis]
            assert np.abs(value_of(made, field)[axis] - stored).max() <= 1e-6 * np.abs(stored).max()
