"""R12, two texts with one meaning: a stage file in other units, with remarks, in another order of tables, with a byte
order mark and other line ends is the same stage to the last bit.

Where order has a meaning (`ORDERED`, lists) it is kept here; what it may change is the relation of order. Output in
other code pages: tests/test_console.py.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal, getcontext
from pathlib import Path
from typing import Any

import pytest
from kinds import KINDS, ROOT

from gearfmu.stagefile.reading.files import find_stage, read_layers
from gearfmu.stagefile.stage import load_stage

getcontext().prec = 40
PI = Decimal("3.141592653589793238462643383279502884197")
INCH, POUND = Decimal("0.0254"), Decimal("4.4482216152605")
FACTORS = {  # unit in the shipped files: the same quantity in another unit, which is so many of it
    "mm": ("in", INCH * 1000),
    "µm": ("um", Decimal(1)),
    "N/m": ("kN/mm", Decimal(10) ** 6),
    "N*m/rad": ("N*mm/rad", Decimal("0.001")),
    "N*m*s/rad": ("kN*m*s/rad", Decimal(1000)),
    "N*s/m^2": ("kN*s/m²", Decimal(1000)),
    "GPa": ("N/mm^2", Decimal("0.001")),
    "kg/m^3": ("g/cm^3", Decimal(1000)),
    "deg": ("rad", 180 / PI),
    "kHz": ("Hz", Decimal("0.001")),
    "N*m": ("lbf*in", POUND * INCH),
    "rpm": ("rad/s", 30 / PI),
    "rad/s": ("rpm", PI / 30),
}
QUANTITY = re.compile(r"([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S+)")
ORDERED = {  # tables in which order has a meaning
    "external_pair": (),
    "planetary_set": ("ports",),  # input first
    "general": ("bodies", "rotors", "ports"),  # that of the model
}
REMARK = '# [bodies] teeth = 3, "µm" → \'mm\' """'
Table = dict[str, Any]


@dataclass
class Style:
    """How tables are written. dice: shuffles what has no order; None: as they are."""

    units: bool = False
    remarks: bool = False
    dice: random.Random | None = None

    def text(self, tables: Table) -> str:
        return "\n".join(self._lines(tables, (), ORDERED[tables.get("kind", "external_pair")])) + "\n"

    def _lines(self, table: Table, place: tuple[str, ...], ordered: tuple[str, ...]) -> Iterator[str]:
        inner = [key for key, value in table.items() if isinstance(value, dict)]
        plain = [key for key in table if key not in inner]
        if self.dice is not None and not (place and place[-1] in ordered):
            self.dice.shuffle(plain)
            self.dice.shuffle(inner)
        for key in plain:
            yield f"{key} = {self._value(table[key])}" + (f"  {REMARK}" if self.remarks else "")
        for key in inner:
            if self.remarks:
                yield f"\n{REMARK}\n\n"
            yield f"[{'.'.join((*place, key))}]"
            yield from self._lines(table[key], (*place, key), ordered)

    def _value(self, value: Any) -> str:
        if isinstance(value, dict):
            return "{" + ", ".join(f"{json.dumps(key)} = {self._value(item)}" for key, item in value.items()) + "}"
        if isinstance(value, list):
            return "[" + ", ".join(map(self._value, value)) + "]"
        if isinstance(value, str) and self.units and (match := QUANTITY.fullmatch(value)) and match[2] in FACTORS:
            unit, factor = FACTORS[match[2]]
            return json.dumps(f"{Decimal(match[1]) / factor:.25g} {unit}", ensure_ascii=False)
        return json.dumps(value, ensure_ascii=False) if isinstance(value, (str, bool, int)) else repr(value)


def tables_of(kind: str) -> Table:
    """What the stage file of a kind says, its bases included."""
    file = KINDS[kind].file
    inside = ROOT / "tests" / "reference" / "internal_pair" / "stage.toml"
    tables = read_layers(inside if file == "internal" else find_stage(file)).tables
    return {key: value for key, value in tables.items() if key != "source"}


def read(folder: Path, text: str, encode: Callable[[str], bytes] = str.encode) -> Any:
    """The stage of a file with this text, always under the same path."""
    path = folder / "stage.toml"
    path.write_bytes(encode(text))
    return load_stage(path)


def office(text: str) -> bytes:
    """A byte order mark, and lines as on Windows."""
    return text.replace("\n", "\r\n").encode("utf-8-sig")


def is_same(one: Any, other: Any) -> bool:
    """Whether two stages have equal fields, floats to the last bit, and equal orders where the model has one."""
    orders = [[list(getattr(stage, name)) for name in ORDERED["general"]] for stage in (one, other)]
    return one == other and orders[0] == orders[1]


@pytest.mark.parametrize("kind", KINDS)
def test_one_meaning_is_one_stage(kind: str, tmp_path: Path) -> None:
    """A byte order mark was an error of TOML in the first line. A pair whose file had [gears.wheel] above
    [gears.pinion] took the wheel for the pinion, with its torque and its hand."""
    tables = tables_of(kind)
    plain = read(tmp_path, Style().text(tables))
    for name, style, encode in (
        ("units", Style(units=True), str.encode),
        ("remarks", Style(remarks=True), str.encode),
        ("order", Style(dice=random.Random(1)), str.encode),
        ("mark and line ends", Style(), office),
        ("all of them", Style(True, True, random.Random(2)), office),
    ):
        assert is_same(read(tmp_path, style.text(tables), encode), plain), name


def test_units_do_change_in_the_texts(tmp_path: Path) -> None:
    """The relation says nothing where the other text is the same one: most quantities are rewritten, and another number
    in one of them is another stage."""
    tables = tables_of("pair")
    one, other = (Style(units=units).text(tables) for units in (False, True))
    changed = [pair for pair in zip(one.splitlines(), other.splitlines(), strict=True) if pair[0] != pair[1]]
    assert len(changed) > 25 and ' in"' in other and " rad" in other
    distance = f"{Decimal('91.5') / FACTORS['mm'][1]:.25g}"
    spoilt = other.replace(distance, distance[:12])
    assert spoilt != other and not is_same(read(tmp_path, spoilt), read(tmp_path, one))
