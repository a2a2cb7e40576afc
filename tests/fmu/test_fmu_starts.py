"""FMUs that start with other parameters than the table's, and without the file of terminals."""

from __future__ import annotations

import csv
import zipfile
from pathlib import Path

import fmpy
import pytest
from small_stage import small_model, unpack

import gearfmu as gf
from evidence.fmu_probes.everything import findings
from evidence.fmu_probes.probes import Subject
from gearfmu import cli
from gearfmu.api.results import with_windup
from gearfmu.errors import ModelError
from gearfmu.fmu import export
from gearfmu.stage import StageModel
from gearfmu.stage.assembly.blob import read_blob, write_blob

STARTS = {"level": 1.0, "slices": 3.0, "backlash": 5e-5, "effect.hertz": 0.0}


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_start_values_are_those_of_the_description_and_of_the_binary(
    model: StageModel, tmp_path: Path, runtime: str
) -> None:
    """Set by nobody they give the run that setting them gives, to the bit; `validate` compares both tables."""
    path = export(model.with_starts(STARTS), tmp_path / "fast.fmu", runtime=runtime)
    assert findings(path, ("kernel_table", "start_values")) == []
    subject = Subject(unpack(path, tmp_path / "fast"))
    declared = {v.name: v.start for v in subject.variables if v.name in STARTS}
    assert declared == {"level": "1", "slices": "3", "backlash": "5e-05", "effect.hertz": "false"}
    own = subject.initialized().run()
    subject.close()
    plain = Subject(unpack(export(model, tmp_path / "plain.fmu", runtime=runtime), tmp_path / "plain"))
    references = {v.name: v.valueReference for v in plain.variables}
    plain.fmu.setReal([references["backlash"]], [5e-5])
    plain.fmu.setInteger([references["level"], references["slices"]], [1, 3])
    plain.fmu.setBoolean([references["effect.hertz"]], [False])
    assert plain.initialized().run() == own
    plain.close()


def test_starts_are_part_of_the_model_and_can_be_changed_again(model: StageModel) -> None:
    fast = model.with_starts({"level": 1.0})
    assert fast.hash != model.hash and fast.with_starts({"level": 1.0}) == fast
    again = fast.with_starts({"level": 3.0, "slices": 2.0})
    assert [again.kernel().get(name) for name in ("level", "slices")] == [3.0, 2.0]
    assert model.with_starts({}) == model


@pytest.mark.parametrize("starts", [{"level": 9.0}, {"slices": 2.5}, {"nonsense": 1.0}, {"pinion.phi": 1.0}])
def test_starts_that_cannot_be_are_refused(model: StageModel, starts: dict[str, float]) -> None:
    with pytest.raises(ModelError, match=next(iter(starts))):
        model.with_starts(starts)


@pytest.mark.parametrize("reference, value", [(1, 0.0), (46 * 256, 9.0), (49 * 256, 2.5), (13 * 256, 0.0)])
def test_the_kernel_refuses_a_model_with_starts_that_cannot_be(reference: int, value: float) -> None:
    """No variable, an item that there is not, a broken number, an output."""
    model = small_model()
    bad = read_blob(model.with_starts({"level": 1.0}).blob) | {"start_reference": [reference], "start_value": [value]}
    with pytest.raises(ModelError, match="starts"):
        StageModel(model.stage, write_blob(bad), ()).kernel()


def test_without_terminals_there_is_no_such_file(model: StageModel, tmp_path: Path) -> None:
    path = export(model, tmp_path / "plain.fmu", terminals=False)
    assert not [name for name in zipfile.ZipFile(path).namelist() if "terminals" in name] and findings(path, ()) == []


PORTS = [("spring", "spring"), ("torque", "spring"), ("spring", "torque"), ("spring", "fixed"), ("torque", "fixed")]


@pytest.mark.parametrize(("pinion", "wheel"), PORTS)
def test_windup_carries_the_torque_from_the_start(pinion: str, wheel: str) -> None:
    """Mesh force at the start under the listed values is T/r_b: over a pitch on average, here within its variation."""
    model, inputs = with_windup(gf.assemble("fzg_c", ports={"pinion": pinion, "wheel": wheel}), "200 N*m", "500 rpm")
    kernel = model.kernel()
    for name, value in inputs.items():
        kernel.set(name, value)
    kernel.initialize(0.0)
    force = 200.0 / model.stage.written.geometry.gears[0].r_b
    assert kernel.get("mesh.force") == pytest.approx(force, rel=0.05 if pinion == "spring" else 1e-3)
    assert set(inputs) <= {"pinion.phi", "pinion.w", "pinion.tau", "wheel.phi", "wheel.w", "wheel.tau"}


def test_export_lists_the_windup_beside_the_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Any importer starts loaded: here fmpy, whose values are those of the table."""
    path = tmp_path / "pair.fmu"
    call = ["export", "fzg_c", "--out", str(path), "--start", "torque=200 N*m", "--start", "level=rigid"]
    assert cli.outcome(call) == 0
    said = capsys.readouterr().out
    assert "pair_windup.csv" in said and "fmpy.simulate_fmu(" in said and "connect pinion.phi" in said
    with (tmp_path / "pair_windup.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    values = {row["variable"]: float(row["value"]) for row in rows}
    assert values["wheel.phi"] == pytest.approx(-200.0 * -24 / 16 / 40e3) and rows[0]["unit"] == "rad"
    found = fmpy.simulate_fmu(
        str(path), stop_time=2e-3, output_interval=1e-4, start_values=values, output=["pinion.tau"]
    )
    assert found["pinion.tau"].mean() == pytest.approx(-200.0, rel=0.05), "exerted on the outside"
    assert gf.export("fzg_c", tmp_path / "again.fmu", torque=200, level="rigid").read_bytes() == path.read_bytes()
    assert (tmp_path / "again_windup.csv").read_bytes() == (tmp_path / "pair_windup.csv").read_bytes()
    assert cli.outcome([*call[:4], "--start", "speed=500 rpm"]) == 1
    assert "give the torque of the start too" in capsys.readouterr().err


def test_windup_refuses_ports_that_decide_the_torque() -> None:
    with pytest.raises(gf.GearfmuError, match="no fixed port, and ports without a clutch"):
        with_windup(gf.assemble("fzg_c", ports={"pinion": "fixed"}), 200.0, None)
