"""From a stage's name to its bodies and its model, as `gearfmu.api` makes them, with progress bars."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import Progress, progress_bar

if TYPE_CHECKING:
    from gearfmu.stage import StageModel


def model_of(
    stage: str, port_kinds: Mapping[str, str] | None = None, bores: str | None = None, observe: Sequence[str] = ()
) -> StageModel:
    """`api.assemble` of STAGE, saying where bodies lie that are not the stage's own."""
    from gearfmu.api.models import assemble, bodies_folder, load

    spec = load(stage)
    folder = bodies_folder(spec, bores)
    with progress_bar("reducing" if folder is None else f"reducing, bores {bores}") as progress:
        model = assemble(spec, port_kinds, bores, observe, folder, progress)
    if folder is not None:
        click.echo(f"bodies with bores {bores}: {folder}")
    return model


def bodies_of(stage: str) -> tuple[Any, list[Any]]:
    """The spec of STAGE and its bodies (`api.reduce`)."""
    from gearfmu.api.models import load, reduce

    spec = load(stage)
    with progress_bar("reducing") as progress:
        return spec, reduce(spec, progress=progress)


def bodies_for_motion(stage: str) -> tuple[Any, list[Any]]:
    """`bodies_of` for a verb that needs a model of the stage: a SpecError, before anything is reduced, for a set that
    does not say all that it needs to move."""
    from gearfmu.spec.expand import as_general
    from gearfmu.spec.stage import load_stage

    as_general(load_stage(stage))
    return bodies_of(stage)


def by_text(progress: Progress | None) -> Callable[[str, float], None] | None:
    """The progress function of reduce_stage, called with (what is being done, share done)."""
    return None if progress is None else lambda text, share: progress(share, text)
