"""Rolling bearings in stage files: what is wrong is refused with field, value and remedy, all at once; files without
them are what they were."""

from __future__ import annotations

from pathlib import Path

import pytest
from refused import refused

from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import differences, restored, stored

TRAIN, PAIR = "two_stage/stage_bearings", "helical_demo/stage_bearings"


def problems(folder: Path, like: str, *changes: tuple[str, str]) -> dict[str, str]:
    """Field → remedy of everything that is wrong."""
    source = find_stage(like)
    text = source.read_text(encoding="utf-8").replace(
        'base = "stage.toml"', f'base = "{source.parent.as_posix()}/stage.toml"'
    )
    return {problem.field: problem.remedy for problem in refused(folder, text, *changes)}


def test_all_is_said_at_once(tmp_path: Path) -> None:
    found = problems(
        tmp_path,
        TRAIN,
        ('[operating]\ntorque = "100 N*m"', ""),
        ('bearing = "6306"', 'bearing = "63O6"'),
        ('bearing = "NU210"', 'bearing = "NU210"\ntilt = "1e4 N*m/rad"'),
        ('clearance = "12 um"', 'clearance = "12"'),
    )
    assert set(found) == {
        "operating.torque", "supports.input_left.bearing", "supports.output_right.tilt", "bearings.6210.clearance",
    }  # fmt: skip


def test_springs_of_a_base_are_left_aside() -> None:
    pinion = load_stage(PAIR).written.gears[0].bearing
    assert (pinion.rolling, pinion.span, pinion.damping_ratio) == ("7305", pytest.approx(0.07), 0.03)


@pytest.mark.parametrize("like", [TRAIN, PAIR])
def test_a_copy_and_a_stored_stage_say_the_same(tmp_path: Path, like: str) -> None:
    """`gearfmu new --like`, and what an FMU holds of its stage."""
    own = load_stage(like)
    assert {field for field, *_ in differences(own, load_stage(new_stage("mine", like, tmp_path)))} == {"name"}
    assert not differences(own, restored(stored(own.written), own.source))


def test_directions_of_rolling_bearings_count(tmp_path: Path) -> None:
    """Balls hold five directions and rollers four; the kernel has room for 256."""
    supports = "\n".join(
        f'[[supports]]\nname = "more{k}"\nbody = "input_shaft"\nat = "{10 + k} mm"\nbearing = "NU206"'
        for k in range(52)
    )
    found = problems(tmp_path, TRAIN, ("[[supports]]", f"{supports}\n\n[[supports]]"))
    assert "256 directions" in found["supports"]
