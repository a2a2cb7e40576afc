"""Quantities with units: what is read, and what is refused with which remedy."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearfmu.errors import UnitError
from gearfmu.quantities import _USUAL, _factor_by_pint, to_si

READ = [
    ("600 N*m", "N*m", 600),
    ("600 N·m", "N*m", 600),
    ("600 Nm", "N*m", 600),
    ("0.6 kNm", "N*m", 600),
    ("600 N.m", "N*m", 600),
    ("6000 rpm", "rad/s", 6000 * math.pi / 30),
    ("6000 U/min", "rad/s", 6000 * math.pi / 30),
    ("6000 1/min", "rad/s", 6000 * math.pi / 30),
    ("6000 min^-1", "rad/s", 6000 * math.pi / 30),
    ("20 deg", "rad", math.pi / 9),
    ("20°", "rad", math.pi / 9),
    ("0.1 mm", "m", 1e-4),
    ("15 µm", "m", 15e-6),
    ("15 μm", "m", 15e-6),  # Greek mu, not the micro sign
    ("15um", "m", 15e-6),
    ("120 kHz", "Hz", 120e3),
    ("206 GPa", "Pa", 206e9),
    ("206e3 N/mm^2", "Pa", 206e9),
    ("27.6e3 N*s/m^2", "N*s/m^2", 27.6e3),
    ("27.6 N·s/(m·mm)", "N*s/m^2", 27.6e3),
    ("20 N*m/deg", "N*m/rad", 20 * 180 / math.pi),
    ("7.85 g/cm^3", "kg/m^3", 7850),
    ("7850 kg/m³", "kg/m^3", 7850),
    ("-.5e-3 m", "m", -5e-4),
    ("3", "", 3),
]


@pytest.mark.parametrize(("text", "unit", "value"), READ)
def test_reads(text: str, unit: str, value: float) -> None:
    assert to_si(text, unit) == pytest.approx(value, rel=1e-14)


REFUSED = [
    ("600", "N*m", "unit is missing"),
    (600, "N*m", 'write "600 N*m"'),
    (2000, "rad/s", 'write "2000 rpm"'),
    ("2000 rpmm", "rad/s", 'use one like "rpm" or "rad/s"'),
    (0.1, "m", "unit is missing"),
    ("600 N", "N*m", "another kind"),
    ("50 Hz", "rad/s", "another kind"),
    ("314 rad/s", "Hz", "another kind"),
    ("20 N*m", "N*m/rad", "another kind"),
    ("3 furlongz", "m", "unknown unit"),
    ("3 mm; import os", "m", "is no unit"),
    ("three mm", "m", "not a number"),
    ("", "m", "not a number"),
    ("nan m", "m", "not a number"),
    ("1e999 m", "m", "not finite"),
    ("1 mm**99999", "m", "another kind"),
    (True, "m", "expected a quantity"),
    (None, "m", "expected a quantity"),
    (["1 mm"], "m", "expected a quantity"),
]


@pytest.mark.parametrize(("text", "unit", "remedy"), REFUSED)
def test_refuses_with_a_remedy(text: object, unit: str, remedy: str) -> None:
    with pytest.raises(UnitError, match=remedy.replace("*", r"\*")):
        to_si(text, unit)


@given(st.text(max_size=30))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        assert math.isfinite(to_si(text, "m"))
    except UnitError as error:
        assert len(str(error)) > 10


@pytest.mark.parametrize(("text", "unit"), _USUAL)
def test_usual_units_are_those_of_the_unit_library_to_the_last_bit(text: str, unit: str) -> None:
    assert _USUAL[text, unit] == _factor_by_pint(text, unit)
