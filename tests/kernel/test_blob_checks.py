"""The kernel's checks of a blob: SHA-256 against hashlib, and each rule broken once; and its writer and reader in
Python."""

from __future__ import annotations

import hashlib
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn
from probes import Probes

from evidence.sources import rounded_hash
from gearfmu.errors import ModelError
from gearfmu.stage.assembly.blob import ENTRY, F32, F64, HEADER, I32, TEXT, blob_hash, read_blob, seal, write_blob

BAD_BLOB = 1
SAMPLE = {
    "name": "fzg_c µ",
    "roll": np.arange(1.0, 20.0),
    "teeth": np.array([16, -24]),
    "none": np.zeros(0),
    "more": np.full(8, -2.5),
}
BLOB = write_blob(SAMPLE)
SINGLE = write_blob({"single": np.full(16, -1.5, np.float32)})
LONG = np.arange(600.0)
REPEATING = write_blob({"long0": LONG, "other": LONG[:7], "long1": LONG, "long2": LONG})
TYPE, REPEATS, COUNT, OFFSET = 24, 28, 32, 40  # places in a table entry


def entry(i: int) -> int:
    return HEADER.size + i * ENTRY.size


def patched(place: int, data: bytes, blob: bytes = BLOB) -> bytes:
    return seal(blob[:place] + data + blob[place + len(data) :])


def test_opens_anywhere_on_8_bytes(probes: Probes) -> None:
    for shift in (0, 8, 16, 56):
        assert probes.blob_open(BLOB, shift) == (0, "", blob_hash(BLOB), len(SAMPLE))
    outcome, message, _, sections = probes.blob_open(BLOB, 4)
    assert outcome == BAD_BLOB and "aligned to 8 bytes" in message and sections == 0


def test_sections_are_found_by_name_and_type(probes: Probes) -> None:
    assert probes.blob_sum(BLOB, "roll", F64) == (190.0, 19)
    assert probes.blob_sum(BLOB, "teeth", I32) == (-8.0, 2)
    assert probes.blob_sum(BLOB, "none", F64) == (0.0, 0)
    assert probes.blob_sum(BLOB, "name", TEXT)[1] == len("fzg_c µ".encode()) + 1
    assert probes.blob_sum(SINGLE, "single", F32) == (-24.0, 16)
    assert probes.blob_sum(SINGLE, "single", F64) is None and probes.blob_sum(BLOB, "roll", F32) is None
    assert probes.blob_sum(BLOB, "roll", I32) is None
    assert probes.blob_sum(BLOB, "rol", F64) is None and probes.blob_sum(BLOB, "rolls", F64) is None


