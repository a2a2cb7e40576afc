"""What a blob says about axes that turn, teeth that deviate and tables of flanks: each rule refused by name, in memory
that does not end where the blob does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from small_model import pair_blob

from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import SIZES, read_blob, write_blob

SECTIONS: Mapping[str, Any] = read_blob(pair_blob())
Change = Callable[[Any], Any]


def changed(**sections: Any) -> bytes:
    """The small pair's blob with other sections, or with functions of its own; None takes one away."""
    own = {name: value(SECTIONS[name]) if callable(value) else value for name, value in sections.items()}
    return write_blob({name: value for name, value in {**SECTIONS, **own}.items() if value is not None})


def ints(*values: int) -> np.ndarray:
    return np.array(values, np.int32)


def sized(name: str, value: int) -> Change:
    """The section "size" with another number."""
    return lambda size: np.where(np.arange(size.size) == SIZES.index(name), value, size).astype(np.int32)


def shorter(values: np.ndarray) -> np.ndarray:
    return values[:-1]


def larger(values: np.ndarray) -> np.ndarray:
    return values + values.dtype.type(1e19)


ROWS = np.zeros((1, 2, len(SECTIONS["omega_ground0"])))
CARRIED = {"carried": ints(0), "carried_place": np.zeros((1, 2)), "carried_rows0": ROWS}
DEPTH = {"flank_size0": ints(1, 1, 4), "flank0": np.zeros((1, 2, 1, 4))}
AXES: list[tuple[dict[str, Any], str]] = [
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
]
DEVIATIONS: list[tuple[dict[str, Any], str]] = [
    (DEPTH | {"flank_size0": ints(3, 1, 4)}, "sizes of the deviations"),
    (DEPTH | {"flank0": np.zeros(7)}, "flank has the wrong length"),
    (DEPTH | {"flank_size0": None}, "are not whole|wrong length"),
    (DEPTH | {"flank0": None}, "are not whole|wrong length"),
    ({"runout0": np.zeros(3)}, "runout has the wrong length"),
    ({"index0": np.zeros(31)}, "index has the wrong length"),
    ({"index0": np.zeros(33)}, "index has the wrong length"),
    ({"index0": np.full(32, 0.1)}, "index deviations"),
]
TABLES: list[tuple[dict[str, Any], str]] = [
    ({"size0": sized("points", 0)}, "sizes of a gear are out of range"),
    ({"size0": sized("points", 257)}, "sizes of a gear are out of range"),
    ({"size0": sized("points", 5)}, "resample has the wrong length"),
    ({"size0": sized("low", -1)}, "sizes of a gear are out of range"),
    ({"size0": sized("low", 1001)}, "sizes of a gear are out of range"),
    ({"size0": sized("low", 2)}, "low_rows has the wrong length"),
    ({"size0": sized("mirrored", 2)}, "sizes of a gear are out of range"),
    ({"size0": sized("mirrored", 1)}, "residual_own has the wrong length"),
    ({"low_member1": lambda member: member * 0 + 1}, "pairs of modes of nodal diameter 0 and 1 are out of range"),
    ({"low_member1": lambda member: member * 0 + 2}, "pairs of modes of nodal diameter 0 and 1 are out of range"),
    ({"counts": lambda c: np.concatenate([c[:1] - 1, c[1:]])}, "make the model again"),  # an older model
]
TABLES += [
    ({name: change}, f"{name.rstrip('01_')} {words}")
    for name in ("resample0", "rows1", "low_rows0", "node1", "node_support0", "residual_own0", "residual_next1")
    + ("residual_across0", "port_residual1", "low_ground0_0", "node_ground1_1")
    for change, words in ((shorter, "has the wrong length"), (larger, "is out of range"))
]
MISSING: list[tuple[dict[str, Any], str]] = [
    ({name: None}, f"{name[:-1]} is missing")
    for name in ("residual_own0", "rows1", "low_rows0", "node1", "residual_next1", "resample1")
]


@pytest.mark.parametrize(("sections", "words"), AXES + DEVIATIONS + TABLES + MISSING)
def test_each_rule_of_axes_deviations_and_tables(sections: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Kernel(changed(**sections))


def test_axes_that_nothing_uses_are_read() -> None:
    sets = {name.replace("omega_ground", "carried_rows"): np.zeros((1, 2, len(value)))
            for name, value in SECTIONS.items() if name.startswith("omega_ground")}  # fmt: skip
    kernel = Kernel(changed(frame=ints(-1, -1), tooth_shift=ints(3), **CARRIED | sets))
    assert "effect.coriolis" in kernel.variables


def test_deviations_of_either_sign_are_read() -> None:
    assert Kernel(changed(**DEPTH | {"index0": np.full(32, -1e-3), "runout0": np.zeros(4)})).hash
