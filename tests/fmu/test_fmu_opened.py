"""An FMU is read again without its stage file; whatever is missing, damaged or of another model is refused by name."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest
from small_stage import small_model

from gearfmu.errors import BodyError, FmuError, SpecError
from gearfmu.fmu import export
from gearfmu.fmu.opened import read_fmu
from gearfmu.fmu.package import write_archive
from gearfmu.fmu.stage_file import MODEL_FILE, STAGE_FILE, stage_file
from gearfmu.fmu.validate import _stage as stage_findings
from gearfmu.stage.assembly.model import StageModel
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.reading.files import shipped_stages
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import restored, stored

TOPOGRAPHY = "roll_mm,z_mm,deviation_um\n10,-5,0\n10,5,0\n20,-5,3\n20,5,3\n"


@pytest.fixture(scope="module")
def members(native: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(native) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def changed(members: dict[str, bytes], folder: Path, **changes: bytes | None) -> Path:
    """An FMU with another `stage` or `model`, or without where None."""
    own = {{"stage": STAGE_FILE, "model": MODEL_FILE}[key]: content for key, content in changes.items()}
    return write_archive(
        folder / "changed.fmu", {name: own.get(name, old) for name, old in members.items() if own.get(name, old)}
    )


def with_field(members: dict[str, bytes], field: str, value: object) -> bytes:
    return json.dumps(json.loads(members[STAGE_FILE]) | {field: value}).encode()


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_an_fmu_gives_back_its_model_and_its_stage(runtime: str, model: StageModel, request) -> None:
    path = request.getfixturevalue(runtime)
    opened = read_fmu(path)
    assert (opened.model.blob, opened.model.bodies, opened.model.shafts) == (model.blob, model.bodies, model.shafts)
    assert opened.model.stage == model.stage.model_copy(update={"source": path})
    assert opened.problems_of(model.stage) == [] and opened.observed == () and opened.files == {}


@pytest.mark.parametrize("name", shipped_stages())
def test_every_shipped_stage_survives_json(name: str) -> None:
    """But for the folders of its files."""
    spec = load_stage(name)
    again = restored(json.loads(json.dumps(stored(spec.written))), spec.source)
    assert stored(again.written) == stored(spec.written)
    assert again == spec or spec.housings


def test_the_file_says_what_a_person_asks_first(members: dict[str, bytes], model: StageModel) -> None:
    facts = json.loads(members[STAGE_FILE])
    assert facts["teeth"] == {"pinion": 16, "wheel": 24} and facts["ratio"] == -1.5 and facts["level"] == "standard"
    assert facts["meshes"]["mesh"]["torque_max"] == model.stage.written.torque_max
    assert facts["hashes"] == {"model": model.hash, "bodies": model.bodies}
    fast = json.loads(stage_file(model.with_starts({"level": 1.0})))
    assert fast["level"] == "fast" and fast["hashes"]["model"] != model.hash


def test_places_of_files_are_no_part_of_it(tmp_path: Path) -> None:
    """One stage in two folders gives the same bytes; another topography is another stage."""
    folders = [tmp_path / name for name in ("here", "there", "else")]
    for folder in folders:
        folder.mkdir()
        (folder / "wheel.csv").write_text(TOPOGRAPHY.replace("3\n", "4\n") if folder.name == "else" else TOPOGRAPHY)
    base = small_model("fzg_c")
    here, there, other = (StageModel(_measured(base.stage, folder), base.blob, base.body_hashes) for folder in folders)
    assert stage_file(here) == stage_file(there) != stage_file(other)
    assert not any(str(tmp_path).encode() in stage_file(model) for model in (here, there, other))
    opened = read_fmu(export(here, tmp_path / "measured.fmu"))
    assert opened.model.stage.written.gears[1].topography == "wheel.csv" and opened.problems_of(there.stage) == []
    assert [problem.field for problem in opened.problems_of(other.stage)] == ["files"]


def _measured(spec, folder: Path):
    pinion, wheel = spec.written.gears
    wheel = wheel.model_copy(update={"topography": str(folder / "wheel.csv")})
    return rewritten(spec, gears=(pinion, wheel), source=folder / "stage.toml")


def test_another_stage_is_told_by_its_fields(native: Path) -> None:
    opened = read_fmu(native)
    (relief,) = opened.problems_of(load_stage("fzg_c/stage_relief", {"gears.wheel.tip_relief.amount": "11 um"}))
    assert relief.field == "gears.wheel.tip_relief.amount" and relief.file == str(native)
    many = opened.problems_of(load_stage("planetary54"))
    assert len(many) == 6 and "more differences" in many[-1].remedy


def test_bodies_of_another_stage_are_refused(native: Path) -> None:
    """The small model has invented bodies."""
    with pytest.raises(BodyError, match="has other bodies"):
        read_fmu(native).with_bodies(load_stage("fzg_c/stage_relief"))


def test_changed_damaged_and_missing_members_are_refused(members, other_model, tmp_path: Path) -> None:
    without = {key: value for key, value in json.loads(members[STAGE_FILE]).items() if key not in ("teeth", "stage")}
    sealed = "was changed after the export"
    cases = [
        ({"stage": with_field(members, "format", "gearfmu-body")}, "is not of format gearfmu-stage: export it again"),
        ({"stage": with_field(members, "format_version", 2)}, "format_version = 2: this program reads version 1"),
        ({"stage": with_field(members, "teeth", {"pinion": 31, "wheel": 73})}, sealed),
        ({"stage": with_field(members, "sha256", "0")}, sealed),
        ({"stage": None}, "resources/stage.json: is missing, so that nothing says which stage this is: export it"),
        ({"stage": members[STAGE_FILE][:-9]}, "is no JSON"),
        ({"stage": b"[]"}, "is not of format"),
        ({"stage": b"\xff"}, "is no JSON"),
        ({"stage": json.dumps(without).encode()}, "teeth, stage missing: export it again"),
        ({"stage": stage_file(other_model)}, "the model beside it is"),
        ({"model": None}, "resources/model.gkb is missing"),
        ({"model": members[MODEL_FILE][:-64]}, "resources/model.gkb: "),
    ]
    for changes, message in cases:
        with pytest.raises(FmuError, match=message):
            read_fmu(changed(members, tmp_path, **changes))


def test_a_stage_that_this_version_does_not_know_is_refused(members, model, tmp_path: Path, monkeypatch) -> None:
    """As from another version of the program: the seal is right, the fields are not."""
    monkeypatch.setattr("gearfmu.fmu.stage_file.stored", lambda spec: {**stored(spec), "kindness": 1, "torque_max": -1})
    path = changed(members, tmp_path, stage=stage_file(model))
    with pytest.raises(FmuError, match=r"torque_max = -1: out of range[\s\S]*kindness"):
        read_fmu(path)


def test_what_is_no_fmu_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.fmu").write_text("no zip")
    for name, message in (("text.fmu", "cannot be read as an FMU"), ("none.fmu", "No such file")):
        with pytest.raises(FmuError, match=message):
            read_fmu(tmp_path / name)


def test_validate_looks_at_the_stage(members, model, other_model, tmp_path: Path) -> None:
    (tmp_path / "resources").mkdir()
    assert not list(stage_findings(tmp_path, SimpleNamespace(guid="of another maker")))
    (tmp_path / MODEL_FILE).write_bytes(model.blob)
    assert [found[:2] for found in stage_findings(tmp_path, SimpleNamespace())] == [(STAGE_FILE, "is missing")]
    guid, stale = "modelDescription.xml: guid", other_model.guid
    for content, named, field, words in (
        (stage_file(model), model.guid, None, ""),
        (stage_file(model), stale, guid, f"that of the model is {model.guid}: export the FMU again"),
        (stage_file(other_model), model.guid, f"{STAGE_FILE}: hashes.model", f"is {model.hash}: export the FMU again"),
        (with_field(members, "teeth", {}), model.guid, "", f"{STAGE_FILE}: was changed after the export"),
    ):
        (tmp_path / STAGE_FILE).write_bytes(content)
        found = list(stage_findings(tmp_path, SimpleNamespace(guid=named)))
        assert [f for f, _, _ in found] == ([] if field is None else [field])
        assert all(words in remedy for _, _, remedy in found)


def test_files_that_cannot_be_read_are_named(model: StageModel, tmp_path: Path) -> None:
    lost = StageModel(_measured(model.stage, tmp_path), model.blob, model.body_hashes)
    with pytest.raises(SpecError, match="wheel.csv: cannot be read"):
        stage_file(lost)