@pytest.mark.parametrize("length", [*range(0, 132), 1000, 10**6])
def test_sha256_of_every_padding_case(probes: Probes, length: int) -> None:
    blob = bytearray(write_blob({"t": "x" * length}))
    outcome, message, digest, _ = probes.blob_open(bytes(blob))
    assert (outcome, message) == (0, "") and digest == hashlib.sha256(blob[40:]).hexdigest()


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (BLOB[:10], "10 bytes are too few"),
        (b"GFMC" + BLOB[4:], "does not begin with GFMB"),
        (patched(4, b"\x01"), "format version 1, this kernel reads version 2: assemble the stage again"),
        (BLOB[:-64], "cut short"),
        (patched(40, struct.pack("<Q", len(BLOB) + 1)), "cut short"),
        (patched(48, struct.pack("<I", 2**32 - 1)), "sections do not fit"),
        (patched(48, struct.pack("<I", 1000)), "sections do not fit"),
        (patched(48, struct.pack("<I", 4)), "does not begin where"),
        (patched(63, b"\1"), "reserved bytes"),
        (BLOB[:-100] + b"\1" + BLOB[-99:], "do not match their SHA-256"),
        (patched(entry(1), b" "), "name of section 1"),
        (patched(entry(1), b"\0"), "name of section 1"),
        (patched(entry(1) + 20, b"x"), "name of section 1"),
        (patched(entry(0), b"y" * 24), "name of section 0"),
        (patched(entry(2), b"name\0"), "'name' is there twice"),
        (patched(entry(1) + TYPE, b"\5"), "'roll' is of unknown type 5"),
        (patched(entry(1) + TYPE + 4, b"\1"), "'roll' does not repeat an earlier one"),
        (patched(entry(2) + COUNT, struct.pack("<Q", 2**62)), "'teeth' reaches beyond the end"),
        (patched(entry(2) + COUNT, struct.pack("<Q", 2**64 - 1)), "'teeth' reaches beyond the end"),
        (patched(entry(1) + COUNT, struct.pack("<Q", 8)), "'teeth' does not begin where"),
        (patched(entry(1) + OFFSET, struct.pack("<Q", 2**64 - 64)), "'roll' does not begin where"),
        (patched(entry(4) + COUNT, struct.pack("<Q", 9)), "'more' reaches beyond the end"),
        (patched(entry(4) + COUNT, struct.pack("<Q", 0)), "sections end at"),
        (patched(len(BLOB) - 8, struct.pack("<d", np.inf)), "'more' holds a value that is not finite"),
        (patched(len(BLOB) - 8, struct.pack("<d", np.nan)), "'more' holds a value that is not finite"),
        (patched(len(SINGLE) - 4, struct.pack("<f", np.inf), SINGLE), "'single' holds a value that is not finite"),
        (patched(len(SINGLE) - 4, struct.pack("<f", np.nan), SINGLE), "'single' holds a value that is not finite"),
        (patched(entry(0) + COUNT, struct.pack("<Q", 17), SINGLE), "'single' reaches beyond the end"),
        (patched(entry(0) + COUNT, b"\7"), "'name' is not UTF-8 text that ends with NUL"),
        (patched(ENTRY.unpack_from(BLOB, entry(0))[4], b"\xff"), "'name' is not UTF-8"),
        (patched(ENTRY.unpack_from(BLOB, entry(0))[4], b"\0"), "'name' is not UTF-8"),
    ]
    + [
        (patched(place, data, REPEATING), "does not repeat an earlier one")
        for place, data in (
            (entry(0) + REPEATS, b"\1"),  # itself
            (entry(0) + REPEATS, b"\3"),  # a later one
            (entry(2) + REPEATS, b"\2"),  # another section
            (entry(3) + REPEATS, b"\3"),  # one that repeats itself
            (entry(3) + REPEATS, b"\xff\xff\xff\xff"),
            (entry(3) + TYPE, b"\2"),
            (entry(3) + COUNT, struct.pack("<Q", 599)),
            (entry(3) + OFFSET, struct.pack("<Q", 2**63)),
        )
    ],
)
def test_each_rule(probes: Probes, damage: bytes, words: str) -> None:
    outcome, message, _, sections = probes.blob_open(damage)
    assert outcome == BAD_BLOB and words in message and sections == 0


def test_every_changed_byte_and_every_other_length_is_noticed(probes: Probes) -> None:
    changed = [BLOB[:i] + bytes([BLOB[i] ^ 0x40]) + BLOB[i + 1 :] for i in range(len(BLOB))]
    for damage in (*changed, *(BLOB[:i] for i in range(len(BLOB))), BLOB + b"\0"):
        assert probes.blob_open(damage)[0] == BAD_BLOB


def test_a_section_that_repeats_another_has_its_contents(probes: Probes) -> None:
    assert probes.blob_open(REPEATING)[0] == 0
    assert [probes.blob_sum(REPEATING, f"long{i}", F64) for i in range(3)] == 3 * [(LONG.sum(), 600)]
    assert len(REPEATING) < len(write_blob({"long0": LONG, "long1": LONG + 1.0}))


def test_every_unicode_boundary(probes: Probes) -> None:
    text = "".join(map(chr, (1, 0x7F, 0x80, 0x7FF, 0x800, 0xD7FF, 0xE000, 0xFFFF, 0x10000, 0x10FFFF)))
    assert probes.blob_open(write_blob({"t": text}))[0] == 0
    overlong, surrogate = (b"\xc0\x80", b"\xe0\x80\x80", b"\xf0\x80\x80\x80"), (b"\xed\xa0\x80",)
    beyond, torn = (b"\xf4\x90\x80\x80", b"\xf5\x80\x80\x80"), (b"\x80", b"\xe2\x82")
    for wrong in overlong + surrogate + beyond + torn:
        blob = bytearray(write_blob({"t": "x" * len(wrong)}))
        start = ENTRY.unpack_from(blob, HEADER.size)[4]
        blob[start : start + len(wrong)] = wrong
        assert probes.blob_open(seal(bytes(blob)))[0] == BAD_BLOB, wrong


# ---- in Python: what is written is read back, and what is wrong is said ----------------------------------------------
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
        "": (np.zeros(1), "''"),
        "a name with spaces": (np.zeros(1), "'a name with spaces'"),
        "x" * 24: (np.zeros(1), "x" * 24),
        "inf": (np.array([1.0, np.inf, np.nan]), "2 of 3 values"),
        "big": (np.array([2**31]), "'big': integers beyond 32 bits"),
        "complex": (np.array([1j]), "'complex'"),
        "nul": ("a\0b", "'nul': text contains NUL"),
    }
    with pytest.raises(ModelError) as caught:
        write_blob({name: value for name, (value, _) in bad.items()})
    assert all(words in str(caught.value) for _, words in bad.values()), str(caught.value)


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
