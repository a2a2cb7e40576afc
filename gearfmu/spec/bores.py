"""A stage whose gears' bores are coupled otherwise than its file says."""

from __future__ import annotations

from typing import Any

from gearfmu.spec.general import GeneralStage, RingBody
from gearfmu.spec.stage import StageSpec


def with_bores(spec: StageSpec | GeneralStage, coupling: str) -> Any:
    """The stage with the bores of all its gears "averaging" or "rigid"; those of imported bodies too. Rims of rings and
    shafts stay as they are."""
    if isinstance(spec, GeneralStage):
        gears = {gear.name: _coupled(gear, coupling) for gear in spec.gears if not isinstance(gear, RingBody)}
        return spec.model_copy(update={"bodies": spec.bodies | gears})
    return spec.model_copy(update={"gears": tuple(_coupled(gear, coupling) for gear in spec.gears)})


def _coupled(gear: Any, coupling: str) -> Any:
    if gear.imported is None:
        return gear.model_copy(update={"bore_coupling": coupling})
    return gear.model_copy(update={"imported": gear.imported.model_copy(update={"bore_coupling": coupling})})
