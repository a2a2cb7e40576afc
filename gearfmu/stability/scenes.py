"""The list of scenes; the slowest first, so that parallel runs end together."""

from __future__ import annotations

from collections.abc import Callable

from gearfmu.stability import clutches, loads, sets, speeds, stepping, trains
from gearfmu.stability.case import Case, Finding

SCENES: dict[str, Callable[[Case], Finding]] = {
    function.__name__: function
    for function in (
        stepping.ten_million_steps,
        loads.standstill,
        speeds.run_up_and_down,
        loads.light_load_rattle,
        stepping.random_communication_steps,
        stepping.rollbacks,
        sets.planetary_backfire,
        clutches.clutch_dump,
        clutches.clutch_hundred_times,
        trains.train_closing_clutch,
        trains.train_reversal,
        trains.train_torque_step,
        loads.hardly_any_load,
        loads.start_in_mid_backlash,
        loads.torque_reversal,
        loads.overload,
        loads.high_speed,
        loads.tip_contact,
        loads.pitch_error,
        loads.soft_bearings,
        loads.stiff_bearings,
        loads.jammed,
    )
}


def what(name: str) -> str:
    """What happens in a scene and what must be seen there: its docstring on one line."""
    return " ".join((SCENES[name].__doc__ or "").split())
