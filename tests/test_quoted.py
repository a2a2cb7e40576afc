"""Numbers that pages quote are those of the tables: a phrase with # for every number, and the cells where they stand.

A cell is `column` of the rows of a table that hold the given values; `column%` is in per cent, `column^` in thousands.
A number agrees when the table rounds to it; a tolerance, where one is given, is a share of the number.

    python tests/test_quoted.py    writes the numbers of the tables into the pages
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
STUDY, SETS, BODIES = (f"evidence/study/{name}.csv" for name in ("study", "sets", "bodies"))
STEPS, HARNESS = "evidence/price/steps.csv", "evidence/price/harness.csv"
KERNEL, IN_TIME, FRF = (
    "evidence/reduction/in_time/kernel.csv",
    "evidence/reduction/in_time/errors.csv",
    "evidence/reduction/frf_{}.csv",
)
METHODS = {"modal": "modal truncation", "craig_bampton": "Craig–Bampton", "rubin": "Rubin / MacNeal"}
METHODS |= {"krylov": "block Krylov"}
NUMBER = r"(\d[\d.]*(?:e[+-]?\d+)?)"


class Quote(NamedTuple):
    """A phrase of a page; cells: (table, row, columns), in the order of the numbers."""

    page: str
    phrase: str
    cells: tuple[tuple[str, dict[str, str], str], ...]
    tolerance: float = 0.0


def pair(level: str, h: str, scene: str = "pair_loaded", **more: str) -> dict[str, str]:
    """Row of the study of a pair."""
    return {"scene": scene, "level": level, "h_s": h, "slices": "5", "integrator": "dg4", **more}


def planets(level: str = "fast", h: str = "5e-06", count: str = "4", **more: str) -> dict[str, str]:
    """Row of the price list of sets."""
    row = {
        "planets": count,
        "level": level,
        "h_s": h,
        "speed": "85",
        "slices": "5",
        "off": "",
        "against": "full, 0.4 µs",
    }
    return row | more


def of_pairs() -> Iterator[Quote]:
    """What accuracy costs, pairs."""
    default, steps = pair("fast", "6.66667e-06"), {"stage": "fzg_c/stage_relief", "level": "fast", "h_s": "6.66667e-06"}
    loaded = (
        "At its default step a second of the loaded pair takes # s, # thousand instructions a step, at # % error in "
        "transmission error and # % in mesh force"
    )
    cells = ((STUDY, default, "realtime_factor"), (STEPS, steps, "instructions_per_step^"))
    yield Quote("README.md", loaded, (*cells, (STUDY, default, "te_error% force_error%")))
    slices = [(STUDY, pair("fast", "6.66667e-06") | {"slices": count}, "cpu_ratio") for count in ("1", "10")]
    yield Quote("docs/study.md", "One slice costs # of five, ten # times as much", tuple(slices))
    dear = "for # s (pair) to some # s (planetary set) of processor time a second"
    price = ((STUDY, default, "realtime_factor"), (SETS, planets(), "realtime_factor"))
    yield Quote("README.md", dear, price, 0.15)
    cheap = "10 µs give # and # % in # of real time"
    yield Quote("docs/study.md", cheap, ((STUDY, pair("fast", "1e-05"), "te_error% force_error% realtime_factor"),))
    light = [pair(level, "6.66667e-06", "pair_light") for level in ("fast", "standard", "full", "rigid")]
    phrase = (
        "# / # / # % of transmission error and # / # / # % of mesh force at `fast` / `standard` / `full`, "
        "`rigid` # and # %"
    )
    cells = [(STUDY, row, column) for column in ("te_error%", "force_error%") for row in light[:3]]
    yield Quote("docs/study.md", phrase, (*cells, (STUDY, light[3], "te_error% force_error%")))
    names = {"ten slices": "slices 10", "twice the rolls": "rolls 96", "twice the modes": "modes × 2"}
    for shown, refined in (names | {"mesh × 1.3": "mesh × 1.3", "all of them": "all of them"}).items():
        rows = [{"scene": scene, "refined": refined} for scene in ("pair_loaded", "pair_light", "clutch_closure")]
        cells = [(BODIES, row, "te_error% force_error%") for row in rows]
        yield Quote("docs/study.md", f"| {shown} | # / # | # / # | # / # |", tuple(cells))


def of_sets() -> Iterator[Quote]:
    """What accuracy costs, planetary sets; what a scene says of its level."""
    few = "Three planets at `fast`: # and # %, # s a second. Five: # and # %, # s."
    cells = [(SETS, planets(count=count), "te_error% force_error% realtime_factor") for count in ("3", "5")]
    yield Quote("docs/study.md", few, tuple(cells))
    modes = [(SETS, planets(*of), "n_dyn") for of in (("fast",), ("full", "1.25e-06"), ("standard",))]
    yield Quote("docs/study.md", "`fast` takes # of the # oscillators, `standard` #;", tuple(modes))
    own, both = {"against": "fast, 5 µs, 5 slices"}, "te_error% force_error%"
    slices = "*One slice* moves the ripple by # and # %, the mean transmission error by # times the ripple"
    yield Quote("docs/study.md", slices, ((SETS, planets(slices="1", **own), f"{both} te_mean_error"),))
    yield Quote("docs/study.md", "*Ten slices*: # and # %", ((SETS, planets(slices="10", **own), both),))
    effects = {"tip edges": "tip_contact", "tip relief": "tip_relief", "elastic bodies": "elastic"}
    effects |= {"Hertz's law": "hertz", "contact damping": "contact_damping"}
    for shown, effect in effects.items():
        yield Quote("docs/study.md", f"{shown} # and # %", ((SETS, planets(off=effect, **own), both),))
    for shown, effect in {"Centrifugal load": "centrifugal", "Coriolis forces": "coriolis"}.items():
        cells = [(SETS, planets(off=effect, speed=speed, **own), both) for speed in ("85", "300")]
        yield Quote("docs/study.md", f"{shown} # and # % (300 rad/s: # and # %)", tuple(cells))
    for scene in sorted((ROOT / "gearfmu" / "scenes").glob("planetary_*.toml")):
        said = "err by # % of their alternating part at level fast, by # % at"
        cells = [(SETS, planets(level), "force_error%") for level in ("fast", "standard")]
        yield Quote(f"gearfmu/scenes/{scene.name}", said, tuple(cells))


def of_coupling() -> Iterator[Quote]:
    """What a communication step costs beside the stage's."""
    parts = {"the unit: set, step without kernel, get, record": "unit_us"}
    parts |= {"the drivetrain: motion ahead, step (engine orders, tyre, road)": "drivetrain_us"}
    parts |= {"signals": "signals_us", "making the trace afterwards": "trace_us"}
    for shown, column in parts.items():
        cells = tuple((HARNESS, {"unit": unit, "channels": "76"}, column) for unit in ("fmu", "kernel"))
        yield Quote("docs/coupling.md", f"| {shown} | # µs | # µs |", cells)


