"""FMUs of gear stages: model description, native and pythonfmu FMU, validation.

`export` is imported when it is used: the processes of `validate` need neither bodies nor stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearfmu.fmu.validate import validate

if TYPE_CHECKING:
    from gearfmu.fmu.package import export

__all__ = ["export", "validate"]


def __getattr__(name: str) -> object:
    if name != "export":
        raise AttributeError(f"module 'gearfmu.fmu' has no attribute {name!r}")
    from gearfmu.fmu.package import export

    return export
