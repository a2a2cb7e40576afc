"""Body files of gearfmu 0.2 and 0.3 are taken for what they are: `former/` holds three that 0.2 made."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import body_path, load_bodies, load_body, reduce_bodies
from gearfmu.body.layout import FORMAT_VERSION, entries_of, value_of
from gearfmu.body.store import save_body
from gearfmu.errors import BodyError
from gearfmu.files import format_of
from gearfmu.stagefile.former import former_hash
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import ALGORITHMS, expected_hash

FORMER = Path(__file__).with_name("former")
TINY = {"mesh.flank": 3, "mesh.thickness": 1, "mesh.root": 2, "mesh.rim": 1, "mesh.width": 2}
TINY |= {"modes": 31, "roll_points": 5, "width_functions": 3}
PAIR = {f"gears.pinion.body.{field}": value for field, value in TINY.items()}
RING = {f"ring.body.{field}": value for field, value in TINY.items()}
MADE = {"pinion": ("fzg_c", PAIR), "ring": ("planetary54", RING), "carrier": ("helical_set", {})}


def moved(name: str, folder: Path) -> Stage:
    """The stage of a file in `former/`, with that file and the shipped ones of its other bodies in `folder`."""
    shipped, changes = MADE[name]
    stage = load_stage(shipped, changes)
    for file in stage.files:
        own = FORMER / f"{file}.h5" if file == name else body_path(load_stage(shipped), file)
        shutil.copy(own, folder / f"{file}.h5")
    return stage


@pytest.mark.parametrize("name", list(MADE))
def test_a_former_file_is_adopted_and_written_anew_once(name: str, tmp_path: Path) -> None:
    """Loaded, it has the hash of today; reduced, it is not made again, and its numbers stay."""
    stage = moved(name, tmp_path)
    path = tmp_path / f"{name}.h5"
    old, before = load_body(path), path.read_bytes()
    assert (old.how.hash, old.how.algorithm) == (former_hash(stage, name), 2)
    loaded = load_bodies(stage, tmp_path)[stage.files.index(name)]
    assert loaded.how == replace(
        old.how, hash=expected_hash(stage, name), algorithm=ALGORITHMS[stage.by_file[name].kind]
    )
    assert path.read_bytes() == before, "a reader writes nothing"
    reduce_bodies(stage, tmp_path)
    assert format_of(path)[1] == FORMAT_VERSION
    again = load_body(path)
    assert again.how == loaded.how
    for entry in entries_of(old):
        assert np.array_equal(value_of(again, entry.field), value_of(old, entry.field)), entry.path
    written = path.read_bytes()
    reduce_bodies(stage, tmp_path)
    assert path.read_bytes() == written


@pytest.mark.parametrize("name", list(MADE))
def test_a_former_file_of_other_numbers_is_stale(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.h5"
    moved(name, tmp_path)
    shipped, changes = MADE[name]
    place = "gears.pinion" if name == "pinion" else name
    other = load_stage(shipped, changes | {f"{place}.modal_damping": 0.02})
    with pytest.raises(BodyError, match="stale: made by version 2 of the reduction, this program has version 3"):
        load_bodies(other, tmp_path)
    body = load_body(path)
    save_body(replace(body, how=replace(body.how, algorithm=3)), path)
    with pytest.raises(BodyError, match="stale: made from other numbers"):
        load_bodies(other, tmp_path)