def of_reduction() -> Iterator[Quote]:
    """Reduction methods over frequency and in time."""
    page = "docs/reduction.md"
    columns = "n max_error at_Hz median_error max_with_residual max_loaded_only seconds memory_MB"
    for table in ("carrier", "carrier_free", "ring"):
        for method, shown in METHODS.items():
            cells = ((FRF.format(table), {"method": method}, columns),)
            yield Quote(page, f"| {shown} | # | # | # | # | # | # | # | # |", cells)
    said = {("carrier", "reference_verified"): "direct solutions differ from the reference by #."}
    said |= {("carrier", "dof"): "# unknowns, bore held, 24 inputs", ("growth", "dof"): "Carrier of # unknowns."}
    said |= {
        ("carrier_free", "dof"): "judged with the bore held, # unknowns:",
        ("ring", "dof"): "# unknowns, six elastic",
    }
    for (table, column), phrase in said.items():
        row = {"method": "rubin"} | ({"n": "72"} if table == "growth" else {})
        yield Quote(page, phrase, ((FRF.format(table), row, column),))
    channels = ("bolt deflection, µm", "bolt tilt, mrad", "pin elongation, µm")
    for carrier, shown in {"modal 120": METHODS["modal"], "krylov 120": METHODS["krylov"]}.items():
        row = {"scene": "carrier_planet", "carrier": carrier, "gears": "rubin 60", "half_step": "False"}
        cells = tuple((IN_TIME, row | {"channel": channel}, "error late") for channel in channels)
        yield Quote(page, f"| {shown} | # (#) | # (#) | # (#) |", cells)
    models = {
        "unreduced finite elements, nodal penalty": "finite elements",
        "400 modes a gear": "finite elements, 400 modes",
    }
    models |= {"400 modes and static residual": "finite elements, 400 modes + residual"}
    models |= {"kernel, level `paper`: 400 modes, nodal contact": "kernel, level paper, nodal contact"}
    models |= {"kernel, level `paper` with line contact": "kernel, level paper, line contact"}
    models |= {"kernel, level `full`: residual, line contact, `dg4`": "kernel, level full"}
    for shown, model in models.items():
        yield Quote(page, f"| {shown} | # | # | # |", ((KERNEL, {"model": model}, "peak_N impulse_mNs closed_us"),))
    samples = [{"samples_mm": text} for text in ("9.6 14.4", "9.6 12 14.4", "9.6 10.8 12 13.2 14.4")]
    cells = [(FRF.format("thickness"), {"method": "krylov", **row}, "max_error") for row in samples]
    yield Quote(page, "largest error #, # and #.", tuple(cells))


