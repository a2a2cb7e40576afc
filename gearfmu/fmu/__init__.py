"""FMUs of gear stages: model description, native and pythonfmu FMU, validation."""

from __future__ import annotations

from gearfmu.fmu.package import export
from gearfmu.fmu.validate import validate

__all__ = ["export", "validate"]
