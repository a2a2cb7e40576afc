"""What a blob says about axes that turn and teeth that deviate: each rule refused by name, in memory that does not end
where the blob does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from small_model import pair_blob

from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import read_blob, write_blob


def changed(**sections: Any) -> bytes:
    """The small pair's blob with other sections; None takes one away."""
    known: Mapping[str, Any] = read_blob(pair_blob()) | sections
    return write_blob({name: value for name, value in known.items() if value is not None})


def ints(*values: int) -> np.ndarray:
    return np.array(values, np.int32)


ROWS = np.zeros((1, 2, len(read_blob(pair_blob())["omega_ground0"])))
CARRIED = {"carried": ints(0), "carried_place": np.zeros((1, 2)), "carried_rows0": ROWS}


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"frame": ints(2, -1)}, "frames are out of range"),
        ({"frame": ints(0, -1)}, "frames are out of range"),
        ({"frame": ints(1, 0)}, "frames are out of range"),
        ({"frame": ints(-1, 0)}, "join gears that stand in different axes"),
        ({"frame": ints(-1, -1, -1)}, "frame has the wrong length"),
        ({"inertia": np.array([0.0, 1.0])}, "sit on a rotor that stands"),
        (CARRIED | {"carried": ints(2)}, "carried bodies are out of range"),
        (CARRIED | {"carried_place": None}, "places of carried bodies are missing"),
        (CARRIED | {"carried_rows0": None}, "motion of carried bodies is missing"),
        (CARRIED | {"carried_rows0": np.zeros((2, 2, 1))}, "carried_rows has the wrong length"),
        ({"support_turn": ints(*[0] * 50)}, "support_turn has the wrong length"),
        ({"tooth_shift": ints(10**6)}, "engagements are out of range"),
        ({"direction": np.array([9.0])}, "directions of engagements are out of range"),
    ],
)
def test_each_rule_of_turning_axes(sections: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Kernel(changed(**sections))


def test_axes_that_nothing_uses_are_read() -> None:
    sets = {name.replace("omega_ground", "carried_rows"): np.zeros((1, 2, len(value)))
            for name, value in read_blob(pair_blob()).items() if name.startswith("omega_ground")}  # fmt: skip
    kernel = Kernel(changed(frame=ints(-1, -1), tooth_shift=ints(3), **CARRIED | sets))
    assert "effect.coriolis" in kernel.variables


DEPTH = {"flank_size0": ints(1, 1, 4), "flank0": np.zeros((1, 2, 1, 4))}


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        (DEPTH | {"flank_size0": ints(3, 1, 4)}, "sizes of the deviations"),
        (DEPTH | {"flank0": np.zeros(7)}, "flank has the wrong length"),
        (DEPTH | {"flank_size0": None}, "are not whole|wrong length"),
        (DEPTH | {"flank0": None}, "are not whole|wrong length"),
        ({"runout0": np.zeros(3)}, "runout has the wrong length"),
        ({"index0": np.zeros(31)}, "index has the wrong length"),
        ({"index0": np.zeros(33)}, "index has the wrong length"),
        ({"index0": np.full(32, 0.1)}, "index deviations"),
    ],
)
def test_each_rule_of_deviations(sections: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Kernel(changed(**sections))


def test_deviations_of_either_sign_are_read() -> None:
    assert Kernel(changed(**DEPTH | {"index0": np.full(32, -1e-3), "runout0": np.zeros(4)})).hash
