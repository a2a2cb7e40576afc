"""Which stage of a REXS file is meant, and what of the file was not used."""

from __future__ import annotations

from pathlib import Path

from gearfmu.errors import SpecError
from gearfmu.rexs.pair import draft_pair
from gearfmu.rexs.planetary import draft_set
from gearfmu.rexs.reading import Component, RexsModel, read_rexs
from gearfmu.stagefile.proposals.draft import Draft, Unread


def draft_from_rexs(path: Path, stage: str = "") -> Draft:
    """A draft of the gear stage in a REXS file, or of the one with the identifier or name `stage` where it has several.

    SpecError: the file is none, has no such stage, or does not say what a gear needs; all problems at once.
    """
    model = read_rexs(path)
    chosen = _chosen(model, stage)
    if chosen.type == "planetary_stage":
        draft = draft_set(model, chosen)
    else:
        draft = draft_pair(model, chosen, _gears(model, chosen))
    if model.problems:
        raise SpecError(model.problems)
    draft.unread = tuple(
        Unread(str(component), attribute.id, attribute.text, attribute.unit) for component, attribute in model.unread()
    )
    return draft


def _chosen(model: RexsModel, wanted: str) -> Component:
    sets = model.of_type("planetary_stage")
    parts = {mesh.id for one in sets for mesh in model.related(one, "cylindrical_stage", relation="assembly")}
    stages = [*sets, *(mesh for mesh in model.of_type("cylindrical_stage") if mesh.id not in parts)]
    fitting = [one for one in stages if wanted in ("", one.id, one.name)]
    if len(fitting) == 1:
        return fitting[0]
    known = "; ".join(str(one) for one in stages) or "none (only cylindrical_stage and planetary_stage are read)"
    remedy = f"say which stage with --stage: {known}" if fitting else f"there is no such stage: {known}"
    raise SpecError.of(model.path, "stage", wanted, remedy)


def _gears(model: RexsModel, stage: Component) -> tuple[Component, Component]:
    gears = model.related(stage, "cylindrical_gear", "ring_gear", relation="stage")
    if len(gears) != 2 or any(gear.type == "ring_gear" for gear in gears):
        listed = ", ".join(map(str, gears)) or "none"
        remedy = "a pair needs a relation of type stage with two cylindrical_gear; a ring alone is read in a set only"
        raise SpecError.of(model.path, str(stage), listed, remedy)
    return gears[0], gears[1]
