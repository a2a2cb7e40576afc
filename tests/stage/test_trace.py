"""Trace: round trip, checks, whole-or-nothing writing; formats of other programs."""

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

import gearfmu as gf
from gearfmu import cli
from gearfmu.files import seal
from gearfmu.stage.run.exchange import WRITERS, matlab_names
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


# ---- in the formats of other programs: what is read back is what was written -----------------------------------------
STEP = 1 / 51200  # s: a step that six digits do not hold


@pytest.fixture
def trace() -> gf.Trace:
    time = STEP * np.arange(400)
    channels = {
        "mesh.force": gf.Channel(1e3 + np.sin(4e3 * time), "N", "Normal force · mean of all slices"),
        "bearing.pinion.fy": gf.Channel(np.cos(4e3 * time), "N", "y"),
        "pinion.gear.w": gf.Channel(200 + time, "rad/s", "speed"),
        "mesh.contact": gf.Channel(np.arange(400) % 3 - 1, "", "contact"),
        "clutch.locked": gf.Channel(time > 1e-3, "", "locked"),
    }
    return gf.Trace(time, channels, {"stage": "fzg_c", "scene": "made", "settle": 1e-3})


def test_matlab(trace: gf.Trace, tmp_path: Path) -> None:
    from scipy.io import loadmat

    found = loadmat(gf.convert(trace, tmp_path / "a.mat"), simplify_cells=True)
    assert np.array_equal(found["time"], trace.time) and np.array_equal(found["mesh_force"], trace["mesh.force"])
    assert found["unit"]["pinion_gear_w"] == "rad/s" and list(found["name"]) == list(trace.channels)
    assert found["mesh_contact"].dtype.kind == "i"


def test_matlab_names_are_all_different() -> None:
    long = "a" * 70
    names = matlab_names(["a.b", "a_b", "time", "3d", long, f"{long}b"])
    assert names[:4] == ["a_b", "a_b_2", "time_2", "c_3d"]
    assert len(set(names)) == len(names) and max(map(len, names)) <= 63


@pytest.mark.needs("pyarrow")
def test_parquet(trace: gf.Trace, tmp_path: Path) -> None:
    import pyarrow.parquet as parquet

    found = parquet.read_table(gf.convert(trace, tmp_path / "a.parquet", ["mesh.force", "clutch.locked"]))
    assert found.column_names == ["time", "mesh.force", "clutch.locked"]
    assert found["mesh.force"].to_pylist() == trace["mesh.force"].tolist()
    assert found.schema.field("mesh.force").metadata[b"unit"] == b"N"
    assert b"fzg_c" in found.schema.metadata[b"meta"]


@pytest.mark.needs("asammdf")
def test_mdf(trace: gf.Trace, tmp_path: Path) -> None:
    import asammdf

    with asammdf.MDF(gf.convert(trace, tmp_path / "a.mf4")) as file:
        for name, channel in trace.channels.items():
            found = file.get(name)
            assert np.array_equal(found.samples, channel.values) and np.array_equal(found.timestamps, trace.time)
            assert (found.unit, found.comment) == (channel.unit, channel.description)


@pytest.mark.needs("pyuff")
@pytest.mark.parametrize("step", [STEP, 2e-5])
def test_universal_file_format(trace: gf.Trace, tmp_path: Path, step: float) -> None:
    """Values to the bit; times too, though the format holds six digits of a step: those of other steps are listed."""
    import pyuff

    trace = gf.Trace(step * np.arange(400), trace.channels, trace.meta)
    file = pyuff.UFF(str(gf.convert(trace, tmp_path / "a.uff")))
    assert file.get_set_types().tolist() == [164] + [58] * 5
    force, bearing = file.read_sets(1), file.read_sets(2)
    assert np.array_equal(force["data"], trace["mesh.force"]) and np.allclose(force["x"], trace.time, rtol=1e-12)
    assert force["abscissa_spacing"] == (step == 2e-5)
    assert (force["id1"], force["ordinate_axis_units_lab"]) == ("mesh.force", "N")
    assert (bearing["rsp_ent_name"], bearing["rsp_dir"]) == ("bearing.pi", 2)
    assert force["rsp_node"] != bearing["rsp_node"] and force["func_type"] == 1


def test_views(trace: gf.Trace) -> None:
    table = trace.to_numpy(["mesh.force"])
    assert table.dtype.names == ("time", "mesh.force") and np.array_equal(table["mesh.force"], trace["mesh.force"])


@pytest.mark.needs("xarray")
def test_xarray_shares_the_numbers(trace: gf.Trace) -> None:
    found = trace.to_xarray()
    assert np.shares_memory(found["mesh.force"].values, trace["mesh.force"])
    assert found["mesh.force"].attrs == {"units": "N", "long_name": "Normal force · mean of all slices"}
    late = found.sel(time=slice(1e-3, 2e-3))
    assert np.array_equal(late["pinion.gear.w"].values, trace.window(1e-3, 2e-3)["pinion.gear.w"])


def test_what_cannot_be_written_is_told(trace: gf.Trace, tmp_path: Path) -> None:
    with pytest.raises(gf.GearfmuError, match="there are .csv, .mat, .mf4, .parquet, .uff, .unv"):
        gf.convert(trace, tmp_path / "a.xlsx")
    with pytest.raises(TraceError, match="no channel 'mesh.forc'"):
        gf.convert(trace, tmp_path / "a.csv", ["mesh.forc"])
    assert not list(tmp_path.iterdir())


def test_a_missing_package_is_named_with_its_extra(
    trace: gf.Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyuff", None)
    with pytest.raises(gf.GearfmuError, match=r"package pyuff: pip install 'gearfmu\[data\]'"):
        gf.convert(trace, tmp_path / "a.uff")


def test_the_verb_writes_the_same(trace: gf.Trace, tmp_path: Path) -> None:
    trace.save(tmp_path / "trace.h5")
    assert cli.outcome(["convert", str(tmp_path), str(tmp_path / "verb.csv"), "--channel", "mesh.force"]) == 0
    gf.convert(trace, tmp_path / "api.csv", ["mesh.force"])
    assert (tmp_path / "verb.csv").read_bytes() == (tmp_path / "api.csv").read_bytes()
    assert set(WRITERS) == {".csv", ".mat", ".mf4", ".parquet", ".uff", ".unv"}
