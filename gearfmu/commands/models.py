"""From a stage's name to its bodies and its model: load, reduce what is missing, assemble."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

from gearfmu.commands.shared import Progress, progress_bar

if TYPE_CHECKING:
    from gearfmu.spec.stage import StageSpec
    from gearfmu.stage import StageModel


def model_of(stage: str, port_kinds: Mapping[str, str] | None = None) -> StageModel:
    """The StageModel of STAGE, with other kinds of port where `port_kinds` (shaft → kind) says so."""
    spec, bodies = bodies_of(stage)
    from gearfmu.stage import assemble

    return assemble(with_ports(spec, port_kinds or {}), bodies)


def bodies_of(stage: str) -> tuple[StageSpec, list[Any]]:
    """StageSpec and ReducedBody objects of STAGE; bodies that are missing or stale are reduced first, with a
    progress bar."""
    from gearfmu.spec.stage import load_pair

    spec = load_pair(stage)
    from gearfmu.body import reduce_stage

    with progress_bar("reducing") as progress:
        return spec, reduce_stage(spec, progress=by_text(progress))


def by_text(progress: Progress | None) -> Callable[[str, float], None] | None:
    """The progress function of reduce_stage, called with (what is being done, share done)."""
    return None if progress is None else lambda text, share: progress(share, text)


def with_ports(spec: StageSpec, kinds: Mapping[str, str]) -> StageSpec:
    """The StageSpec with the ports' kinds replaced; a usage error for a shaft it does not have or a spring without k
    and c."""
    unknown = set(kinds) - set(spec.ports)
    if unknown:
        raise click.BadParameter(
            f"no shaft '{min(unknown)}'; the stage has {', '.join(spec.ports)}", param_hint="--port"
        )
    ports = dict(spec.ports)
    for shaft, kind in kinds.items():
        if kind == "spring" and ports[shaft].k is None:
            raise click.BadParameter(
                f"{shaft}=spring needs k and c in [ports.{shaft}] of {spec.source}", param_hint="--port"
            )
        chain = ports[shaft].chain if kind == "spring" else None
        ports[shaft] = ports[shaft].model_copy(update={"kind": kind, "chain": chain})
    return spec.model_copy(update={"ports": ports})
