"""From a stage's name to its bodies and its model, as `gearfmu.api` makes them, with progress bars."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

import click

from gearfmu.commands.shared import Progress, progress_bar

if TYPE_CHECKING:
    from gearfmu.body import Body
    from gearfmu.stage import StageModel
    from gearfmu.stagefile.forms.general import Stage


def model_of(
    stage: str, port_kinds: Mapping[str, str] | None = None, bores: str | None = None, observe: Sequence[str] = ()
) -> StageModel:
    """`api.assemble` of STAGE, saying where bodies lie that are not the stage's own."""
    from gearfmu.api.models import with_port_kinds
    from gearfmu.stage import assemble

    spec, bodies = bodies_for_motion(stage, bores)
    return assemble(with_port_kinds(spec, port_kinds or {}), bodies, observe=observe)


def model_in_scene(scene: str, stage: str | None, observe: Sequence[str] = ()) -> StageModel:
    """`api.assemble_in_scene` of STAGE, the scene's own when None."""
    from gearfmu.api.runs import assemble_in_scene

    with reducing() as progress:
        return assemble_in_scene(scene, stage, observe, progress)


def bodies_of(stage: str) -> tuple[Stage, list[Body]]:
    """The numbers of STAGE and its bodies (`api.reduce`)."""
    from gearfmu.api.models import load, reduce

    spec = load(stage)
    with reducing() as progress:
        return spec, reduce(spec, progress=progress)


def bodies_for_motion(stage: str, bores: str | None = None) -> tuple[Stage, list[Body]]:
    """`bodies_of` for a verb that needs a model of the stage (`api.reduced_to_move`); says where bodies lie that are
    not the stage's own."""
    from gearfmu.api.models import bodies_folder, load, reduced_to_move

    own = load(stage)
    folder = bodies_folder(own, bores)
    with reducing("reducing" if folder is None else f"reducing, bores {bores}") as progress:
        found = reduced_to_move(own, bores, folder, progress)
    if folder is not None:
        click.echo(f"bodies with bores {bores}: {folder}")
    return found


def reducing(title: str = "reducing") -> AbstractContextManager[Progress]:
    """A progress function for the reduction of bodies: a bar on a terminal, else a line on standard error for every
    body that is being made, and every ten seconds one with the present task and its share done."""
    return progress_bar(title, named=lambda text: text.split(":")[0])


def by_text(progress: Progress) -> Callable[[str, float], None]:
    """The progress function of reduce_bodies, called with (present task, share done)."""
    return lambda text, share: progress(share, text)


def parameters(model: StageModel, settings: tuple[str, ...], option: str = "--set") -> dict[str, float]:
    """Kernel parameters by name from "level=fast" or "slices=10", given to `option`; a usage error for names that the
    model lacks, SpecError for numbers out of range."""
    from gearfmu.errors import ModelError
    from gearfmu.stage.run import steady

    model.kernel_variables()  # a model that the kernel refuses is not the option's fault
    pairs = (text.partition("=") for text in settings)
    try:
        return steady.parameters(model, {name: value for name, _, value in pairs})
    except ModelError as error:
        raise click.BadParameter(str(error), param_hint=option) from None


def level_of(model: StageModel, level: str | None) -> dict[str, float]:
    """The kernel parameter of --level; none where it is not given."""
    return parameters(model, (f"level={level}",), "--level") if level else {}
