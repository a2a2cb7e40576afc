"""Traces in the formats of other programs: what is read back is what was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gearfmu as gf
from gearfmu import cli
from gearfmu.stage.run.exchange import WRITERS, matlab_names
from gearfmu.stage.run.trace import TraceError

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
