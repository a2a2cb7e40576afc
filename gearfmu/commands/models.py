"""From a stage's name to its bodies and its model: load, reduce what is missing, assemble."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import Progress, progress_bar

if TYPE_CHECKING:
    from gearfmu.stage import StageModel


def model_of(
    stage: str, port_kinds: Mapping[str, str] | None = None, bores: str | None = None, observe: Sequence[str] = ()
) -> StageModel:
    """The StageModel of STAGE, with other kinds of port where `port_kinds` (port → kind) says so.

    bores : coupling of every bore, "averaging" or "rigid"; as the stage file says when None. observe : gears whose
    motion becomes outputs.
    """
    spec, bodies = bodies_for_motion(stage) if bores is None else _with_other_bores(stage, bores)
    from gearfmu.stage import assemble

    return assemble(of_other_kinds(spec, port_kinds or {}), bodies, observe=observe)


def bodies_of(stage: str) -> tuple[Any, list[Any]]:
    """StageSpec or GeneralStage and ReducedBody objects of STAGE; bodies that are missing or stale are reduced first,
    with a progress bar."""
    from gearfmu.spec.stage import load_stage

    spec = load_stage(stage)
    from gearfmu.body import reduce_bodies

    with reducing() as progress:
        return spec, reduce_bodies(spec, progress=progress)


def bodies_for_motion(stage: str) -> tuple[Any, list[Any]]:
    """`bodies_of` for a verb that needs a model of the stage: a SpecError, before anything is reduced, for a set that
    does not say all that it needs to move."""
    from gearfmu.spec.expand import as_general
    from gearfmu.spec.stage import load_stage

    as_general(load_stage(stage))
    return bodies_of(stage)


def _with_other_bores(stage: str, coupling: str) -> tuple[Any, list[Any]]:
    """`bodies_for_motion` with every bore coupled so. Bodies that are not those of the stage file lie in the folder
    `bores_<coupling>` beside it: the stage's own stay as they are."""
    from gearfmu.spec.stage import load_stage

    own = load_stage(stage)
    if own.kind == "planetary_set":
        raise click.UsageError("--bore: the gears of a planetary set keep averaging bores; leave it away")
    from gearfmu.body import reduce_stage
    from gearfmu.spec.bores import with_bores
    from gearfmu.spec.library import model_folder

    spec = with_bores(own, coupling)
    folder = None if spec == own else model_folder(own) / f"bores_{coupling}"
    with reducing(f"reducing, bores {coupling}") as progress:
        bodies = reduce_stage(spec, folder, progress=progress)
    if folder is not None:
        click.echo(f"bodies with bores {coupling}: {folder}")
    return spec, bodies


@contextmanager
def reducing(title: str = "reducing") -> Iterator[Callable[[str, float], None]]:
    """The progress function of reduce_stage: a bar on a terminal, else one line on standard error for every body that
    is being made, which takes a minute or more."""
    with progress_bar(title) as bar:
        yield by_text(bar) or _Told(title)


class _Told:
    """One line for each body."""

    def __init__(self, title: str) -> None:
        self.title, self._last = title, ""

    def __call__(self, text: str, share: float) -> None:
        name = text.split(":")[0].removeprefix("reducing ")
        if name != self._last:
            click.echo(f"{self.title} {name} …", err=True)
            self._last = name


def by_text(progress: Progress | None) -> Callable[[str, float], None] | None:
    """The progress function of reduce_stage, called with (what is being done, share done)."""
    return None if progress is None else lambda text, share: progress(share, text)


def of_other_kinds(spec: Any, kinds: Mapping[str, str]) -> Any:
    """The stage with the ports' kinds replaced; a usage error for a port it does not have or a spring without k and
    c."""
    from gearfmu.spec.turning import with_ports

    unknown = set(kinds) - set(spec.ports)
    if unknown:
        raise click.BadParameter(
            f"no shaft '{min(unknown)}'; the stage has {', '.join(spec.ports)}", param_hint="--port"
        )
    changed = {}
    for name, kind in kinds.items():
        port = spec.ports[name]
        if kind == "spring" and port.k is None:
            raise click.BadParameter(
                f"{name}=spring needs k and c in [ports.{name}] of {spec.source}", param_hint="--port"
            )
        chain = port.chain if kind == "spring" else None
        changed[name] = port.model_copy(update={"kind": kind, "chain": chain})
    return with_ports(spec, changed)
