"""Sun and first planet of `planetary54` as a pair on fixed axes, without tip relief, to compare with CalculiX."""

from __future__ import annotations

from gearfmu.body import Body, load_bodies
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.planetary import SetGearSpec
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import GearSpec

TORQUES = (37.5, 75.0)  # N·m on the sun: its share at 600 N·m on the carrier, and twice that


def sun_planet() -> Stage:
    """The pair."""
    of_set, pair = load_stage("planetary54").written, load_stage("fzg_c")
    form = pair.written
    fields = {name: getattr(of_set.set, name) for name in type(form.pair).model_fields if hasattr(of_set.set, name)}
    gears = tuple(_gear(*both) for both in zip(form.gears, (of_set.sun, of_set.planet), strict=True))
    return rewritten(pair, name="sun_planet", pair=form.pair.model_copy(update=fields), gears=gears)


def _gear(form: GearSpec, gear: SetGearSpec) -> GearSpec:
    fields = {name: getattr(gear, name) for name in type(form).model_fields if hasattr(gear, name)}
    return form.model_copy(update=fields | {"name": form.name, "tip_relief": None})


def set_bodies() -> list[Body]:
    """The two reduced gears of the set, as they are shipped."""
    return load_bodies(load_stage("planetary54"))[:2]
