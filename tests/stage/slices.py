"""Models whose slices yield as their width functions alone."""

from __future__ import annotations

from dataclasses import replace

from gearfmu.stage import StageModel
from gearfmu.stage.assembly.blob import read_blob, write_blob


def by_functions_alone(model: StageModel) -> StageModel:
    """The model without what slices yield of their own near the load, as spur gears are."""
    sections = {name: value for name, value in read_blob(model.blob).items() if not name.startswith("smeared")}
    return replace(model, blob=write_blob(sections))
