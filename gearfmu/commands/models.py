"""From a stage's name to its model: load, reduce what is missing, assemble."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gearfmu.commands.shared import progress_bar


def model_of(stage: str, ports: Mapping[str, str] | None = None) -> Any:
    """The StageModel of STAGE with the ports' kinds replaced by `ports` (shaft → kind); reduces bodies that are not up to date."""
    from gearfmu.body import reduce_stage
    from gearfmu.spec import load_stage
    from gearfmu.stage import assemble

    spec = load_stage(stage)
    with progress_bar("reducing") as progress:
        bodies = reduce_stage(spec, progress=progress)
    return assemble(spec, bodies) if not ports else assemble(spec, bodies, ports=dict(ports))
