"""stage.toml of a planetary set: what is right is read, what is wrong is refused with a remedy, all at once."""

from __future__ import annotations

import pytest

from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.stored import expected_hash


def test_pin_errors_move_the_axes_of_planets():
    spec = load_stage("planetary54", {"set.pin_errors.1": ["0 mm", "12 um"]})
    assert spec.written.set.pin_errors == {1: (0.0, pytest.approx(12e-6))}
    rotors = spec.rotors
    assert rotors["planet2"].offset == pytest.approx((-12e-6, 0.0)) and rotors["planet1"].offset == (0.0, 0.0)


def test_a_body_depends_on_its_own_numbers_only():
    before = load_stage("planetary54")
    changed = load_stage("planetary54", {"ring.mounts.stiffness": "2e8 N/m", "set.backlash": "0.05 mm"})
    assert all(expected_hash(before, name) == expected_hash(changed, name) for name in before.files)
