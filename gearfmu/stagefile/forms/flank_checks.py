"""What is said of the teeth of a gear or a ring (`flanks.Toothing`): can it be so, and where its files and points of
single contact are."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeVar

from gearfmu.errors import Problem
from gearfmu.geometry.gear import ReferenceGear
from gearfmu.ranges import kernel_limits
from gearfmu.stagefile.reading.files import Layers
from gearfmu.stagefile.tables.flanks import Toothing
from gearfmu.stagefile.tables.topography import read_topography

_LARGEST = 0.1  # of the module: reliefs, crownings, slopes, eccentricity
_LARGEST_INDEX_DEVIATION = 0.05  # of the module: coarser than every tolerance class of ISO 1328-1
_ROUND = 1e-6  # m: by how much single pitch deviations may miss their sum, zero

Gear = TypeVar("Gear", bound=Toothing)
Found = Iterator[tuple[str, float | str, str]]


def flank_problems(gear: Any, shape: Any) -> Found:
    """Everything that cannot be of the teeth of one gear or ring. shape : its GearGeometry or InternalGearGeometry."""
    yield from _amounts(gear, shape)
    yield from _reliefs(gear, shape)
    yield from _pitches(gear, shape)
    if gear.lead is not None and gear.lead.end_relief is not None and 2 * gear.lead.end_relief.length > gear.face_width:
        remedy = f"the reliefs of both ends meet: at most half the face width, {_mm(gear.face_width / 2)}"
        yield "lead.end_relief.length", gear.lead.end_relief.length, remedy


def _amounts(gear: Any, shape: ReferenceGear) -> Found:
    """Lengths that a module bounds."""
    most = _LARGEST * shape.m
    given = {
        "tip_relief.amount": gear.tip_relief and gear.tip_relief.amount,
        "root_relief.amount": gear.root_relief and gear.root_relief.amount,
        "profile.slope": gear.profile and gear.profile.slope,
        "profile.crowning": gear.profile and gear.profile.crowning,
        "lead.slope": gear.lead and gear.lead.slope,
        "lead.crowning": gear.lead and gear.lead.crowning,
        "lead.end_relief.amount": gear.lead and gear.lead.end_relief and gear.lead.end_relief.amount,
        "eccentricity.amount": gear.eccentricity and gear.eccentricity.amount,
    }
    for field, value in given.items():
        if value and abs(value) > most:
            yield field, value, f"more than a tenth of the module: at most {_mm(most)}"


def _reliefs(gear: Any, shape: Any) -> Found:
    """Beginnings of reliefs lie on the flank."""
    low, high = sorted((shape.s_form, shape.s_a))
    for field in ("tip_relief", "root_relief"):
        relief = getattr(gear, field)
        if relief is None or isinstance(relief.start_roll, str):
            continue
        if not low <= relief.start_roll <= high or relief.start_roll == (
            shape.s_a if field == "tip_relief" else shape.s_form
        ):
            yield f"{field}.start_roll", relief.start_roll, f"outside the flank: from {_mm(low)} to {_mm(high)}"
            continue
        steepest = kernel_limits()["RELIEF"][1]
        end = shape.s_a if field == "tip_relief" else shape.s_form
        if relief.amount > steepest * (end - relief.start_roll) ** 2:
            least = _mm(math.sqrt(relief.amount / steepest))
            yield f"{field}.start_roll", relief.start_roll, f"too near the end of the flank: at least {least} from it"


def _pitches(gear: Any, shape: ReferenceGear) -> Found:
    """Deviations of teeth that there are, within what a gear can have."""
    largest = _LARGEST_INDEX_DEVIATION * shape.m
    for tooth, deviation in gear.index_deviation.items():
        field = f"index_deviation.{tooth}"
        if tooth >= gear.teeth:
            yield field, deviation, f"there is no such tooth: they are numbered 0 to {gear.teeth - 1}"
        elif abs(deviation) > largest:
            yield field, deviation, f"more than a twentieth of the module: at most {_mm(largest)}"
    single = gear.pitch_deviation
    if single and len(single) != gear.teeth:
        yield "pitch_deviation", f"{len(single)} values", f"a gear has as many pitches as teeth: give {gear.teeth}"
    elif single and abs(math.fsum(single)) > _ROUND:
        remedy = "single pitch deviations of all teeth sum to zero: correct them, or give index_deviation"
        yield "pitch_deviation", f"sum {_mm(math.fsum(single))}", remedy
    elif single and max(map(abs, single)) > largest:
        remedy = f"more than a twentieth of the module: at most {_mm(largest)}"
        yield "pitch_deviation", max(single, key=abs), remedy
    elif single and (most := max(accumulate(single), key=abs)) and abs(most) > largest:
        remedy = f"they sum to more than a twentieth of the module: at most {_mm(largest)}"
        yield "pitch_deviation", f"sum {_mm(most)}", remedy


def with_rolls(gear: Gear, mesh: Any, index: int) -> Gear:
    """The same gear with points of single contact turned into rolls. mesh : PairGeometry or RingMesh in which it is
    gear `index`."""
    points = {"tip_relief": mesh.outer_single_contact, "root_relief": mesh.inner_single_contact}
    found = {}
    for field, point in points.items():
        relief = getattr(gear, field)
        if relief is not None and isinstance(relief.start_roll, str):
            found[field] = relief.model_copy(update={"start_roll": point(index)})
    return gear.model_copy(update=found) if found else gear


def located(part: Any, layers: Layers, place: str) -> Any:
    """A toothed member with its files as seen from here. place : its table, "gears.pinion"."""
    found: dict[str, Any] = {}
    if part.imported is not None:
        found["imported"] = part.imported.located(layers, f"{place}.import")
    if part.topography is not None:
        found["topography"] = str(layers.holder(f"{place}.topography").parent / part.topography)
    return part.model_copy(update=found) if found else part


def topography_problems(gear: Any, shape: Any, layers: Layers, place: str) -> list[Problem]:
    """What is wrong with the topography that a gear names; its files as seen from here."""
    if gear.topography is None:
        return []
    _, problems = read_topography(Path(gear.topography), gear.teeth, shape)
    if problems and not Path(gear.topography).is_file():
        return [Problem(str(layers.path), f"{place}.topography", Path(gear.topography).name, problems[0].remedy)]
    return problems


def _mm(value: float) -> str:
    return f"{1e3 * value:.6g} mm"
