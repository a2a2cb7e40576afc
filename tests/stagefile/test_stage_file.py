"""stage.toml: the shipped stages, every problem at once with file, field, value and remedy, variants by `base`."""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from broken import problems
from hypothesis import given, settings
from hypothesis import strategies as st

from gearfmu.errors import SpecError
from gearfmu.stagefile.checks.gears import at_most
from gearfmu.stagefile.forms.pair import StageSpec
from gearfmu.stagefile.forms.shapes import largest_half_width
from gearfmu.stagefile.proposals.new import stage_text
from gearfmu.stagefile.reading.base import read_toml
from gearfmu.stagefile.reading.files import find_stage, model_folder, shipped_stages
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import Bearing


def test_relief_stage_differs_only_in_its_relief() -> None:
    plain, relieved = load_stage("fzg_c"), load_stage("fzg_c/stage_relief")
    pair = relieved.written.geometry
    for index, gear in enumerate(relieved.gears):
        assert gear.tip_relief is not None
        assert (gear.tip_relief.amount, gear.tip_relief.kind) == (15e-6, "parabolic")
        assert gear.tip_relief.start_roll == pair.outer_single_contact(index)
        assert gear.model_copy(update={"tip_relief": None}) == plain.gears[index]
    names = {"name", "description", "source", "gears"}
    assert relieved.written.model_dump(exclude=names) == plain.written.model_dump(exclude=names)
    assert model_folder(relieved) == model_folder(plain)


def test_a_stage_is_found_by_path_folder_and_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = Path(shutil.copy(find_stage("fzg_c"), tmp_path))
    assert {find_stage(path), find_stage(str(path)), find_stage(path.parent)} == {path}
    assert {"fzg_c", "fzg_c/stage_relief"} <= set(shipped_stages())
    assert find_stage("fzg_c/stage_relief").name == find_stage("fzg_c/stage_relief.toml").name == "stage_relief.toml"
    assert find_stage("fzg_c_relief") == find_stage("fzg_c/stage_relief"), "what the file calls itself"
    with pytest.raises(SpecError, match='did you mean "fzg_c"'):
        load_stage("fzg_b")
    monkeypatch.chdir(path.parent)
    assert find_stage("stage.toml").resolve() == path


def zero_shift_pair(teeth: int, shift: float = 0.0) -> dict[str, Any]:
    """Changes that make a pinion of so many teeth by a rack whose fillet is 0.25 modules; the wheel's shift evens the
    pinion's."""
    return {
        "gears.pinion.teeth": teeth,
        "gears.pinion.profile_shift": shift,
        "gears.wheel.profile_shift": -shift,
        "gears.pinion.tip_diameter": f"{4.5 * (teeth + 2 + 2 * shift):.9g} mm",
        "gears.wheel.tip_diameter": f"{4.5 * (26 - 2 * shift):.9g} mm",
        "gears.pinion.bore_diameter": "20 mm",
        "torque_max": "200 N*m",
        "gears.pinion.rack.fillet_radius": 0.25,
        "gears.wheel.rack.fillet_radius": 0.25,
        "pair.center_distance": f"{2.25 * (teeth + 24):.9g} mm",
    }


def test_seventeen_teeth_need_no_profile_shift() -> None:
    """Undercut is judged at the rack's addendum, whatever its fillet: it was judged where the rack's straight flank
    ends, and 17 teeth without profile shift were refused for a fillet of 0.25."""
    shape = load_stage("fzg_c", zero_shift_pair(17)).written.geometry.gears[0]
    assert shape.rounding.form_roll < 0 and math.hypot(shape.r_b, shape.s_form) - shape.r_b < 0.002 * shape.m


@pytest.mark.parametrize("teeth", [10, 12, 16])
def test_undercut_in_earnest_names_the_shift_that_cures_it(teeth: int) -> None:
    least = 1 - teeth * math.sin(math.radians(20)) ** 2 / 2
    found = problems(zero_shift_pair(teeth))["gears.pinion.profile_shift"]
    stated = float(re.search(r"at least ([\d.]+),", found.remedy).group(1))
    assert least <= stated < 1.002 * least
    assert not problems(zero_shift_pair(teeth, stated))


def test_a_largest_length_below_zero_is_none() -> None:
    assert at_most(0.0123456) == "at most 12.34 mm"
    assert at_most(-1.423e-3).startswith("no value fits")


def test_interference_below_the_form_circle() -> None:
    """A long wheel addendum in a small pinion; the diameter that the remedy names is accepted there."""
    changes = {
        "gears.pinion.profile_shift": 0.5,
        "gears.wheel.profile_shift": -0.147,
        "gears.wheel.rack.addendum": 1.3,
        "gears.wheel.tip_diameter": "117.4 mm",
    }
    remedy = problems(changes)["gears.wheel.tip_diameter"].remedy
    assert "interference" in remedy
    named = remedy.split("at most ")[1]
    assert not problems(changes | {"gears.wheel.tip_diameter": named})