QUOTES = [*of_pairs(), *of_sets(), *of_coupling(), *of_reduction()]


@cache
def rows_of(table: str) -> list[dict[str, str]]:
    """The rows of a table of the repository."""
    with (ROOT / table).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def numbers(cells: tuple[tuple[str, dict[str, str], str], ...]) -> Iterator[float]:
    """What the tables say, without signs."""
    for table, wanted, columns in cells:
        (row,) = [row for row in rows_of(table) if wanted.items() <= row.items()]
        for column in columns.split():
            factor = {"%": 100.0, "^": 1e-3}.get(column[-1], 1.0)
            yield factor * abs(float(row[column.rstrip("%^")]))


def places(text: str, quote: Quote) -> list[tuple[str, ...]]:
    """The numbers that a page shows, at every place of the phrase."""
    return [place.groups() for place in found(quote).finditer(text)]


def found(quote: Quote) -> re.Pattern[str]:
    """The phrase, over lines, with a group for every number."""
    return re.compile(re.escape(quote.phrase).replace(r"\#", NUMBER).replace(r"\ ", r"\s+"))


def written(shown: str, value: float) -> str:
    """A number with as many digits as are shown, and no fewer than its whole part has."""
    digits = len(shown.partition("e")[0].replace(".", "").lstrip("0"))
    if "e" in shown:
        return re.sub(r"e([+-])0", r"e\1", f"{value:.{digits - 1}e}")
    whole = "." not in shown and value >= 10
    return f"{value:.{0 if whole else max(0, digits - 1 - math.floor(math.log10(value)))}f}"


def mended(text: str, quote: Quote, number: int) -> str:
    """A page with the numbers of the tables where it shows others. number: of the place, where a phrase has several."""

    def rewrite(place: re.Match[str]) -> str:
        if place.start() != here.start():
            return place[0]
        result, shift = place[0], place.start()
        for group in range(place.re.groups, 0, -1):
            shown, value = place[group], values[group - 1]
            if not agrees(shown, value, quote.tolerance):
                begin, end = place.start(group) - shift, place.end(group) - shift
                result = result[:begin] + written(shown, value) + result[end:]
        return result

    values = list(numbers(quote.cells))
    right = (all(map(agrees, place, values, [quote.tolerance] * len(values))) for place in places(text, quote))
    at = list(found(quote).finditer(text))
    here = at[min(number, len(at) - 1)]
    return text if any(right) else found(quote).sub(rewrite, text)


def agrees(shown: str, value: float, tolerance: float) -> bool:
    """Whether a number rounds, or comes as near as the tolerance, to what is shown."""
    mantissa, _, exponent = shown.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(f"{mantissa}e{exponent or 0}") - value) <= max(0.5001 * last, tolerance * abs(value))


@pytest.mark.parametrize("page", sorted({quote.page for quote in QUOTES}))
def test_a_page_says_what_its_tables_say(page: str) -> None:
    text, wrong = (ROOT / page).read_text(encoding="utf-8"), []
    for quote in (quote for quote in QUOTES if quote.page == page):
        shown, values = places(text, quote), list(numbers(quote.cells))
        assert shown and len(shown[0]) == len(values), f"{quote.phrase}: found {len(shown)} times"
        if not any(all(agrees(*pair, quote.tolerance) for pair in zip(one, values, strict=True)) for one in shown):
            wrong.append(f"{quote.phrase}: {shown}, the table has {', '.join(f'{value:.4g}' for value in values)}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("shown", "value", "good"), [("0.5", 0.492, True), ("0.5", 0.44, False), ("2e-3", 0.0026, False)]
)
def test_a_number_agrees_when_it_rounds_to_what_is_shown(shown: str, value: float, good: bool) -> None:
    assert agrees(shown, value, 0.0) is good and agrees(shown, value, 0.5)


if __name__ == "__main__":
    for page in sorted({quote.page for quote in QUOTES}):
        text = (ROOT / page).read_text(encoding="utf-8")
        quotes = [quote for quote in QUOTES if quote.page == page]
        for k, quote in enumerate(quotes):
            text = mended(text, quote, sum(other.phrase == quote.phrase for other in quotes[:k]))
        (ROOT / page).write_text(text, encoding="utf-8")
