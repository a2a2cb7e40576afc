"""Scenes under friction of the flanks, coefficient 0.1, and with oil between them: reversal, at rest, light load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evidence.stability.bench import Variant, geometry, kernel, model
from evidence.stability.case import Case, Finding
from evidence.stability.checks import at_least, at_most, finding, mean_torque, near
from evidence.stability.loads import DRAG, DRIVEN, LARGEST, LOOSE, NOMINAL, RELIEVED, SWING, H, swinging
from evidence.stability.motion import RPM, Constant, Step, Turning, loaded, winding
from evidence.stability.record import run

MU = 0.1
FRICTION = {"effect.friction": 1.0, "friction_coefficient": MU}
FILM = {"effect.film": 1.0, "oil_viscosity": 0.01}


def rubbing_reversal(case: Case) -> Finding:
    """Friction and ±torque_max through the backlash and back, at 2000 rpm and, in the middle of it, at rest: torque
    carried to 3 %, which friction adds to or takes from."""
    return reversal(case, FRICTION)


def rubbing_standstill(case: Case) -> Finding:
    """Friction and 302 N·m at rest for 10 s: once the start has died away, after 1 s, force and transmission error may
    not creep by more than 2e-4: load patches at the limit of friction give way to rounding, by 1.2e-4."""
    pair = geometry(RELIEVED)
    made = run(kernel(model(RELIEVED), case, FRICTION), loaded(RELIEVED, Constant(0.0), NOMINAL), 10.0, 1e-3)
    late, said, facts = made.after(1.0), [], {}
    for name in ("mesh.force_mean", "mesh.te"):
        facts[f"creep_of_{name}"] = float(np.ptp(late[name]) / abs(late[name][0]))
        said += at_most(f"change of {name}", facts[f"creep_of_{name}"], 2e-4)
    return finding(made, pair, said, facts)


def rubbing_light_load(case: Case) -> Finding:
    """Friction in idle rattle: the driver swings at 53 Hz, a drag of 4.4 N·m on a loose wheel. The impulse of the mesh
    is that of the drag to 2 %, and some contact is lost."""
    return light_load(case, FRICTION)


def rubbing_turns_for_long(case: Case) -> Finding:
    """Friction and 302 N·m at 2000 rpm for 10 s: mean force and its ripple of the last second are those of the second
    one to 1e-3 and 1e-2."""
    pair = geometry(RELIEVED)
    made = run(kernel(model(RELIEVED), case, FRICTION), loaded(RELIEVED, Constant(2000 * RPM), NOMINAL), 10.0, H)
    force = made["mesh.force_mean"]
    early, late = force[(made.time > 1) & (made.time < 2)], force[made.time > 9]
    facts = {"mean": float(late.mean() / early.mean() - 1), "ripple": float(late.std() / early.std() - 1)}
    said = at_most("change of the mean force", abs(facts["mean"]), 1e-3)
    said += at_most("growth of its ripple", facts["ripple"], 1e-2)
    return finding(made, pair, said, facts)


def oiled_reversal(case: Case) -> Finding:
    """As `rubbing_reversal`, friction and ±torque_max through the backlash, with oil of 10 mPa·s in the open gaps."""
    return reversal(case, FRICTION | FILM)


def oiled_light_load(case: Case) -> Finding:
    """Idle rattle as under friction, with a squeeze film of 10 mPa·s instead."""
    return light_load(case, FILM)


def reversal(case: Case, effects: Mapping[str, float]) -> Finding:
    """±torque_max at 2000 rpm, at rest in between."""
    pair, ends = geometry(RELIEVED), (winding(RELIEVED, LARGEST), winding(RELIEVED, -LARGEST))
    turn = Turning(RELIEVED, Constant(2000 * RPM), (Step(0.02, 0.025, *ends), Step(0.065, 0.07, ends[1], ends[0])))
    made = run(kernel(model(RELIEVED), case, effects), turn, 0.12, H)
    middle = (made.time > 0.045) & (made.time < 0.065)
    coast = pair.gears[0].r_b * made["mesh.force_mean"][middle].mean()
    drive = mean_torque(made.after(0.095), pair)
    said = near("mean torque on the coast flanks", coast, -LARGEST, 0.03)
    said += near("mean torque afterwards", drive, LARGEST, 0.03)
    said += at_least("impacts", made["mesh.impacts"][-1], 2)
    return finding(made, pair, said, {"coast_torque_Nm": coast, "drive_torque_Nm": drive})


def light_load(case: Case, effects: Mapping[str, float]) -> Finding:
    """A driver that swings, a drag on a loose wheel."""
    variant, frequency, periods = Variant(ports=(DRIVEN, LOOSE)), 53.0, 20
    pair = geometry(variant)
    inputs, start = swinging(1500 * RPM, frequency, SWING, DRAG)
    made = run(
        kernel(model(variant), case, {**start, **effects}), inputs, (periods + 5) / frequency, 1 / frequency / 188
    )
    steady = made.after((5 - 1e-6) / frequency)
    torque = mean_torque(steady, pair) * pair.gears[1].r_b / pair.gears[0].r_b
    said = near("mean torque of the mesh on the wheel, its impulse,", torque, DRAG, 0.02)
    said += at_least("share without contact", float(np.mean(steady["mesh.contact"] == 0)), 0.1)
    return finding(made, pair, said, {"drag_Nm": torque})
