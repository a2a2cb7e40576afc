"""What a blob says about the tables of flanks: each rule refused by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from small_model import pair_blob

from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import SIZES, read_blob, write_blob

SECTIONS = read_blob(pair_blob())
Change = Callable[[Any], Any]


def sized(name: str, value: int) -> Change:
    """The section "size" with another number."""
    return lambda size: np.where(np.arange(size.size) == SIZES.index(name), value, size).astype(np.int32)


def shorter(values: np.ndarray) -> np.ndarray:
    return values[:-1]


def larger(values: np.ndarray) -> np.ndarray:
    return values + values.dtype.type(1e19)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("size0", sized("points", 0), "sizes of a gear are out of range"),
        ("size0", sized("points", 257), "sizes of a gear are out of range"),
        ("size0", sized("points", 5), "resample has the wrong length"),
        ("size0", sized("low", -1), "sizes of a gear are out of range"),
        ("size0", sized("low", 1001), "sizes of a gear are out of range"),
        ("size0", sized("low", 2), "low_rows has the wrong length"),
        ("size0", sized("mirrored", 2), "sizes of a gear are out of range"),
        ("size0", sized("mirrored", 1), "residual_own has the wrong length"),
        ("low_member1", lambda member: member * 0 + 1, "pairs of modes of nodal diameter 0 and 1 are out of range"),
        ("low_member1", lambda member: member * 0 + 2, "pairs of modes of nodal diameter 0 and 1 are out of range"),
        ("counts", lambda c: np.concatenate([c[:1] - 1, c[1:]]), "make the model again"),  # an older model
    ]
    + [
        (name, change, f"{name.rstrip('01_')} {words}")
        for name in ("resample0", "rows1", "low_rows0", "node1", "node_support0", "residual_own0", "residual_next1")
        + ("residual_across0", "port_residual1", "low_ground0_0", "node_ground1_1")
        for change, words in ((shorter, "has the wrong length"), (larger, "is out of range"))
    ],
)
def test_each_rule_of_flank_tables(name: str, change: Change, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Kernel(write_blob({**SECTIONS, name: change(SECTIONS[name])}))


@pytest.mark.parametrize("name", ["residual_own0", "rows1", "low_rows0", "node1", "residual_next1", "resample1"])
def test_what_is_missing_is_named(name: str) -> None:
    with pytest.raises(ModelError, match=f"{name[:-1]} is missing"):
        Kernel(write_blob({known: value for known, value in SECTIONS.items() if known != name}))
