"""Sides of equal planets share what depends on bodies alone: the same numbers, to the last bit, as without sharing.

The kernel takes gears for ones of one body where their tables are one copy in the blob. The same model with a copy for
every gear is read without sharing anything.
"""

from __future__ import annotations

import numpy as np
import pytest
from driven import begun, stepped
from golden_stages import golden_model

from gearfmu.kernel import Kernel
from gearfmu.stage.assembly import blob as blobs

FAST, STANDARD = 1.0, 2.0
STEP = 2e-5
MODELS = ("helical_set", "pin_errors")  # equal planets; planets that stand at different distances


def stored(blob: bytes, repeated_from: int, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """The model with equal sections of at least so many bytes stored once."""
    with monkeypatch.context() as patch:
        patch.setattr(blobs, "REPEATED_FROM", repeated_from)
        return blobs.write_blob(blobs.read_blob(blob))


def both_ways(blob: bytes, monkeypatch: pytest.MonkeyPatch) -> tuple[bytes, bytes]:
    """With one copy of the tables of equal planets, and with a copy for every gear."""
    shared, alone = stored(blob, 1, monkeypatch), stored(blob, 1 << 60, monkeypatch)
    assert len(shared) < len(alone)
    return shared, alone


def moved(blob: bytes) -> bytes:
    """One planet farther out by 10 µm in its engagement with the sun alone: it is a twin in the ring still."""
    sections = dict(blobs.read_blob(blob))
    engagement = np.array(sections["engagement"])
    engagement.reshape(-1, 10)[1, 2:4] *= 1.0 + 1e-5 / np.hypot(*engagement.reshape(-1, 10)[1, 2:4])
    return blobs.write_blob(sections | {"engagement": engagement})


def state_after_steps(blob: bytes, level: float, friction: float) -> bytes:
    kernel = begun(Kernel(blob, {"level": level, "slices": 1.0, "effect.friction": friction}), {})
    stepped(kernel, 3, STEP)
    return kernel.save()


QUICK = [("helical_set", moved, FAST), ("helical_set", bytes, STANDARD), ("pin_errors", moved, STANDARD)]
OTHERS = [(n, c, v) for n in MODELS for c in (bytes, moved) for v in (FAST, STANDARD) if (n, c, v) not in QUICK]


@pytest.mark.parametrize(
    ("name", "change", "level"), [*QUICK, *(pytest.param(*case, marks=pytest.mark.full) for case in OTHERS)]
)
def test_shared_tables_are_those_of_every_gear_alone(name, change, level, monkeypatch) -> None:
    shared, alone = both_ways(change(golden_model(name)), monkeypatch)
    assert state_after_steps(shared, level, 0.0) == state_after_steps(alone, level, 0.0)


def test_shared_tables_along_the_profile_are_those_of_every_gear_alone(monkeypatch) -> None:
    shared, alone = both_ways(golden_model("pin_errors"), monkeypatch)
    assert state_after_steps(shared, FAST, 1.0) == state_after_steps(alone, FAST, 1.0)
