"""The list of scenes; the slowest first, so that parallel runs end together."""

from __future__ import annotations

from collections.abc import Callable

from evidence.stability import (
    clutches,
    loads,
    rubbing,
    set_effects,
    set_faults,
    set_loads,
    set_rubbing,
    set_shifts,
    set_speeds,
    set_stepping,
    sets,
    speeds,
    stepping,
    trains,
)
from evidence.stability.case import Case, Finding

SCENES: dict[str, Callable[[Case], Finding]] = {
    function.__name__: function
    for function in (
        stepping.ten_million_steps,
        loads.standstill,
        rubbing.rubbing_turns_for_long,
        rubbing.rubbing_standstill,
        speeds.run_up_and_down,
        loads.light_load_rattle,
        rubbing.rubbing_light_load,
        rubbing.oiled_light_load,
        stepping.random_communication_steps,
        stepping.rollbacks,
        set_effects.set_each_effect_off,
        set_shifts.set_brake_shift,
        set_speeds.set_run_up_and_down,
        set_stepping.set_many_steps,
        set_stepping.set_random_communication_steps,
        set_stepping.set_rollbacks,
        set_loads.set_rattle,
        set_loads.set_hardly_any_load,
        set_effects.set_all_effects,
        set_faults.set_thin_ring,
        set_loads.set_reversal,
        set_rubbing.set_rubbing_reversal,
        set_loads.set_torque_step,
        set_loads.set_start_in_mid_backlash,
        set_loads.set_overload,
        set_loads.set_jammed,
        set_speeds.set_high_speed,
        set_shifts.set_clutch_dump,
        set_faults.set_pin_error,
        set_faults.set_floating_sun,
        set_faults.set_planet_without_contact,
        set_faults.set_tip_contact,
        set_faults.set_soft_pins,
        set_faults.set_stiff_supports,
        set_faults.set_star,
        set_stepping.set_standstill,
        sets.planetary_backfire,
        clutches.clutch_dump,
        clutches.clutch_hundred_times,
        trains.train_closing_clutch,
        trains.train_reversal,
        trains.train_torque_step,
        loads.hardly_any_load,
        loads.start_in_mid_backlash,
        loads.torque_reversal,
        rubbing.rubbing_reversal,
        rubbing.oiled_reversal,
        loads.overload,
        loads.high_speed,
        loads.tip_contact,
        loads.pitch_error,
        loads.flank_deviations,
        loads.soft_bearings,
        loads.stiff_bearings,
        loads.jammed,
    )
}


def what(name: str) -> str:
    """What happens in a scene and what must be seen there: its docstring on one line."""
    return " ".join((SCENES[name].__doc__ or "").split())
