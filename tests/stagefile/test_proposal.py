"""Stage files from a few numbers: valid, marked, and refused with everything that is wrong at once."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearfmu.errors import SpecError
from gearfmu.geometry.mesh import mount_spaces
from gearfmu.stagefile.forms.expand import motion_problems
from gearfmu.stagefile.forms.shapes import mesh_shape, set_geometry
from gearfmu.stagefile.proposals.numbers import Wish, draft_of, new_from_numbers
from gearfmu.stagefile.stage import load_stage

PAIR = Wish((31, 73), 2.5e-3, 30e-3, center=141e-3, helix=math.radians(22))
SET = Wish((30, 20, -70), 2e-3, 20e-3, planets=5)


def refused(wish: Wish) -> list[str]:
    with pytest.raises(SpecError) as found:
        draft_of(wish)
    return [str(problem) for problem in found.value.problems]


@pytest.mark.parametrize("teeth", [(19, 21, 61), (23, 25, 73)], ids=lambda t: str(t[2]))
def test_a_ring_whose_teeth_no_number_divides_moves_on_six_mounts(teeth: tuple[int, int, int], tmp_path: Path) -> None:
    """Sees mounts that a ring may have only at every n-th tooth: such sets could not move at all."""
    planets = next(n for n in (4, 3, 2, 5) if (teeth[0] + teeth[2]) % n == 0)
    spec = load_stage(new_from_numbers("mine", Wish(teeth, 2.5e-3, 20e-3, planets=planets), tmp_path))
    assert spec.written.ring.mounts.points == 6 and motion_problems(spec.written) == []
    spaces = mount_spaces(spec.written.ring.teeth, 6)
    assert len(set(spaces)) == 6
    assert all(abs(space - k * spec.written.ring.teeth / 6) <= 0.5 for k, space in enumerate(spaces))


@pytest.mark.parametrize("wish", [PAIR, SET, replace(SET, helix=0.2)], ids=["pair", "set", "helical set"])
def test_every_value_is_marked_and_every_optional_table_has_its_heading(wish: Wish, tmp_path: Path) -> None:
    text = new_from_numbers("mine", wish, tmp_path).read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if " = " in line and not line.startswith("#")]
    unmarked = [line for line in lines if "; given" not in line and "; proposed" not in line]
    assert [line.split(" = ")[0] for line in unmarked] == ["name", "description", "kind"]
    first = "sun" if wish.planets else "gears.pinion"
    for table in ("tip_relief", "lead", "lead.end_relief", "import"):
        assert f"# [{first}.{table}]" in text, table


@pytest.mark.parametrize(
    "wish",
    [
        pytest.param(PAIR, id="pair"),
        pytest.param(SET, id="set"),
        Wish((10, 40), 1e-3, 10e-3, center=25.4e-3),
        Wish((25, 25), 4.5e-3, 14e-3),
        Wish((17, 120), 6e-3, 80e-3, helix=-0.3),
        Wish((31, 73), 2.5e-3, 30e-3, torque=900.0, speed=300.0),
        Wish((43, 103), 1e-3, 20e-3, pressure_angle=math.radians(25)),
        Wish((18, 18, 54), 2.5e-3, 20e-3, planets=4),
        Wish((26, 19, 64), 1.75e-3, 20e-3, planets=3, helix=math.radians(20)),
        Wish((30, 20, 70), 2e-3, 20e-3, planets=6, unequal=True),
        Wish((24, 31, 86), 3e-3, 40e-3, planets=2),
        Wish((20, 22, 65), 2e-3, 15e-3, planets=5),
    ],
    ids=lambda wish: wish.shown,
)
def test_what_is_proposed_is_a_valid_stage(wish: Wish, tmp_path: Path) -> None:
    """Teeth mesh without backlash before they are thinned, planets do not touch, and the stage can move."""
    spec = load_stage(new_from_numbers("mine", wish, tmp_path))
    assert [abs(z) for z in wish.teeth] == [gear.teeth for gear in spec.written.gears]
    for mesh in spec.engagements:
        assert mesh_shape(spec, mesh).nominal_backlash == pytest.approx(0.0, abs=1e-8)
    if wish.planets:
        assert set_geometry(spec.written).neighbour_clearance > 0 and motion_problems(spec.written) == []
    if wish.torque:
        assert (spec.written.torque_max, spec.written.speed_max) == pytest.approx((wish.torque, wish.speed))
    if wish.unequal:
        assert spec.written.set.positions == (0, 17, 33, 50, 67, 83)


REFUSED: list[tuple[Wish, list[tuple[str, ...]]]] = [  # what is said of each problem, the beginning first
    (
        Wish((31, 20, 70)),
        [("teeth", "for a planetary set also give the number of planets"), ("module",), ("width",)],
    ),
    (Wish((31, 20), 1e-3, 1e-2, planets=3), [("teeth", "three: sun, planet, ring")]),
    (Wish((31, 20), 1e-3, 1e-2, unequal=True), [("", "give their number")]),
    (Wish((3, 900), 1e-6, 20e-3, helix=1.0), 4 * [("", "out of range")]),
    (
        replace(SET, planets=6),
        [
            (
                "",
                "100/6 is no integer",
                "z_sun + z_ring = 96 or 102, 2 or 4 or 5 planets",
                "not equally spaced (unequal)",
            )
        ],
    ),
    (Wish((30, 30, 90), 2e-3, 20e-3, planets=6), [("", "planets touch", "at most 5")]),
    (Wish((20, 61, 142), 2e-3, 20e-3, planets=5), [("", "no integer"), ("", "planets touch")]),
    (replace(PAIR, center=0.15), [("center = ", "out of reach", "can be made from 13")]),
    (replace(PAIR, center=0.05), [("center = ", "out of reach", "can be made from 13")]),
    (Wish((8, 9), 2e-3, 10e-3), [("", "give more teeth")]),
    (replace(PAIR, pressure_angle=math.radians(33)), [("pressure_angle = 33 deg",)]),
    (replace(PAIR, torque=1e5), [("torque = 100000 N*m: 1.5 Hertz half-widths", "% of this torque")]),
    (Wish((30, 20, 60), 2e-3, 20e-3, planets=3), [("", "suit a ring of about 70")]),
]


@pytest.mark.parametrize(("wish", "said"), REFUSED, ids=lambda value: getattr(value, "shown", ""))
def test_what_cannot_be_is_refused_with_the_nearest_choices(wish: Wish, said: list[tuple[str, ...]]) -> None:
    found = refused(wish)
    assert len(found) == len(said)
    for line, (head, *words) in zip(found, said, strict=True):
        assert line.startswith(head) and all(word in line for word in words), line


def test_the_torque_that_is_named_can_be_carried() -> None:
    (found,) = refused(replace(PAIR, torque=1e5))
    share = float(found.split("at most ")[1].split(" %")[0]) / 100
    assert draft_of(replace(PAIR, torque=0.98 * share * 1e5)).at("torque_max")


def test_nothing_is_left_of_what_is_refused_and_nothing_is_overwritten(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="out of reach"):
        new_from_numbers("mine", replace(PAIR, center=0.15), tmp_path)
    assert not list(tmp_path.iterdir())
    new_from_numbers("mine", PAIR, tmp_path)
    with pytest.raises(SpecError, match="exists already"):
        new_from_numbers("mine", SET, tmp_path)


@pytest.mark.parametrize("wish", [replace(PAIR, center=None), SET], ids=["pair", "set"])
def test_twice_the_module_proposes_twice_every_length(wish: Wish) -> None:
    """But for rounding to two digits: 8 % of the carrier's bore."""
    small, large = (_lengths(draft_of(size).tables) for size in (wish, twice(wish)))
    assert len(small) >= 10
    assert large == pytest.approx({place: 2 * value for place, value in small.items()}, rel=0.1)
    assert np.median([large[place] / value for place, value in small.items()]) == pytest.approx(2.0, rel=1e-3)


def twice(wish: Wish) -> Wish:
    assert wish.module and wish.width
    return replace(wish, module=2 * wish.module, width=2 * wish.width)


def _lengths(table: dict[str, Any], way: str = "") -> dict[str, float]:
    """Every value in mm, by its place."""
    found = {}
    for key, value in table.items():
        if isinstance(value, dict):
            found |= _lengths(value, f"{way}{key}.")
        elif isinstance(value, str) and value.endswith(" mm"):
            found[way + key] = float(value.split()[0])
    return found
