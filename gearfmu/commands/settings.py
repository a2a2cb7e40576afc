"""Settings of the kernel given as options: "level=fast"."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from gearfmu.stage import StageModel


def parameters(model: StageModel, settings: tuple[str, ...], option: str = "--set") -> dict[str, float]:
    """Kernel parameters by name from "level=fast" or "slices=10", given to `option`; a usage error for what the model
    does not know, SpecError for numbers out of range."""
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
