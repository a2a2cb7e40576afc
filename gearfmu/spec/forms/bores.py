"""A stage whose gears' bores are coupled otherwise than its file says."""

from __future__ import annotations

from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.spec.forms.general import RingBody, Stage
from gearfmu.spec.forms.members import Form
from gearfmu.spec.forms.planetary import PlanetarySpec


def with_bores(spec: Form, coupling: str) -> Any:
    """The stage with the bores of all its gears "averaging" or "rigid"; those of imported bodies too. Rims of rings and
    shafts stay as they are. SpecError for a planetary set, whose gears keep averaging bores."""
    if isinstance(spec, PlanetarySpec):
        remedy = "the gears of a planetary set keep averaging bores: leave it away"
        raise SpecError([Problem(str(spec.source), "bore", coupling, remedy)])
    if isinstance(spec, Stage):
        gears = {gear.name: _coupled(gear, coupling) for gear in spec.gears if not isinstance(gear, RingBody)}
        return spec.model_copy(update={"bodies": spec.bodies | gears})
    return spec.model_copy(update={"gears": tuple(_coupled(gear, coupling) for gear in spec.gears)})


def _coupled(gear: Any, coupling: str) -> Any:
    if gear.imported is None:
        return gear.model_copy(update={"bore_coupling": coupling})
    return gear.model_copy(update={"imported": gear.imported.model_copy(update={"bore_coupling": coupling})})
