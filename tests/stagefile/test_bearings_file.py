"""Rolling bearings in stage files: what is wrong is refused with field, value and remedy, all at once; files without
them are what they were."""

from __future__ import annotations

from pathlib import Path

import pytest
from broken import problems

from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.reading.files import find_stage, read_layers
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import differences, restored, stored

TRAIN, PAIR = "two_stage/stage_bearings", "helical_demo/stage_bearings"
SUPPORTS = read_layers(find_stage(TRAIN)).tables["supports"]


def test_all_is_said_at_once() -> None:
    wrong = {"input_left": {"bearing": "63O6"}, "output_right": {"tilt": "1e4 N*m/rad"}}
    supports = [support | wrong.get(support["name"], {}) for support in SUPPORTS]
    found = problems({"operating": None, "bearings.6210.clearance": "12", "supports": supports}, TRAIN)
    assert set(found) == {
        "operating.torque", "supports.input_left.bearing", "supports.output_right.tilt", "bearings.6210.clearance",
    }  # fmt: skip


def test_directions_of_rolling_bearings_count() -> None:
    """Balls hold five directions and rollers four; the kernel has room for 256."""
    more = [{"name": f"more{k}", "body": "input_shaft", "at": f"{10 + k} mm", "bearing": "NU206"} for k in range(52)]
    assert "256 directions" in problems({"supports": more + SUPPORTS}, TRAIN)["supports"].remedy


def test_springs_of_a_base_are_left_aside() -> None:
    pinion = load_stage(PAIR).written.gears[0].bearing
    assert (pinion.rolling, pinion.span, pinion.damping_ratio) == ("7305", pytest.approx(0.07), 0.03)


@pytest.mark.parametrize("like", [TRAIN, PAIR])
def test_a_copy_and_a_stored_stage_say_the_same(tmp_path: Path, like: str) -> None:
    """`gearfmu new --like`, and what an FMU holds of its stage."""
    own = load_stage(like)
    assert {field for field, *_ in differences(own, load_stage(new_stage("mine", like, tmp_path)))} == {"name"}
    assert not differences(own, restored(stored(own.written), own.source))
