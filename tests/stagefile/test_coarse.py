"""The coarse sister of a stage: the same stage but for its element counts, under fingerprints of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearfmu.body import body_hashes
from gearfmu.stagefile.proposals.coarse import SCALE, coarse_stage
from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.stage import load_stage


@pytest.mark.parametrize("like", ["fzg_c/stage_relief", "two_stage", "planetary54"])
def test_the_sister_differs_in_its_counts_alone(like: str, tmp_path: Path) -> None:
    own = load_stage(new_stage("mine", like, tmp_path))
    path = coarse_stage(tmp_path / "mine")
    assert path == tmp_path / "mine" / "coarse" / "stage.toml"
    coarse = load_stage(path)
    assert coarse.name == "mine_coarse" and all(g.body.mesh.scale == SCALE for g in coarse.gears)
    shared = [field for field in type(own).model_fields if field not in ("name", "description", "source")]
    differing = {field for field in shared if getattr(own, field) != getattr(coarse, field)}
    assert differing <= {"gears", "bodies", "sun", "planet", "ring", "carrier"}
    for one, other in zip(own.gears, coarse.gears, strict=True):
        fine = other.body.mesh.model_copy(update={"scale": one.body.mesh.scale})
        assert other.model_copy(update={"body": other.body.model_copy(update={"mesh": fine})}) == one
    assert not set(body_hashes(own)) & set(body_hashes(coarse))


def test_the_sister_follows_its_stage_and_lies_where_it_is_wanted(tmp_path: Path) -> None:
    path = new_stage("mine", "fzg_c", tmp_path)
    coarse_stage(path)
    text = path.read_text(encoding="utf-8").replace("# scale = 1.0", "scale = 1.2").replace('"0.1 mm"', '"0.12 mm"')
    path.write_text(text.replace('"0.10 mm"', '"0.12 mm"'), encoding="utf-8")
    elsewhere = coarse_stage(path, tmp_path / "other" / "place")
    for made in (coarse_stage(path), elsewhere):
        spec = load_stage(made)
        assert spec.gears[0].body.mesh.scale == pytest.approx(0.6) and spec.written.pair.backlash == pytest.approx(
            1.2e-4
        )
    assert elsewhere == tmp_path / "other" / "place" / "stage.toml"
