"""Optional packages: imported where they are used, and asked for by name where they are missing."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from gearfmu.errors import GearfmuError


class MissingPackage(GearfmuError, ImportError):
    """An optional package that this installation lacks."""


def required(module: str, extra: str) -> Any:
    """The module of an optional package. MissingPackage names the extra of gearfmu that installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise MissingPackage(f"this needs the package {package}: pip install 'gearfmu[{extra}]'") from error


def has(module: str) -> bool:
    """Whether an optional package is installed."""
    return importlib.util.find_spec(module) is not None
