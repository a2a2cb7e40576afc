"""Parts of lines of contact of a helical pair: what they yield beside their neighbours (docs/theory.md, eq. 8g′), and
lines that end at a tip edge inside the face width."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from by_hand import slice_weights
from scipy.integrate import quad
from slices import by_functions_alone

from gearfmu import cli
from gearfmu.body import load_bodies
from gearfmu.cosim.scene_run import stage_model
from gearfmu.errors import ModelError
from gearfmu.planning.choice import space
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.assembly.blob import read_blob, write_blob
from gearfmu.stage.assembly.compact import DISTANCES, between_functions
from gearfmu.stage.assembly.layout import width_degrees
from gearfmu.stage.run import refinement
from gearfmu.stage.run.refinement import HEARD, ORDERS, POSITIONS, Change, left_of_slices, twice
from gearfmu.stage.run.te import mesh_harmonics, place_of, statics_of
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import Misalignment

HELD = {"effect.bearings": 0.0}  # axes

WIDTH, STRIP, HELIX = 28e-3, 0.4e-3, math.asin(math.sin(math.radians(20)) * math.cos(math.radians(20)))
DEGREES = np.arange(6)
SLICES = 10


@cache
def involute(tilt: float = 0.0) -> StageModel:
    """`helical_demo` without modifications, so that lines of contact end at full load; its axes crossed by `tilt` (m)
    over WIDTH."""
    return tilted({"tip_relief": None, "lead": None}, tilt)


@cache
def crowned(tilt: float = 0.0) -> StageModel:
    """`helical_demo` with thrice the crowning, 12 µm: lines of contact end at part load."""
    lead = load_stage("helical_demo").written.gears[0].lead
    return tilted({"lead": lead.model_copy(update={"crowning": 12e-6})}, tilt)


def tilted(changes: Mapping[str, Any], tilt: float) -> StageModel:
    """`helical_demo` with changes of its pinion, of both gears where they take something away."""
    demo = load_stage("helical_demo")
    gears = [gear.model_copy(update=changes if gear.lead else {k: v for k, v in changes.items() if v is None})
             for gear in demo.written.gears]  # fmt: skip
    error = Misalignment(in_plane=0.0, out_of_plane=-tilt, span=WIDTH) if tilt else None
    pair = demo.written.pair.model_copy(update={"misalignment": error})
    return assemble(rewritten(demo, gears=tuple(gears), pair=pair), load_bodies(demo))


def errors(model: StageModel, torque: float, slices: int) -> np.ndarray:
    """(64,) m, static transmission error with bores held."""
    kernel, pitch = statics_of(model, **{"effect.bearings": 0.0, "slices": float(slices)}), place_of(model, None).pitch
    return np.array([kernel.transmission(-i / 64 * pitch, torque).te for i in range(64)])


def patches(apart: float, half: float) -> float:
    """Mean of 1/distance (1/m) between two patches ±half long and ±STRIP wide, by quadrature: over their distance along
    the line, with the closed mean across it."""

    def across(x: float) -> float:
        y = 2 * STRIP
        return 2 * (y * math.asinh(y / abs(x)) - math.hypot(x, y) + abs(x)) / y**2

    def weighed(x: float) -> float:
        return across(x) * max(0.0, 1 - abs(x - apart) / (2 * half)) / (2 * half)

    ends = sorted({apart - 2 * half, apart, apart + 2 * half, 0.0 if abs(apart) < 2 * half else apart})
    return sum(quad(weighed, *pair, limit=200)[0] for pair in zip(ends, ends[1:], strict=False))


def local_terms(helix: float) -> tuple[np.ndarray, np.ndarray]:
    """(SLICES, SLICES) 1/m: of the slices' patches, and of their width functions, end faces as mirrors, half-way up."""
    table = between_functions(WIDTH, STRIP, helix, np.array([0.3]), DEGREES)[0]
    z, along = WIDTH * ((np.arange(SLICES) + 0.5) / SLICES - 0.5), math.cos(helix)
    t = slice_weights(SLICES, DEGREES.size)
    half = WIDTH / SLICES / 2 / along
    places = WIDTH * np.linspace(0, 1, DISTANCES)
    own, smeared = np.empty((2, SLICES, SLICES))
    for i, j in np.ndindex(SLICES, SLICES):
        own[i, j] = sum(patches(x / along, half) for x in (z[i] - z[j], z[i] + z[j] - WIDTH, z[i] + z[j] + WIDTH))
        high, low = max(i, j), min(i, j)
        cell = np.array([np.interp(z[high] - z[low], places, c) for c in table.reshape(DISTANCES, -1).T])
        smeared[i, j] = t[high] @ cell.reshape(DEGREES.size, -1) @ t[low]
    return own, smeared


