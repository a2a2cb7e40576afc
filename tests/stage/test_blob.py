"""The model blob in Python: what is written is read back, one content has one sequence of bytes,
and what is wrong is said."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from evidence.sources import rounded_hash
from gearfmu.errors import ModelError
from gearfmu.stage.assembly.blob import ENTRY, read_blob, write_blob

SAMPLE = {
    "name": "fzg_c µm",
    "roll": np.linspace(0.01, 0.02, 7),
    "teeth": np.array([16, 24]),
    "empty": np.zeros(0),
    "flags": np.array([True, False]),
}

names = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=23)
values = st.one_of(
    st.text(st.characters(min_codepoint=1, codec="utf-8"), max_size=70),
    stn.arrays(
        np.float64,
        stn.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=9),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    ),
    stn.arrays(np.int32, st.integers(0, 40)),
)


@settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])  # a first draw may take seconds
@given(st.dictionaries(names, values, max_size=8))
def test_what_is_written_is_read_back(sections: dict) -> None:
    blob = write_blob(sections)
    back = read_blob(blob)
    assert list(back) == list(sections)
    for name, value in sections.items():
        if isinstance(value, str):
            assert back[name] == value
        else:
            assert back[name].tobytes() == value.tobytes() and back[name].dtype == value.dtype
    assert write_blob(back) == blob


def test_what_is_long_and_there_already_is_stored_once() -> None:
    long, short = np.linspace(0.0, 1.0, 512), np.linspace(0.0, 1.0, 511)
    one = write_blob({"a": long})
    assert len(write_blob({"a": long, "b": long})) == len(one) + ENTRY.size + 16  # a table entry, and alignment
    assert len(write_blob({"a": short, "b": short})) > len(one) + 8 * 511
    back = read_blob(write_blob({"a": long, "b": 1.0 * long, "c": long.reshape(2, 256)}))
    assert all(np.array_equal(back[name], long) for name in "abc")


def test_all_problems_of_a_write_at_once() -> None:
    bad = {
        "": np.zeros(1),
        "a name with spaces": np.zeros(1),
        "x" * 24: np.zeros(1),
        "inf": np.array([1.0, np.inf, np.nan]),
        "big": np.array([2**31]),
        "complex": np.array([1j]),
        "nul": "a\0b",
    }
    with pytest.raises(ModelError) as caught:
        write_blob(bad)
    for part in (
        "''",
        "'a name with spaces'",
        "x" * 24,
        "2 of 3 values",
        "'big': integers beyond 32 bits",
        "'complex'",
        "'nul': text contains NUL",
    ):
        assert part in str(caught.value)


def test_a_rounded_hash_sees_what_a_stage_changes_and_no_rounding() -> None:
    """Noise of the last digits and a rotation of modes of equal frequency are the same model."""
    large = np.random.default_rng(1).normal(size=(2, 500))
    sample = SAMPLE | {"rows": large}
    turned = np.array([[0.6, -0.8], [0.8, 0.6]]) @ large

    def hashed(**changed: object) -> str:
        return rounded_hash(write_blob(sample | changed))

    assert hashed() == hashed(rows=turned) == hashed(roll=SAMPLE["roll"] * (1 + 1e-12))
    others = {"rows": 1.001 * large, "roll": SAMPLE["roll"] * 1.001, "teeth": np.array([16, 25]), "name": "fzg_b"}
    assert len({hashed(), *(hashed(**{name: value}) for name, value in others.items())}) == 5