def test_the_named_strip_is_wide_enough_and_a_little_less_is_not() -> None:
    stage = load_stage("fzg_c").written
    b = largest_half_width(stage.gears, stage.geometry, stage.torque_max)
    assert b == pytest.approx(0.3527e-3, abs=1e-7)  # √(4·1.2669e6·8.731e-3/(π·113.19e9)) with ρ = L/4
    for factor, fine in ((1.5001, True), (1.4999, False)):
        width = f"{factor * b * 1e3:.9f} mm"
        fields = problems({f"gears.{g}.body.strip_half_width": width for g in ("pinion", "wheel")})
        assert (not fields) == fine


def test_backlash_is_judged_after_the_allowance() -> None:
    """The FZG pair has −0.07 µm as given: no problem, because the file declares 0.1 mm; with a hundredth of a module
    in hand.
    """
    assert load_stage("fzg_c").written.geometry.nominal_backlash < 0
    assert not problems({"pair.backlash": "0 mm"})


@pytest.mark.parametrize(("share", "fine"), [(0.099, True), (0.101, False)])
def test_teeth_are_thinned_by_a_tenth_of_the_module_at_most(share: float, fine: bool) -> None:
    stage = load_stage("fzg_c").written
    backlash = stage.geometry.nominal_backlash + share * stage.pair.normal_module
    found = problems({"pair.backlash": f"{1e3 * backlash:.9f} mm"})
    assert ("pair.center_distance" not in found) == fine


def test_a_variant_names_the_file_that_holds_the_problem(tmp_path: Path) -> None:
    text = find_stage("fzg_c").read_text(encoding="utf-8").replace("teeth = 16", 'teeth = "x"')
    (tmp_path / "stage.toml").write_text(text, encoding="utf-8")
    variant = tmp_path / "stage_b.toml"
    variant.write_text('base = "stage.toml"\nname = "B"\n[gears.wheel]\nface_width = "14"\n', encoding="utf-8")
    found = problems({}, variant)
    assert Path(found["gears.pinion.teeth"].file).name == "stage.toml"
    assert Path(found["gears.wheel.face_width"].file).name == "stage_b.toml"
    assert Path(found["name"].file).name == "stage_b.toml"


@pytest.mark.parametrize(
    ("content", "remedy"),
    [(b"a = ", "not valid TOML"), (b"a = " + 100_000 * b"[", "not valid TOML"), (b"name = '\xff\xfe'", "UTF-8")],
    ids=["cut", "deep", "no text"],
)
def test_files_that_cannot_be_read(tmp_path: Path, content: bytes, remedy: str) -> None:
    path = tmp_path / "stage.toml"
    path.write_bytes(content)
    assert remedy in problems({}, path)[""].remedy


def test_python_may_build_a_spec_from_si_numbers() -> None:
    assert Bearing(stiffness=1e8).stiffness == 1e8
    assert Bearing(stiffness="100 N/µm").stiffness == 1e8
    with pytest.raises(ValueError, match="finite"):
        Bearing(stiffness=math.inf)
    stage = load_stage("fzg_c").written
    assert StageSpec.model_validate(stage.model_dump()) == stage


leaves = st.one_of(
    st.none(), st.booleans(), st.integers(-10, 400), st.floats(-1e3, 1e3), st.text(max_size=8),
    st.sampled_from(["1 mm", "1e9 m", "1e-9 m", "80 deg", "5 N*m", "1 kg/m^3", "outer_single_contact"]),
)  # fmt: skip
FIELDS = [
    "pair.center_distance", "pair.normal_module", "pair.pressure_angle", "pair.backlash", "gears.pinion.teeth",
    "gears.wheel.profile_shift", "gears.wheel.tip_diameter", "gears.pinion.bore_diameter", "gears.wheel.face_width",
    "gears.pinion.rack.dedendum", "gears.pinion.rack.fillet_radius", "gears.pinion.tip_edge_radius", "torque_max",
    "gears", "ports", "levels", "contact", "gears.pinion", "gears.pinion.tip_relief",
    "gears.wheel.body.strip_half_width",
]  # fmt: skip


@settings(max_examples=300)
@given(st.dictionaries(st.sampled_from(FIELDS), leaves, min_size=1, max_size=3))
def test_whatever_stands_in_the_file_it_loads_or_lists_problems(changes: dict[str, Any]) -> None:
    """Fields before the tables that hold them."""
    found = problems(dict(sorted(changes.items(), key=lambda item: -item[0].count("."))))
    assert all(problem.file and problem.remedy for problem in found.values())


def test_index_deviations_by_tooth() -> None:
    table = {"0": "50 µm", "15": "-12 µm"}
    pinion, wheel = load_stage("fzg_c", {"gears.pinion.index_deviation": table}).gears
    assert pinion.index_deviation == pytest.approx({0: 50e-6, 15: -12e-6}) and wheel.index_deviation == {}
    tables = read_toml(find_stage("fzg_c"))
    tables["gears"]["pinion"]["index_deviation"] = table
    assert 'index_deviation = { "0" = "50 µm", "15" = "-12 µm" }' in stage_text(tables, "")
