"""Every number of stage and scene files has a range: beyond it the file is refused by name, value, range and remedy, at
once, and an option or an argument with the same number is refused in the same words."""

from __future__ import annotations

import importlib
import math
import pkgutil
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
from pydantic import BaseModel

import gearfmu as gf
import gearfmu.scenefile
import gearfmu.stagefile
from gearfmu.cli import outcome
from gearfmu.errors import GearfmuError, Problem, SpecError
from gearfmu.quantities import Range, all_ranges, kernel_limits, range_of
from gearfmu.stage.run.steady import CASE_RANGES, PARAMETER_RANGES
from gearfmu.stagefile.reading.base import Quantity, Spec, Whole, metadata_of, validate
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.connections import Misalignment
from gearfmu.stagefile.tables.profile import read_profile

Annotation = Quantity | Whole
FILE = "some.toml"


def classes(kind: type[Spec] = Spec) -> set[type[Spec]]:
    """Every class of a table that a file may hold."""
    for package in (gearfmu.stagefile, gearfmu.scenefile):
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{package.__name__}.{module.name}")
    own = kind.__module__.startswith(("gearfmu.stagefile", "gearfmu.scenefile")) and bool(kind.model_fields)
    return ({kind} if own else set()).union(*(classes(inner) for inner in kind.__subclasses__()))


@dataclass(frozen=True)
class Number:
    """A number in a field. write: what the file says of the field for one number, as text with its unit."""

    kind: type[Spec]
    field: str
    annotation: Annotation | None
    write: Callable[[Any], Any]

    def __str__(self) -> str:
        return f"{self.kind.__name__}.{self.field}"

    @property
    def range(self) -> Range:
        assert self.annotation is not None
        return self.annotation.range

    def problems(self, value: float) -> list[Problem]:
        """What is wrong with the field where it has this number."""
        key = self.kind.model_fields[self.field].alias or self.field
        found = validate(self.kind, {key: self.write(written(self.annotation, value))}, FILE)[1]
        return [p for p in found if p.field == key or p.field.startswith((f"{key}.", f"{key}["))]


def written(annotation: Annotation | None, value: float) -> Any:
    """A number as a file says it."""
    if isinstance(annotation, Quantity) and annotation.unit:
        return f"{value!r} {annotation.unit}"
    return int(value) if isinstance(annotation, Whole) and math.isfinite(value) else value


def parts(annotation: Any, metadata: tuple[Any, ...] = ()) -> Iterator[tuple[Annotation | None, Callable[[Any], Any]]]:
    """Every number of an annotation, and how it is written with the others at their lowest."""
    own = next((item for item in metadata if isinstance(item, (Quantity, Whole))), None)
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from parts(inner[0], inner[1:])
    elif annotation in (int, float):
        yield own, lambda value: value
    elif origin in (Union, types.UnionType):
        for one in inner:
            yield from parts(one, metadata)
    elif origin is tuple and inner[-1] is not Ellipsis:
        for place, one in enumerate(inner):
            yield from _inside(parts(one), partial(_placed, place, [filling(other) for other in inner]))
    elif origin is tuple:
        yield from _inside(parts(inner[0]), lambda value: [value])
    elif origin is dict:
        key, low = "1" if list(parts(inner[0])) else "some", filling(inner[1])
        yield from _inside(parts(inner[0]), lambda value: {str(value): low})
        yield from _inside(parts(inner[1]), lambda value: {key: value})


def _inside(numbers: Iterator[Any], around: Callable[[Any], Any]) -> Iterator[Any]:
    """The numbers, written with what is around them."""
    for number, write in numbers:
        yield number, lambda value, write=write: around(write(value))


def _placed(place: int, others: list[Any], value: Any) -> list[Any]:
    return [*others[:place], value, *others[place + 1 :]]


def filling(annotation: Any) -> Any:
    """What a file may say there."""
    for number, write in parts(annotation):
        return write(written(number, number.range.low if number else 0.0))
    return {"amount": "1 um"} if isinstance(annotation, type) and issubclass(annotation, BaseModel) else "some"


NUMBERS = [
    Number(kind, name, annotation, write)
    for kind in sorted(classes(), key=lambda kind: kind.__name__)
    for name, field in kind.model_fields.items()
    for annotation, write in parts(field.annotation, tuple(metadata_of(field)))
]


def test_every_number_of_every_table_has_a_range() -> None:
    bare = [str(number) for number in NUMBERS if number.annotation is None]
    assert not bare, f"no range: {bare}"
    assert len(NUMBERS) > 250 and len({number.kind for number in NUMBERS}) > 40
    used = {number.annotation.name for number in NUMBERS if number.annotation is not None}
    assert used <= set(all_ranges())
    unused = set(all_ranges()) - used - set(CASE_RANGES.values()) - set(PARAMETER_RANGES.values())
    assert not unused, f"ranges of nothing: {unused}"
    assert all(0 < len(own.remedy) < 150 and own.low < own.high for own in all_ranges().values())


def test_a_number_without_a_range_is_found() -> None:
    class Bare(Spec):
        weight: dict[str, tuple[float, ...]] | None = None

    found = list(parts(Bare.model_fields["weight"].annotation))
    assert [annotation for annotation, _ in found] == [None]