def test_width_functions_of_a_spur_gear_that_carry_evenly_are_one_patch() -> None:
    table = between_functions(WIDTH, STRIP, 0.0, np.array([0.3]), DEGREES)
    faces = [patches(x, WIDTH / 2) for x in (0.0, WIDTH, -WIDTH)]
    assert table[0, 0, 0, 0] == pytest.approx(sum(faces), rel=1e-3)


def test_slices_yield_more_by_themselves_and_as_much_together() -> None:
    """Own patches of slices are 1.9 times as compliant as six width functions say (5.1 and 2.7 µm/kN of a steel pair).
    Loads that are even across the width of a spur gear see no difference, of a helical one 3 %; no load sees less."""
    for helix, share in ((0.0, 2e-3), (HELIX, 0.03)):
        own, smeared = local_terms(helix)
        assert np.linalg.eigvalsh(own - smeared).min() > (-1e-3 if helix == 0.0 else 0.0) * own.max()
        assert np.abs((own - smeared).sum(axis=1)).max() < share * own.sum(axis=1).max()
    local = 2 * (1 - 0.3**2) / (math.pi * 2.06e11)
    assert 1e9 * local * own[5, 5] == pytest.approx(5.11, abs=0.02)
    assert 1e9 * local * smeared[5, 5] == pytest.approx(2.74, abs=0.02)


@pytest.mark.parametrize(("torque", "mean", "swing"), [(150.0, 3e-3, 0.1), (450.0, 4e-3, 0.2)])
def test_te_hardly_depends_on_the_number_of_slices(torque: float, mean: float, swing: float) -> None:
    """5, 7 and 10 slices: mean within 0.3 % (0.4 % at over twice the pair's largest torque), peak to peak 10 and 20 %;
    by width functions alone 20 and 35 %."""
    found = [loaded_te(involute(), (torque,), 16, slices=float(n), **HELD).te[0] for n in (5, 7, 10)]
    means, swings = [te.mean() for te in found], [np.ptp(te) for te in found]
    assert max(means) < (1 + mean) * min(means) and max(swings) < (1 + swing) * min(swings)


def slice_loads(model: StageModel, torque: float, positions: int) -> np.ndarray:
    """(positions, teeth, SLICES) N over one pitch."""
    kernel, pitch = statics_of(model, **{"effect.bearings": 0.0, "slices": float(SLICES)}), place_of(model, None).pitch
    found = [kernel.transmission(-i / positions * pitch, torque).forces for i in range(positions)]
    teeth = sorted(set().union(*found))
    return np.array([[forces.get(tooth, np.zeros(SLICES)) for tooth in teeth] for forces in found])


def test_a_line_that_ends_inside_the_width_has_no_peak_at_its_end() -> None:
    """No slice carries over 10 % more than the most on lines that cross the whole width, nor changes by over 18 % of
    that from one of 96 positions to the next; by width functions alone the peak is 45 % higher."""
    loads = slice_loads(involute(), 150.0, 96)
    whole = loads[(loads > 0).all(axis=2)].max()
    assert loads.max() < 1.1 * whole
    assert np.abs(np.diff(loads, axis=0)).max() < 0.18 * whole
    alone = slice_loads(by_functions_alone(involute()), 150.0, 96)
    assert alone.max() > 1.3 * whole


def test_more_width_functions_than_the_kernel_takes_are_refused() -> None:
    stage = load_stage("helical_demo")
    bodies = [SimpleNamespace(toothed=SimpleNamespace(width_functions=count)) for count in (9, 8)]
    with pytest.raises(ModelError, match="with 8 width functions: this stage takes at most 6: set width_functions = 6"):
        width_degrees(stage, bodies)
    assert width_degrees(load_stage("fzg_c"), bodies).tolist() == [0, 2, 4, 6]


@pytest.mark.parametrize("name", ["smeared", "smeared_tip"])
def test_a_model_with_half_of_what_slices_need_is_refused(name: str) -> None:
    sections = {key: value for key, value in read_blob(involute().blob).items() if key != f"{name}0"}
    with pytest.raises(ModelError, match="loads of width functions are not whole"):
        replace(involute(), blob=write_blob(sections)).kernel()


