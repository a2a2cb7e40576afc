"""The body file: round trip, refusals, and a kill while it is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from gearfmu.body import body_path, load_bodies, load_body, reduce_bodies, reduce_body
from gearfmu.body.body import _FORMER, ENTRIES
from gearfmu.body.layout import entries_of, value_of
from gearfmu.body.store import save_body
from gearfmu.errors import BodyError
from gearfmu.files import seal
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import MeshSpec

TINY = MeshSpec(flank=3, thickness=1, root=2, rim=1, width=2)


def tiny_stage(folder: Path) -> Stage:
    """The FZG pair on the coarsest mesh, its files in `folder`."""
    spec = load_stage("fzg_c")
    body = {"mesh": TINY, "modes": 31, "roll_points": 5, "width_functions": 3}
    gears = tuple(gear.model_copy(update={"body": gear.body.model_copy(update=body)}) for gear in spec.written.gears)
    return rewritten(spec, gears=gears, source=folder / "stage.toml")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stage")
    spec = tiny_stage(folder)
    return spec, reduce_bodies(spec), folder


def test_a_reduction_is_stored_to_what_the_layout_says_and_packed_once(made, tmp_path):
    """What is stored in steps returns within a step, and two more times within the same; written again, a file has the
    same bytes."""
    spec, _, _ = made
    body, first, second = reduce_body(spec, "pinion"), tmp_path / "pinion.h5", tmp_path / "again.h5"
    save_body(body, first)
    again = load_body(first)
    save_body(again, second)
    assert first.read_bytes() == second.read_bytes() and again.name == body.name and again.how == body.how
    for entry in entries_of(body):
        found, exact = value_of(again, entry.field), value_of(body, entry.field)
        if not entry.bits:
            assert np.array_equal(found, exact), entry.path
            continue
        others = tuple(range(1, exact.ndim)) if entry.each else None
        step = np.abs(exact).max(axis=others, keepdims=True) * 2.0 ** (1 - entry.bits)
        assert np.all(np.abs(found - exact) <= (3 if "R" in entry.shape else 0.5) * step), entry.path
    assert np.allclose(again.picture.points, body.picture.points, rtol=0, atol=1e-7 * np.ptp(body.picture.points))
    assert np.array_equal(again.picture.quads, body.picture.quads)


def test_every_dataset_says_its_unit_and_meaning(made):
    spec, bodies, _ = made
    with h5py.File(body_path(spec, "pinion")) as file:
        found = []
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        assert sorted(found) == sorted(entry.path for entry in entries_of(bodies[0]))
        assert all(file[name].attrs["meaning"] and "unit" in file[name].attrs for name in found)


def test_a_stored_body_is_taken_when_its_hash_matches_and_made_again_when_not(made):
    spec, bodies, folder = made
    before = body_path(spec, "pinion").stat().st_mtime_ns
    assert np.array_equal(reduce_bodies(spec)[0].frequency, bodies[0].frequency)
    body_path(spec, "wheel").unlink()
    reduce_bodies(spec)
    assert body_path(spec, "wheel").is_file(), "what is missing is made, and nothing else"
    assert body_path(spec, "pinion").stat().st_mtime_ns == before
    assert [b.name for b in load_bodies(spec)] == ["pinion", "wheel"]
    softer = spec.written.gears[0].material.model_copy(update={"youngs_modulus": 103e9})
    other = rewritten(
        spec, gears=(spec.written.gears[0].model_copy(update={"material": softer}), spec.written.gears[1])
    )
    with pytest.raises(BodyError, match="pinion.h5: stale: made from other numbers.*gearfmu reduce"):
        load_bodies(other)
    remade = reduce_bodies(other, folder / "other")[0]
    assert np.allclose(remade.frequency, bodies[0].frequency / np.sqrt(2), rtol=1e-7)
    assert np.allclose(
        remade.flank.static, 2 * bodies[0].flank.static, rtol=0, atol=1e-9 * bodies[0].flank.static.max()
    )


def test_contact_ports_and_backlash_leave_the_body_alone(made):
    spec, _, _ = made
    pair = spec.written.pair.model_copy(update={"backlash": 3e-4})
    contact = spec.written.contact.model_copy(update={"slices": 9})
    assert len(load_bodies(rewritten(spec, pair=pair, contact=contact))) == 2


def damaged(path: Path, change) -> Path:
    """A copy with something changed and the seal made good again, so that the deeper checks are reached."""
    copy = path.with_name("damaged.h5")
    copy.write_bytes(path.read_bytes())
    with h5py.File(copy, "r+") as file:
        change(file)
    seal(copy)
    return copy


def _overwrite(name: str, index, value):
    def change(file):
        data = file[name][()]
        data[index] = value
        file[name][...] = data

    return change


def _drop(name: str):
    return lambda file: file.__delitem__(name)


def _attribute(name: str, value):
    return lambda file: file.attrs.__setitem__(name, value)


def _reshape(file):
    data = file["rows"][()]
    del file["rows"]
    file["rows"] = data[:, :-1]


def _drop_points(file):
    data = file["picture/loads"][()]
    step = file["picture/loads"].attrs["step"]
    del file["picture/loads"]
    file["picture/loads"] = data[:, :-1]
    file["picture/loads"].attrs["step"] = step


DAMAGE = {
    "frequency holds a number that is not finite": _overwrite("frequency", 3, np.nan),
    "frequency must be above 0 and ascending": _overwrite("frequency", 3, 1.0),
    "static is missing": _drop("static"),
    "does not fit": _reshape,
    "64 hex digits": _attribute("input_hash", "abc"),
    "pair must follow": _overwrite("flank/part", slice(None), 1),
    "flank/roll must ascend": _overwrite("flank/roll", 0, 1.0),
    "picture/shapes/quads names a point that is not there": _overwrite("picture/shapes/quads", (0, 0), 10**6),
    "picture/loads does not fit the surface": _drop_points,
    "dataset flank/node is missing": _drop("flank/node"),
}


@pytest.mark.parametrize("message", DAMAGE)
def test_a_bad_file_is_refused_with_the_reason_and_the_remedy(made, message):
    spec, _, _ = made
    with pytest.raises(BodyError, match=message) as caught:
        load_body(damaged(body_path(spec, "pinion"), DAMAGE[message]))
    assert "gearfmu reduce" in str(caught.value)
    assert "damaged.h5" in str(caught.value)


def test_every_damaged_byte_is_noticed_before_hdf5_reads_it(made, tmp_path):
    """Without the seal a damaged index reads as zeros, and some damage keeps the HDF5 library busy for ever."""
    spec, _, _ = made
    whole, rng = body_path(spec, "pinion").read_bytes(), np.random.default_rng(3)
    places = [*range(0, 600, 7), *rng.integers(0, len(whole), 100)]
    for place in places:
        data = bytearray(whole)
        data[place] ^= 1 << int(rng.integers(8))
        (tmp_path / "damaged.h5").write_bytes(data)
        with pytest.raises(BodyError, match="damaged.h5: .*gearfmu reduce"):
            load_body(tmp_path / "damaged.h5")
    with pytest.raises(BodyError, match="do not match their SHA-256"):
        load_body(tmp_path / "damaged.h5")


def test_a_body_that_makes_no_sense_cannot_be_built(made):
    _, bodies, _ = made
    with pytest.raises(BodyError, match="damping_ratio must lie.*parity must be"):
        flank = replace(bodies[0].flank, parity=bodies[0].flank.parity + 3)
        replace(bodies[0], damping_ratio=bodies[0].damping_ratio - 1, flank=flank)
    with pytest.raises(BodyError, match="frequency.*flank/part"):
        flank = replace(bodies[0].flank, part=bodies[0].flank.part * 1.0)
        replace(bodies[0], frequency=bodies[0].frequency.astype(int), flank=flank)


def test_the_layout_is_documented():
    text = (Path(__file__).parents[2] / "docs" / "file-formats.md").read_text(encoding="utf-8")
    for entry in ENTRIES:
        assert f"`/{entry.path}`" in text
        assert entry.meaning in text


def test_former_names_say_what_they_are_now(made):
    """Every one of them is there, of a gear or of a carrier."""
    gear, carrier = made[1][0], load_bodies(load_stage("planetary54"))[3]
    with pytest.raises(AttributeError, match="a body has no 'flank_rows': it is 'flank.rows' now"):
        _ = gear.flank_rows
    with pytest.raises(AttributeError, match="a body has no 'nonsense'$"):
        _ = gear.nonsense
    for path in _FORMER.values():
        assert value_of(gear, path) is not None or value_of(carrier, path) is not None or path == "sensors", path