@pytest.mark.parametrize("number", NUMBERS, ids=str)
def test_the_limits_themselves_are_taken_and_nothing_beyond(number: Number) -> None:
    """Refused once, with file, field, range and remedy."""
    own, names = number.range, {"import": "imported", "class": "tolerance_class"}
    for limit, outwards in ((own.low, -1), (own.high, 1)):
        said = [p for p in number.problems(limit) if "out of range" in p.remedy]
        assert not said, said
        for off in (1e-6, 1e6):
            beyond = math.ceil(off) if isinstance(number.annotation, Whole) else off * (abs(limit) or own.high)
            (problem,) = number.problems(limit + outwards * beyond)
            assert problem.file == FILE and names.get(problem.field, problem.field).startswith(number.field)
            assert f"must be from {own.shown(own.low)} to {own.shown(own.high)}; {own.remedy}" in problem.remedy


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_number_is_nan_or_infinite(value: float) -> None:
    for number in NUMBERS:
        key = number.kind.model_fields[number.field].alias or number.field
        assert validate(number.kind, {key: number.write(value)}, FILE)[0] is None, number
        assert value not in number.range and "not a finite number" in number.range.refusal(value)


def test_ranges_that_the_kernel_has_too_are_the_kernel_s() -> None:
    shared = {name: own for name, own in all_ranges().items() if own.kernel}
    assert len(shared) > 20
    assert all((own.low, own.high) == kernel_limits()[own.kernel] for own in shared.values())
    assert 2 * range_of("planets").high == kernel_limits()["ENGAGEMENTS"][1]


def variant(folder: Path, text: str, base: str = "fzg_c") -> Path:
    path = folder / "stage.toml"
    path.write_text(f'base = "{gf.load(base).source.as_posix()}"\n{text}', encoding="utf-8")
    return path


def refused(path: Path) -> dict[str, Problem]:
    with pytest.raises(SpecError) as caught:
        load_stage(path)
    return {problem.field: problem for problem in caught.value.problems}


def test_what_numbers_come_to_together_is_refused_with_the_file(tmp_path: Path) -> None:
    """Each by itself in its range: axes that tilt too much, pitches that add up."""
    with pytest.raises(ValueError, match="the axes tilt by 0.02 rad, at most 0.01 rad"):
        Misalignment(in_plane=2e-3, span=0.1)
    pitches = ", ".join(['"200 um"'] * 8 + ['"-200 um"'] * 8)
    found = refused(variant(tmp_path, f"[gears.pinion]\npitch_deviation = [{pitches}]\n"))
    assert "they sum to more than a twentieth of the module" in found["gears.pinion.pitch_deviation"].remedy
    end = load_stage("fzg_c").written.geometry.gears[0].s_a
    steep = f'[gears.pinion.tip_relief]\namount = "0.4 mm"\nstart_roll = "{1e3 * end - 1e-3:.9g} mm"\n'
    start = refused(variant(tmp_path, steep))["gears.pinion.tip_relief.start_roll"]
    assert start.remedy.startswith("too near the end of the flank: at least 0.006")


def test_more_meshes_than_the_kernel_holds_are_refused_with_the_file() -> None:
    from gearfmu.stagefile.checks.stage import stage_problems

    stage = gf.load("two_stage")
    many = stage.model_copy(update={"engagements": stage.engagements[:1] * 13})
    found = {problem.field: problem.remedy for problem in stage_problems(many)}
    assert "the kernel holds at most 12 meshes" in found["engagements"]


def test_an_option_with_that_number_is_refused_in_the_words_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    of_file = refused(variant(tmp_path, '[contact]\ndamping = "50e9 N*s/m^2"\nslices = 21\n'))
    run = ["simulate", "fzg_c", "--torque", "100 N*m", "--speed", "1000 rpm", "--out", str(tmp_path / "out")]
    assert outcome([*run, "--set", "contact_damping=50e9", "--set", "slices=21"]) == 1
    said = capsys.readouterr().err
    assert f"contact_damping = 5e+10 N*s/m^2: {of_file['contact.damping'].remedy}" in said
    assert f"slices = 21: {of_file['contact.slices'].remedy}" in said and "Invalid value" not in said
    scene = load_scene_problem("test_rig.torque", "1e12 N*m")
    for verb in (run[:2] + ["--torque", "1e12 N*m", "--speed", "1000 rpm"], ["te", "fzg_c", "--torque", "1e12 N*m"]):
        assert outcome(verb) == 1
        assert f"torque = 1e12 N*m: {scene.remedy}" in capsys.readouterr().err


def load_scene_problem(field: str, value: str) -> Problem:
    with pytest.raises(SpecError) as caught:
        gf.load_scene("pair_loaded", {field: value})
    (problem,) = caught.value.problems
    assert problem.field == field
    return problem


def test_a_stage_that_is_refused_is_not_the_option_s_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = variant(tmp_path, '[contact]\ndamping = "50e9 N*s/m^2"\n')
    run = ["simulate", str(path), "--torque", "100 N*m", "--speed", "1000 rpm", "--set", "level=fast"]
    assert outcome(run) == 1
    said = capsys.readouterr().err
    assert "--set" not in said and f"{path}: contact.damping" in said


def test_arguments_are_refused_all_at_once() -> None:
    with pytest.raises(SpecError) as caught:
        gf.simulate("fzg_c", torque=math.nan, speed=math.inf, step=0.0, duration=-1.0, settle=-1.0)
    assert [problem.field for problem in caught.value.problems] == ["torque", "speed", "duration", "step", "settle"]
    for torque in (math.nan, "1e12 N*m", -math.inf):
        with pytest.raises(GearfmuError, match="must be from -1e\\+09 N\\*m to 1e\\+09 N\\*m"):
            gf.te("fzg_c", torque)


def test_a_profile_is_held_to_the_same_ranges(tmp_path: Path) -> None:
    path = tmp_path / "speeds.csv"
    path.write_text("time_[s],torque_[N*m],speed_[rpm]\n0,1,1000\n1,1e12,2e6\n", encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_profile(path)
    assert [problem.field for problem in caught.value.problems] == ["line 3, torque", "line 3, speed"]
