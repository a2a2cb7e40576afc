"""Vibration modes: of one body with their shapes, and of the linearised stage. As `gearfmu.modes(stage)` the verb."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

from gearfmu.modes.shapes import BodyModes, Mode

__all__ = ["BodyModes", "Mode"]


class _Callable(ModuleType):
    def __call__(self, *stage: object, **how: object) -> object:
        """`gearfmu.api.stages.modes`: the verb and this package have one name."""
        return import_module("gearfmu.api.stages").modes(*stage, **how)


sys.modules[__name__].__class__ = _Callable
