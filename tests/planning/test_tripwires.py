"""Every tripwire of a planned run, pulled once, beside a leg that leaves it alone; and what the run goes on with."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearfmu.planning.book import Segment
from gearfmu.planning.choice import Choice
from gearfmu.planning.judge import (
    Signals,
    error,
    silent_outputs,
    split_half_noise,
    trend,
)
from gearfmu.planning.request import Output, Request
from gearfmu.planning.tripwires import BALANCE, COAST, CONTACT, FELL_BACK, TIP, Trip, Wires, answer
from gearfmu.stage import Trace
from gearfmu.stage.run.trace import Channel

MESHES = ("stage1", "stage2", "stage3")
WIRES = Wires(SimpleNamespace(stage=SimpleNamespace(engagements=[SimpleNamespace(name=m) for m in MESHES])))
PLANNED = Choice("fast", 1e-5, 3, ("hertz",))
NOTHING: dict[str, Any] = dict.fromkeys(
    ("safety", "bound", "error", "noise", "price", "realtime", "price_full", "price_default", "error_default"), 0.0
)
LOADED = Segment("steady", 0.0, 0.1, "loaded", PLANNED, 0.02, 0.01, 0.01, **NOTHING)
WITHOUT_COAST = PLANNED.without("coast_flank")
FALLBACK, FLANK_ENDED, OTHER_BITS = 2, 16, 1 + 4 + 8 + 32 + 64 + 128  # as in the description of solver.status
PLAIN: dict[str, Any] = {
    **{f"{mesh}.open_time": [0.3, 0.3, 0.3] for mesh in MESHES},  # of legs before
    "solver.status": [0, 0, 0],
    "energy.work": [10.0, 10.5, 11.0],
    "energy.dissipated": [1.0, 1.2, 1.4],
    "energy.stored": [0.5, 0.4, 0.5],
    "energy.residual": [0.0, 0.0, 0.0],
}


def leg(**changed: list[float]) -> Trace:
    """A leg without event but what is changed: `__` stands for the dot of a name."""
    values = PLAIN | {name.replace("__", "."): value for name, value in changed.items()}
    return Trace(np.array([0.0, 1e-3, 2e-3]), {name: Channel(np.array(value)) for name, value in values.items()})


def seen(trace: Trace, segment: Segment = LOADED, choice: Choice = PLANNED) -> str:
    """The wire that tripped, "" for none; at the end of the leg, in its segment."""
    trip = WIRES.look(trace, segment, choice)
    assert trip is None or (trip.time, trip.segment, trip.answer) == (2e-3, "steady", "")
    return trip.wire if trip else ""


def test_a_leg_without_event_trips_no_wire() -> None:
    """Neither does what happened before the leg: opened contacts, bits of the status; nor bits of no wire."""
    assert seen(leg()) == ""
    assert seen(leg(), choice=WITHOUT_COAST) == ""
    assert seen(leg(solver__status=[18, 18, 18])) == ""
    assert seen(leg(solver__status=[0, 0, OTHER_BITS])) == ""


@pytest.mark.parametrize("mesh", MESHES)
def test_every_mesh_that_opens_is_seen(mesh: str) -> None:
    """Red where only the first mesh is looked at, or where only an opening that lasts to the end of the leg counts."""
    opened = leg(**{f"{mesh}__open_time": [0.3, 0.3001, 0.3001]})
    assert seen(opened) == CONTACT
    assert seen(opened, choice=WITHOUT_COAST) == COAST
    assert "0.1 ms" in WIRES.look(opened, LOADED, PLANNED).message  # type: ignore[union-attr]


def test_loss_of_contact_is_no_event_where_it_was_planned_for() -> None:
    """In a segment of another kind, or with a set that is already richer than planned."""
    opened = leg(stage2__open_time=[0.3, 0.3, 0.4])
    assert seen(opened, replace(LOADED, kind="contact_loss")) == ""
    assert seen(opened, choice=replace(PLANNED, h=5e-6)) == ""
    assert seen(opened, replace(LOADED, kind="contact_loss"), WITHOUT_COAST) == COAST


@pytest.mark.parametrize(("bit", "wire"), [(FLANK_ENDED, TIP), (FALLBACK, FELL_BACK)])
def test_a_new_bit_of_the_status_is_seen(bit: int, wire: str) -> None:
    """Red where the bit is mistaken; a bit that was there when the leg began is no news, others do not hide it."""
    assert seen(leg(solver__status=[0, bit, bit])) == wire
    assert seen(leg(solver__status=[OTHER_BITS, OTHER_BITS, OTHER_BITS | bit])) == wire
    assert seen(leg(solver__status=[bit, bit, bit])) == ""


@pytest.mark.parametrize(
    ("name", "values"),
    [("work", [10.0, 10.0, 12.0]), ("dissipated", [1.0, 1.0, 3.0]), ("stored", [0.0, -2.0, 0.0])],
)
def test_the_balance_of_energy_is_judged_by_five_percent_of_what_moved(name: str, values: list[float]) -> None:
    """The largest of work, loss and storage is 2 J: 0.099 J may be left, 0.101 J not, of either sign. The first
    communication step is left out: a state that was taken over settles in it."""
    moved: dict[str, list[float]] = {"energy__work": [1.0] * 3, "energy__dissipated": [1.0] * 3}
    moved |= {"energy__stored": [0.0] * 3, f"energy__{name}": values}
    assert seen(leg(**moved, energy__residual=[0.0, 5.0, 5.099])) == ""
    assert seen(leg(**moved, energy__residual=[0.0, 5.0, 5.101])) == BALANCE
    assert seen(leg(**moved, energy__residual=[0.0, 5.0, 4.899])) == BALANCE


def test_the_first_wire_is_the_one_whose_answer_is_cheapest() -> None:
    """All at once: the effect that was off comes before bits of the status, those before the balance."""
    energy = [0.0, 0.0, 9.0]
    opened = {"stage3__open_time": [0.3, 0.4, 0.4]}
    assert seen(leg(**opened, solver__status=[0, 18, 18], energy__residual=energy), choice=WITHOUT_COAST) == COAST
    assert seen(leg(solver__status=[0, 18, 18], energy__residual=energy)) == TIP
    assert seen(leg(solver__status=[0, 2, 2], energy__residual=energy)) == FELL_BACK


# ---- what the run goes on with ---------------------------------------------------------------------------------------


def after(wire: str, choice: Choice) -> Choice | None:
    return answer(choice, Trip("steady", 0.0, wire, ""), LOADED)


def test_the_effect_that_was_missing_is_put_back_and_nothing_else() -> None:
    both = PLANNED.without("coast_flank").without("tip_contact")
    assert after(COAST, both) == PLANNED.without("tip_contact")
    assert after(TIP, both) == PLANNED.without("coast_flank")


@pytest.mark.parametrize("wire", [TIP, FELL_BACK, BALANCE, "divergence"])
def test_all_else_is_answered_by_every_effect_and_half_the_step(wire: str) -> None:
    """Red where the step stays: the next leg would trip the same wire. Rigid gears become elastic."""
    assert after(wire, PLANNED) == Choice("fast", 5e-6, 3)
    assert after(wire, replace(PLANNED, level="rigid")) == Choice("fast", 5e-6, 3)
    assert after(wire, replace(PLANNED, level="standard", off=())) == Choice("standard", 5e-6, 3)


def test_lost_contact_keeps_the_step_where_an_effect_was_off() -> None:
    assert after(CONTACT, PLANNED) == Choice("fast", 1e-5, 3)
    assert after(CONTACT, replace(PLANNED, off=())) == Choice("fast", 5e-6, 3)


def test_below_a_fifth_of_a_microsecond_there_is_no_answer() -> None:
    assert after(BALANCE, replace(PLANNED, h=0.4e-6)) == Choice("fast", 0.2e-6, 3)
    assert after(BALANCE, replace(PLANNED, h=0.39e-6)) is None


# ---- errors in budgets -----------------------------------------------------------------------------------------------
STEP, COUNT = 2e-5, 4000
TIME = STEP * np.arange(COUNT)
SINE = np.sin(2 * np.pi * 1000.0 * TIME)
LEVEL = Request((Output("a", (("a", 1.0),)),), (200.0, 5000.0), level=1.0)
WAVE = Request(LEVEL.outputs, LEVEL.band, waveform=0.05)


def of(values: np.ndarray) -> Signals:
    return Signals({"a": values}, STEP)


def test_a_level_is_judged_in_decibels_of_the_budget() -> None:
    found = error(of(10 ** (0.5 / 20) * SINE), of(SINE), LEVEL)
    assert found.whole == pytest.approx(0.5, rel=1e-6)
    assert found.bound == pytest.approx(found.whole, rel=1e-6)  # the nested windows agree


def test_what_lies_outside_the_band_does_not_count() -> None:
    slow = 100.0 * np.sin(2 * np.pi * 20.0 * TIME) + 3.0 * TIME
    assert error(of(SINE + slow), of(SINE), LEVEL).whole < 1e-3


def test_a_waveform_is_judged_after_the_common_delay() -> None:
    later = np.sin(2 * np.pi * 1000.0 * (TIME - 1.3 * STEP))
    assert error(of(later), of(SINE), WAVE).whole < 0.05  # the window does not move along
    assert error(of(1.05 * later), of(SINE), WAVE).whole == pytest.approx(1.0, rel=1e-3)


def test_windows_that_disagree_raise_the_bound() -> None:
    growing = SINE * np.linspace(1.0, 1.2, COUNT)
    found = error(of(growing), of(SINE), LEVEL)
    assert found.bound > found.whole + 0.1


def test_a_run_that_failed_is_infinitely_wrong() -> None:
    assert error(Signals({}, STEP), of(SINE), LEVEL).bound == np.inf
    assert error(of(np.full(COUNT, np.nan)), of(SINE), LEVEL).bound == np.inf


def test_noise_is_the_difference_of_the_halves() -> None:
    louder = SINE * np.where(TIME < TIME[COUNT // 2], 1.0, 10 ** (2.0 / 20))
    assert split_half_noise(of(louder), LEVEL) == pytest.approx(2.0, abs=0.01)


def test_slow_growth_is_seen_and_scatter_is_not() -> None:
    assert trend(of(SINE * 10 ** (3.0 * TIME / TIME[-1] / 20)), LEVEL) == pytest.approx(3.0, abs=0.5)
    random = np.random.default_rng(1).normal(size=COUNT)
    assert trend(of(random), LEVEL) < 0.5


def test_an_output_without_a_signal_in_the_band_is_named() -> None:
    assert silent_outputs(of(np.full(COUNT, 5.0)), LEVEL) == ["a"]
    assert silent_outputs(of(SINE), LEVEL) == []
