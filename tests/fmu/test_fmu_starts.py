"""FMUs that start with other parameters than the table's, and without the file of terminals."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from small_stage import small_model, unpack

from gearfmu.errors import ModelError
from gearfmu.fmu import export, validate
from gearfmu.fmu.probes import Subject
from gearfmu.stage import StageModel
from gearfmu.stage.blob import read_blob, write_blob

STARTS = {"level": 1.0, "slices": 3.0, "backlash": 5e-5, "effect.hertz": 0.0}


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_start_values_are_those_of_the_description_and_of_the_binary(
    model: StageModel, tmp_path: Path, runtime: str
) -> None:
    """Set by nobody they give the run that setting them gives, to the bit; `validate` compares both tables."""
    path = export(model.with_starts(STARTS), tmp_path / "fast.fmu", runtime=runtime)
    assert validate(path) == []
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
        StageModel(model.spec, write_blob(bad), ()).kernel()


def test_without_terminals_there_is_no_such_file(model: StageModel, tmp_path: Path) -> None:
    path = export(model, tmp_path / "plain.fmu", terminals=False)
    assert not [name for name in zipfile.ZipFile(path).namelist() if "terminals" in name] and validate(path) == []
