"""The C kernel and the only ctypes of the project: `Kernel` runs one instance of a stage model (src/gk.h is the
contract)."""

from __future__ import annotations

from gearfmu.kernel.build import library_path
from gearfmu.kernel.instance import Kernel, TeState, Variable

__all__ = ["Kernel", "TeState", "Variable", "library_path"]
