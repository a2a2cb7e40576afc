"""How a body was made: program versions, time and memory."""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from typing import Any

import numpy as np
import scipy


def provenance(seconds: float) -> dict[str, Any]:
    """Program versions, CPU seconds of the reduction and the peak memory of the process so far."""
    return {
        "gearfmu": metadata.version("gearfmu"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "cpu_s": round(seconds, 1),
        "peak_memory_GB": _peak_memory(),
    }


def _peak_memory() -> float | None:
    """Largest resident memory of this process so far; None where the system does not tell (Windows)."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (1e9 if sys.platform == "darwin" else 1e6), 2)
