"""What a stage file says of its flanks: what is wrong is said with file, field, value and remedy, all at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from broken import problems

from gearfmu.stagefile.proposals.new import new_stage
from gearfmu.stagefile.reading.files import find_stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.topography import read_topography

PINION = load_stage("fzg_c").written.geometry.gears[0]


def test_points_of_single_contact_become_rolls() -> None:
    spec = load_stage("fzg_c", {"gears.wheel.root_relief": {"amount": "10 um", "kind": "linear"}})
    pair = spec.written.geometry
    assert spec.gears[1].root_relief.start_roll == pair.inner_single_contact(1) > pair.gears[1].s_form


def test_lists_of_deviations() -> None:
    """Index deviations of all teeth as a list; single pitch deviations are summed from the last tooth on."""
    single = ["2 um", "-1 um", "-1 um", *["0 um"] * 13]
    changes = {"gears.pinion.index_deviation": ["1 um"] * 16, "gears.pinion.pitch_deviation": single}
    gear = load_stage("fzg_c", changes).gears[0]
    assert gear.index_deviation == dict.fromkeys(range(16), 1e-6) and sum(gear.pitch_deviation) == 0


def test_files_that_call_a_parabola_quadratic_are_read() -> None:
    relief = {"amount": "9 um", "kind": "quadratic"}
    assert load_stage("fzg_c", {"gears.pinion.tip_relief": relief}).gears[0].tip_relief.kind == "parabolic"


def test_a_new_stage_shows_the_fields_with_their_meaning(tmp_path: Path) -> None:
    text = new_stage("mine", "fzg_c", tmp_path).read_text(encoding="utf-8")
    for table in ("profile", "root_relief", "deviations", "eccentricity", "wobble"):
        assert f"# [gears.pinion.{table}]  # " in text
    assert "# # class = " in text and "flank tolerance class A" in text and "# topography = " in text
    assert text.index("teeth = 16") < text.index("# topography = ")


# ---- topography ------------------------------------------------------------------------------------------------------
def written(folder: Path, *lines: str) -> Path:
    path = folder / "flanks.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_a_stage_finds_its_topography_beside_the_file_that_names_it(tmp_path: Path) -> None:
    written(tmp_path, "roll_mm,z_mm,deviation_um", "10,0,1", "20,0,2")
    path = tmp_path / "stage.toml"
    own = f'base = "{find_stage("fzg_c").as_posix()}"\nname = "other"\n[gears.pinion]\ntopography = "flanks.csv"\n'
    path.write_text(own, encoding="utf-8")
    (tmp_path / "sub").mkdir()
    above = tmp_path / "sub" / "stage.toml"
    above.write_text('base = "../stage.toml"\nname = "above"\n', encoding="utf-8")
    for file in (path, above):
        assert Path(load_stage(file).gears[0].topography).resolve() == (tmp_path / "flanks.csv").resolve()
    (tmp_path / "flanks.csv").unlink()
    assert problems({}, path)["gears.pinion.topography"].value == "flanks.csv"


def test_a_topography_by_tooth_and_flank(tmp_path: Path) -> None:
    """Diameters and rolls are one; teeth that were not measured have the mean of those that were; other flanks are
    nominal; beyond the points the edge goes on."""
    d = 2e3 * np.hypot(PINION.r_b, [10e-3, 20e-3])
    rows = [f"{k},left,{x:.12f},{y},{k + 10 * (y > 0)}" for k in (0, 4) for x in d for y in (-5, 5)]
    path = written(tmp_path, "# measured", "tooth,flank,diameter_mm,z_mm,deviation_um  # remark", *rows)
    found, faults = read_topography(path, 16, PINION)
    assert not faults and found is not None
    grid = 1e6 * found.grid(16, np.array([5e-3, 15e-3]), np.array([-7e-3, 0.0, 5e-3]))
    assert grid.shape == (16, 2, 3, 2) and not grid[:, 1].any()
    assert grid[4, 0] == pytest.approx(np.array([[4, 4], [9, 9], [14, 14]]))
    assert grid[7, 0] == pytest.approx(np.array([[2, 2], [7, 7], [12, 12]]))
    assert found.patches[4, 0].roll == pytest.approx([10e-3, 20e-3], abs=1e-12)


def test_a_topography_reads_the_same_however_an_office_writes_it(tmp_path: Path) -> None:
    plain = written(tmp_path, "roll_mm,z_mm,deviation_um", "10,-2.5,1.5", "10,2.5,-0.5")
    wanted, _ = read_topography(plain, 16, PINION)
    office = tmp_path / "office.csv"
    office.write_bytes("roll_mm;z_mm;deviation_um;\r\n10;-2,5;1,5;\r\n10;2,5;-0,5;\r\n".encode("utf-8-sig"))
    found, faults = read_topography(office, 16, PINION)
    assert not faults and found is not None and wanted is not None
    for key, patch in wanted.patches.items():
        assert all(np.array_equal(getattr(patch, name), getattr(found.patches[key], name)) for name in vars(patch))


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "holds no rows"),
        (["roll_mm,z_mm,deviation_um"], "a head and no points"),
        (["roll_mm,z_mm,height_um", "1,0,0"], "line 1 height_um: unknown column: known are roll_mm"),
        (["roll,z_mm,deviation_um", "1,0,0"], "line 1 roll: a length needs its unit: write roll_mm or roll_um"),
        (["roll_mm,deviation_um", "1,0"], "the column z_… is missing"),
        (["roll_mm,diameter_mm,z_mm,deviation_um", "1,1,0,0"], "once, as roll_mm or as diameter_mm"),
        (["roll_mm,z_mm,deviation_um", "10,0"], "line 2 10,0: 2 values, the head has 3"),
        (["roll_mm,z_mm,deviation_um", "10,0,much"], "line 2, deviation much: expected a number"),
        (["roll_mm,z_mm,deviation_um", "10,0,nan"], "line 2, deviation nan um"),
        (["roll_mm,z_mm,deviation_mm", "10,0,5"], "more than 1 mm: check the unit"),
        (["diameter_mm,z_mm,deviation_um", "20,0,5"], "below the base circle, 67.6"),
        (["roll_mm,z_mm,deviation_um", "10,0,1", "10,0,2"], "line 3 10,0,2: this point is there twice"),
        (["roll_mm,z_mm,deviation_um", "10,0,1", "10,5,1", "12,0,1"], "none at roll 12 mm, z 5 mm: every roll needs"),
        (["roll_um,z_mm,deviation_um", "10,0,1"], "beside the flank, whose rolls are 1.54668 to 23.4178 mm"),
        (["tooth,roll_mm,z_mm,deviation_um", "16,10,0,1"], "line 2, tooth 16: there is no such tooth"),
        (["flank,roll_mm,z_mm,deviation_um", "up,10,0,1"], 'line 2, flank up: a flank is "left" or "right"'),
    ],
)
def test_what_is_wrong_with_a_topography(lines: list[str], words: str, tmp_path: Path) -> None:
    found, faults = read_topography(written(tmp_path, *lines), 16, PINION)
    assert found is None and any(words in f"{p.field} {p.value}: {p.remedy}" for p in faults), faults
    assert all(p.file.endswith("flanks.csv") for p in faults)


def test_of_many_wrong_rows_the_first_are_said(tmp_path: Path) -> None:
    _, faults = read_topography(written(tmp_path, "roll_mm,z_mm,deviation_um", *["x,0,0"] * 100), 16, PINION)
    assert len(faults) == 21 and "and 80 more problems" in faults[-1].remedy