# ---- as a discretisation: what te, reports and plans say of their number ---------------------------------------------
def test_the_change_is_that_of_two_runs(helical: StageModel) -> None:
    """The largest change of an order, in metres, and in level of those that change by over ten nanometres."""
    left = left_of_slices(helical, [100.0], slices=3)
    three, six = (loaded_te(helical, [100.0], POSITIONS, slices=n).harmonics(ORDERS)[0] for n in (3.0, 6.0))
    heard = np.abs(six - three) > HEARD
    assert left.slices == 6 and left.length == pytest.approx(np.abs(six - three).max(), rel=1e-12)
    assert left.level == pytest.approx(np.abs(20 * np.log10(six / three))[heard].max(), rel=1e-12)
    assert left.text.startswith("orders 1 to 8 change by at most ") and left.text.endswith(" dB with 6 slices")


def test_spur_stages_have_nothing_to_say(plain: StageModel) -> None:
    assert left_of_slices(plain, [302.0]) is None and twice(plain.stage, 5) == 5


def test_no_more_slices_than_a_model_takes(helical: StageModel) -> None:
    assert [twice(helical.stage, n) for n in (1, 7, 10, 14, 20)] == [2, 14, 20, 20, 20]
    assert left_of_slices(helical, [100.0], slices=20) is None


@pytest.fixture
def one_table(helical: StageModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever `te` is asked for, its table is one, and without pictures."""
    result = loaded_te(helical, [100.0], 2)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gearfmu.stage.loaded_te", lambda *of, **where: result)
    for picture in ("write_plot", "write_flanks"):
        monkeypatch.setattr(f"gearfmu.report.te.{picture}", lambda *of: None)


@pytest.mark.usefixtures("one_table")
def test_te_says_what_the_slices_leave_open(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the stage as it was asked for: with held axes here."""

    def left(model: StageModel, torques: tuple[float], slices: None, mesh: str, **parameters: float) -> Change:
        assert (model.name, *torques, slices, parameters) == ("helical_demo", 100.0, None, {"effect.bearings": 0.0})
        return Change(14, 12e-9, 0.3)

    monkeypatch.setattr(refinement, "left_of_slices", left)
    with pytest.raises(SystemExit) as ended:
        cli.main(["te", "helical_demo", "--torque", "100 N*m", "--positions", "4", "--rigid-bearings"])
    assert not ended.value.code and Change(14, 12e-9, 0.3).text in capsys.readouterr().out


@pytest.mark.usefixtures("one_table")
@pytest.mark.parametrize(
    ("stage", "option", "said"),
    [
        ("helical_demo", [], 1),
        ("helical_demo", ["--once"], 0),
        ("two_stage", [], 0),
        ("two_stage", ["--twice-slices"], 2),
    ],
)
def test_te_says_it_of_pairs_and_where_it_is_asked(
    stage: str, option: list[str], said: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once a mesh; trains and sets, where it takes long, on request alone."""
    asked: list[str] = []
    monkeypatch.setattr(refinement, "left_of_slices", lambda *of, **parameters: asked.append(stage))
    with pytest.raises(SystemExit):
        cli.main(["te", stage, "--torque", "100 N*m", "--positions", "2", *option])
    assert len(asked) == said


@pytest.mark.parametrize(("name", "times"), [("train_runup", 2), ("pair_loaded", 1)])
def test_plans_measure_against_twice_the_slices_of_helical_stages(name: str, times: int) -> None:
    scene = load_scene(name)
    found = space(scene, stage_model(scene))
    own = scene.stage.slices
    assert found.full.slices == times * own == max(found.slices) and own in found.slices


@pytest.mark.full
@pytest.mark.parametrize(("slices", "least"), [(7, 7e-9), (10, 6e-9)])
@pytest.mark.parametrize("torque", [45.0, 200.0])
@pytest.mark.parametrize(("flanks", "tilt"), [(crowned, 0.0), (crowned, 20e-6), (involute, 20e-6), (involute, 50e-6)])
def test_twice_the_parts_of_crowned_and_tilted_flanks(
    flanks: Callable[[float], StageModel], tilt: float, torque: float, slices: int, least: float
) -> None:
    """Orders 1 to 8 by 1 dB or 7 nm from seven parts on, 6 nm from ten on. Least margin: 6.6 and 5.3 nm in the second
    order of the crowned pair at part load; 3.4 nm elsewhere with ten."""
    own, twice = (mesh_harmonics(errors(flanks(tilt), torque, n)[None], 8)[0] for n in (slices, 2 * slices))
    heard = np.abs(20 * np.log10(own / twice)) > 1.0
    assert np.abs(own - twice)[heard].max(initial=0.0) < least, (own, twice)
