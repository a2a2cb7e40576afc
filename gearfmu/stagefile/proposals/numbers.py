"""A stage file from the few numbers that a designer begins with; everything else is proposed and marked so.

Profile shifts, tip circles: `gearfmu.geometry.shifts`. Loads, backlash, bores: the same usual values as for gear data
that a REXS file leaves out. What neither says is as in the shipped stage that is most alike.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.geometry.gear import GearGeometry, InternalGearGeometry
from gearfmu.geometry.mesh import contact_modulus, half_width
from gearfmu.geometry.shifts import ADDENDUM, DEDENDUM, Rack, distance_of_shifts, flank_length
from gearfmu.quantities import range_of, range_problems
from gearfmu.stagefile.checks.gears import STRIP_PER_HERTZ, rounded_down
from gearfmu.stagefile.proposals.draft import BACKLASH_PER_MODULE, STRIP_PER_MODULE, Draft, degrees, millimetres
from gearfmu.stagefile.proposals.new import free_target, write_drafted
from gearfmu.stagefile.stage import load_stage

GIVEN = "given"
_E_STAR = contact_modulus((206e9, 206e9), (0.3, 0.3))  # Pa, the steel of the shipped stages
INCH = 25.4e-3  # m
_SAME = 1e-4  # of the module: centre distances that agree
_LEAST_FILLET = 0.05  # of the module
_RANGES = {  # of the numbers of a Wish
    "module": "module", "width": "face_width", "planets": "planets", "center": "center_distance",
    "helix": "helix_angle", "pressure_angle": "pressure_angle", "torque": "torque_max", "speed": "speed_max",
    "relief": "relief",
}  # fmt: skip
_PATCH_PER_HERTZ = 2.0  # slices of tilted or helical teeth carry more than the mean


@dataclass(frozen=True)
class Wish:
    """Numbers of a stage that is to be (SI), None where they are left open.

    teeth: of pinion and wheel, or of sun, planet and ring (in ISO 21771 that of a ring is negative; both are read).
    module, width: normal module and common face width. planets: their number, None of a pair. unequal: planets stand
    at the places nearest to even ones at which their teeth fit. helix: of pinion or sun. torque, speed: the largest,
    of the pinion or the carrier. shifts, bores: profile shifts and bore diameters of both gears, of sun and planet.
    relief: tip relief of these gears, parabolic from the outer point of single contact.
    """

    teeth: tuple[int, ...]
    module: float | None = None
    width: float | None = None
    planets: int | None = None
    unequal: bool = False
    center: float | None = None
    helix: float = 0.0
    pressure_angle: float = math.radians(20)
    torque: float | None = None
    speed: float | None = None
    shifts: tuple[float, ...] = ()
    bores: tuple[float, ...] = ()
    relief: float = 0.0

    @property
    def rack(self) -> Rack:
        """Module and angles, which must be given."""
        return Rack(self.module or 0.0, self.pressure_angle, self.helix)

    @property
    def shown(self) -> str:
        """The numbers of teeth as a person writes them."""
        return " ".join(str(abs(z)) for z in self.teeth)


def wish_of(given: Mapping[str, Any]) -> Wish:
    """The numbers as a `Wish`, a diametral pitch (1/inch) in place of the module. SpecError where both are given."""
    numbers = {"teeth": (), **given}
    pitch = numbers.pop("diametral_pitch", None)
    if pitch is not None:
        if "module" in numbers or not pitch > 0:
            raise SpecError.of("", "diametral_pitch", f"{pitch:g}", "a positive number, or the module, not both")
        numbers["module"] = INCH / pitch
    return Wish(**numbers)


def new_from_numbers(name: str, wish: Wish, folder: str | os.PathLike[str] = ".") -> Path:
    """Write `folder`/`name`/stage.toml for these numbers and return its path; never overwrites.

    SpecError lists everything that is wrong with the numbers, by the names of `Wish`; nothing is written then.
    """
    free_target(name, folder)
    draft = draft_of(wish)
    kind = "planetary set" if wish.planets else "pair"
    origin = f"proposed for a {kind} of {wish.shown} teeth, m_n = {millimetres(wish.rack.m)}"
    with tempfile.TemporaryDirectory() as apart:  # an invalid stage is never left behind
        path = write_drafted(name, draft.tables, draft.marks, origin, apart)
        try:
            load_stage(path)
        except SpecError as error:
            raise SpecError(replace(problem, file="") for problem in error.problems) from None
    return write_drafted(name, draft.tables, draft.marks, origin, folder)


def draft_of(wish: Wish) -> Draft:
    """The draft of a stage. SpecError lists everything that is wrong with the numbers."""
    from gearfmu.stagefile.proposals.forms import draft_pair, draft_set

    wish = replace(wish, teeth=tuple(abs(z) for z in wish.teeth))
    if problems := [*_missing(wish), *_beyond(wish)]:
        raise SpecError(problems)
    return draft_set(wish) if wish.planets else draft_pair(wish)


def _missing(wish: Wish) -> Iterator[Problem]:
    form = "a planetary set has three: sun, planet, ring" if wish.planets else "a pair has two: pinion, wheel"
    if len(wish.teeth) != (3 if wish.planets else 2):
        other = "" if wish.planets or len(wish.teeth) != 3 else "; for a planetary set also give the number of planets"
        yield Problem("", "teeth", wish.shown, f"{form}{other}")
    if wish.module is None:
        yield Problem("", "module", "", 'this number is missing: give the normal module, such as "2.5 mm"')
    if wish.width is None:
        yield Problem("", "width", "", 'this number is missing: give the common face width, such as "20 mm"')
    for field, given in (("shifts", wish.shifts), ("bores", wish.bores)):
        if len(given) not in (0, 2):
            remedy = f"give two: of {'sun and planet' if wish.planets else 'both gears'}"
            yield Problem("", field, str(len(given)), remedy)
    if wish.unequal and not wish.planets:
        yield Problem("", "unequal", "", "this is about the places of planets: give their number")


def _beyond(wish: Wish) -> list[Problem]:
    given, kinds = vars(wish) | {"relief": wish.relief or None}, ("teeth", "teeth", "ring_teeth")
    numbers = {f"teeth ({z})": (float(z), range_of(kind)) for z, kind in zip(wish.teeth, kinds, strict=False)}
    numbers |= {field: (given[field], range_of(kind)) for field, kind in _RANGES.items()}
    numbers |= {f"bores ({bore:g} m)": (bore, range_of("bore")) for bore in wish.bores}
    numbers |= {f"shifts ({shift:g})": (shift, range_of("profile_shift")) for shift in wish.shifts}
    problems = range_problems(numbers)
    if wish.rack.fillet < _LEAST_FILLET:
        remedy = f"the tips of a rack with dedendum {DEDENDUM:g} m_n are pointed: take less, such as 25 deg"
        problems.append(Problem("", "pressure_angle", degrees(wish.pressure_angle), remedy))
    return problems


def begun(stage: str, wish: Wish, table: str, gears: tuple[str, ...]) -> Draft:
    """A draft like a shipped stage with what all forms share: the numbers of `table` ("pair" or "set") and, of every
    table in `gears`, width, tip edge, mesh and nominal flanks."""
    draft, rack = Draft.after(stage, "proposed"), wish.rack
    draft.put(f"{table}.normal_module", millimetres(rack.m), GIVEN)
    usual = math.isclose(rack.alpha, math.radians(20))
    draft.put(f"{table}.pressure_angle", degrees(rack.alpha), "proposed: the usual one" if usual else GIVEN)
    draft.put(f"{table}.helix_angle", degrees(rack.beta), GIVEN if rack.beta else "proposed: spur gears")
    draft.assume(f"{table}.backlash", millimetres(BACKLASH_PER_MODULE * rack.m), "2 % of the module")
    for gear in gears:
        draft.put(f"{gear}.face_width", millimetres(wish.width or 0.0), GIVEN)
        draft.put_proportions(gear, rack.m, wish.width or 0.0)
    return draft


def put_center(draft: Draft, wish: Wish, table: str, distance: float, why: str) -> None:
    """The centre distance (m) as given, or as proposed with the rule behind it."""
    if wish.center is None:
        draft.assume(f"{table}.center_distance", millimetres(distance), why)
    else:
        draft.put(f"{table}.center_distance", millimetres(distance), GIVEN)


def distance_of(wish: Wish, usual: float) -> float:
    """Centre distance (m) of the first two gears: as given, that of the given profile shifts, else `usual`. SpecError
    where both are given and disagree."""
    if not wish.shifts:
        return wish.center or usual
    rack, teeth, total = wish.rack, sum(wish.teeth[:2]), sum(wish.shifts)
    found = distance_of_shifts(rack.m, rack.alpha, rack.beta, teeth, total)
    if wish.center is not None and abs(wish.center - found) > _SAME * rack.m:
        remedy = f"the profile shifts, {total:g} together, belong to {millimetres(found)}: leave one of both away"
        raise SpecError.of("", "center", millimetres(wish.center), remedy)
    return wish.center or found


def put_gear(draft: Draft, wish: Wish, number: int, place: str, gear: GearGeometry, shift: str) -> None:
    """Teeth, profile shift (`shift`: the rule behind it), tip circle, rack, bore and relief of an external gear, which
    is 0 or 1 in `wish`."""
    draft.put(f"{place}.teeth", gear.z, GIVEN)
    draft.assume(f"{place}.profile_shift", round(gear.x, 6) + 0.0, shift)
    why = f"tip clearance 0.25 m_n kept; root diameter {millimetres(round(2 * gear.r_f, 6))}"
    draft.assume(f"{place}.tip_diameter", millimetres(2 * gear.r_a), why)
    rack = {"addendum": ADDENDUM, "dedendum": DEDENDUM, "fillet_radius": round(gear.rho_fp / gear.m, 6)}
    draft.put(f"{place}.rack", rack, "proposed: ISO 53, profile A")
    if wish.bores:
        draft.put(f"{place}.bore_diameter", millimetres(wish.bores[number]), GIVEN)
    else:
        draft.assume(f"{place}.bore_diameter", millimetres(round(gear.r_f, 4)), "half the root diameter")
    if wish.relief:
        relief = {"amount": f"{1e6 * wish.relief:g} um", "start_roll": "outer_single_contact", "kind": "parabolic"}
        draft.put(f"{place}.tip_relief", relief, GIVEN)


def put_patch(draft: Draft, place: str, gear: GearGeometry | InternalGearGeometry, load: float, radius: float) -> None:
    """Half-width of the load patch. load: N/m at torque_max, of helical flanks in the transverse section; radius: the
    largest relative radius of curvature, there too, m. SpecError where the patch is longer than the flank."""
    least = STRIP_PER_HERTZ * half_width(load, radius / math.cos(gear.beta_b), _E_STAR)
    usual, most = STRIP_PER_MODULE * gear.m, 0.5 * flank_length(gear)
    if least > most:
        shown = f"1.5 Hertz half-widths, {millimetres(least)}, are more than half the flank, {millimetres(most)}"
        remedy = f"{shown}: at most {100 * (most / least) ** 2:.2g} % of this torque, or a larger module or width"
        raise SpecError.of("", "torque", draft.at("torque_max"), remedy)
    wide = min(_PATCH_PER_HERTZ / STRIP_PER_HERTZ * least, most)
    why = "0.12 m_n" if usual >= wide else "2 Hertz half-widths at torque_max"
    value = usual if usual >= wide else max(least, rounded_down(wide, 3))
    draft.assume(f"{place}.body.strip_half_width", millimetres(value), why)


def put_slices(draft: Draft, rack: Rack, width: float) -> None:
    """Slices of helical gears, parts of a line of contact: seven, of long overlaps five to a whole overlap ratio."""
    if rack.beta:
        overlap = width * math.sin(abs(rack.beta)) / (math.pi * rack.m)
        draft.assume("contact.slices", min(max(7, round(5 * overlap)), 20), "seven, or five to a whole overlap ratio")
