"""Trace: round trip, checks, whole-or-nothing writing."""

from __future__ import annotations

import csv
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gearfmu.files import seal
from gearfmu.stage.run.trace import Channel, Trace, TraceError

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def example(n: int = 50) -> Trace:
    t = np.arange(n) * 1e-4
    channels = {
        "mesh.force": Channel(np.sin(t), "N", "normal force"),
        "clutch.locked": Channel(t > 2e-3, "", "true while the clutch sticks"),
        "mesh.pairs": Channel(np.arange(n) % 3, "", "tooth pairs in contact"),
    }
    return Trace(t, channels, {"scene": "x", "n_dyn": np.int64(28), "h": 1e-5, "hashes": {"wheel": "ab"}})


@settings(max_examples=20)
@given(
    values=hnp.arrays(np.float64, 7, elements=FINITE),
    unit=st.text(min_size=0, max_size=5).filter(lambda s: "\0" not in s),
)
def test_file_round_trip_is_bitwise(tmp_path_factory: pytest.TempPathFactory, values: np.ndarray, unit: str) -> None:
    path = tmp_path_factory.mktemp("t") / "trace.h5"
    trace = Trace(np.arange(7.0), {"a.b": Channel(values, unit, "µm ± 1")}, {"k": [1, 2.5, "ü", None]})
    trace.save(path)
    back = Trace.load(path)
    assert back["a.b"].tobytes() == values.tobytes()
    assert (back.channels["a.b"].unit, back.channels["a.b"].description) == (unit, "µm ± 1")
    assert back.meta == trace.meta


def test_types_order_and_meta_survive(tmp_path: Path) -> None:
    example().save(tmp_path / "new" / "trace.h5")
    back = Trace.load(tmp_path / "new" / "trace.h5")
    assert list(back.channels) == ["mesh.force", "clutch.locked", "mesh.pairs"]
    assert back["clutch.locked"].dtype == bool and back["mesh.pairs"].dtype.kind == "i"
    assert back.meta["n_dyn"] == 28 and back.meta["hashes"] == {"wheel": "ab"}


def test_layout_is_the_documented_one(tmp_path: Path) -> None:
    example().save(tmp_path / "trace.h5")
    with h5py.File(tmp_path / "trace.h5") as file:
        assert file["time"].attrs["unit"] == "s"
        assert file["channels/mesh.force"].attrs["unit"] == "N"
        assert file["channels/mesh.force"].attrs["description"] == "normal force"


def test_all_problems_are_named_at_once() -> None:
    bad = {"short": Channel(np.zeros(3)), "a/b": Channel(np.zeros(4)), "wild": Channel(np.array([0, 0, np.nan, 0]))}
    with pytest.raises(TraceError) as caught:
        Trace(np.array([0.0, 1, 1, 2]), bad)
    for part in ("strictly increasing", "'short'", "'a/b'", "'wild' is not finite at t = 1 s"):
        assert part in str(caught.value)


def test_unknown_channel_names_the_known() -> None:
    with pytest.raises(TraceError, match="no channel 'mesh.forse'.*mesh.force"):
        example()["mesh.forse"]


def test_csv_reads_back_to_the_same_doubles(tmp_path: Path) -> None:
    trace = example()
    trace.to_csv(tmp_path / "t.csv", ["mesh.force", "clutch.locked"])
    rows = list(csv.reader((tmp_path / "t.csv").open(encoding="utf-8")))
    assert rows[0] == ["time_[s]", "mesh.force_[N]", "clutch.locked"]
    assert [float(r[1]) for r in rows[1:]] == trace["mesh.force"].tolist()
    assert {r[2] for r in rows[1:]} == {"0", "1"}


def test_window_keeps_both_ends() -> None:
    part = example().window(1e-3, 2e-3)
    assert (part.time[0], part.time[-1], part.time.size) == (pytest.approx(1e-3), pytest.approx(2e-3), 11)


def rewritten(path: Path, change: Callable[[h5py.File], None]) -> Path:
    """The file changed, and its seal made good again."""
    with h5py.File(path, "a") as file:
        change(file)
    seal(path)
    return path


def test_bad_files_give_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "trace.h5"
    with pytest.raises(TraceError, match="trace.h5: no such trace file; make it again with 'gearfmu run'"):
        Trace.load(path)
    path.write_text("time,force\n")
    with pytest.raises(TraceError, match="trace.h5: no trace file"):
        Trace.load(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda file: file.attrs.__setitem__("format", "x"), "not a gearfmu trace"),
        (lambda file: file.attrs.__setitem__("format_version", 99), "trace format 99, this gearfmu reads"),
        (lambda file: file["channels/mesh.force"].attrs.__delitem__("unit"), "no sound trace file"),
        (lambda file: file.__delitem__("time"), "no sound trace file"),
        (lambda file: file["time"].__setitem__(3, np.nan), "time is not strictly increasing and finite"),
    ],
    ids=["other", "newer", "no_unit", "no_time", "nan"],
)
def test_files_that_say_something_else_are_refused_by_name(tmp_path: Path, change: Callable, words: str) -> None:
    example(5000).save(tmp_path / "trace.h5")
    with pytest.raises(TraceError, match=f"trace.h5: .*{words}"):
        Trace.load(rewritten(tmp_path / "trace.h5", change))


def test_every_damaged_byte_is_noticed(tmp_path: Path) -> None:
    example(300).save(tmp_path / "trace.h5")
    whole, dice = (tmp_path / "trace.h5").read_bytes(), np.random.default_rng(1)
    for place in (*range(0, 600, 7), *dice.integers(0, len(whole), 100)):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(dice.integers(8))
        (tmp_path / "trace.h5").write_bytes(damaged)
        with pytest.raises(TraceError, match="trace.h5"):
            Trace.load(tmp_path / "trace.h5")


WRITER = """
import sys, numpy as np
from gearfmu.stage.run.trace import Channel, Trace
big = Trace(np.arange(200_000.0), {f"c{i}": Channel(np.random.default_rng(i).normal(size=200_000)) for i in range(20)})
print("ready", flush=True)
while True:
    big.save(sys.argv[1])
"""


def test_kill_while_writing_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "trace.h5"
    example().save(path)
    old = path.read_bytes()
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        while not [p for p in tmp_path.iterdir() if p != path and p.stat().st_size > 0]:
            time.sleep(0.001)
        writer.kill()
    assert path.read_bytes() == old
    Trace.load(path)
