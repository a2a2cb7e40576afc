"""How much memory the reduction of a gear takes, known from its mesh before the work, and whether it is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gearfmu.errors import MeshError

_BASE = 0.2e9  # bytes of the program with its packages, and of what is small
_FACTOR = 21.0  # entries of the factor per unknown to the power 4/3; measured 19 to 25 on sectors of 5 to 34 thousand
_SPARSE = 3000.0  # bytes per unknown of finite-element matrices, on the sector and in its coordinates
_SPACE = 36  # fields of the space of low modes per mode of a family
_MEMORY_TABLE = Path("/proc/meminfo")


@dataclass(frozen=True)
class Need:
    """Unknowns of a sector, and bytes of memory that its reduction takes at most, estimated within a quarter."""

    unknowns: int
    memory: float

    @property
    def text(self) -> str:
        """For a line of progress."""
        return f"{self.unknowns} unknowns a sector, about {self.memory / 1e9:.1f} GB"


def gear_need(sector: Any, body: Any) -> Need:
    """Need of a gear: its sector (FeMesh) and what a spec says about the reduction (BodySpec)."""
    cut, unknowns = 3 * len(sector.cut_minus), 3 * (len(sector.nodes) - len(sector.cut_plus))
    loads = 4 * body.roll_points * body.width_functions
    family = body.modes / sector.teeth + 4
    matrices = 3 * (2 * cut) ** 2 + loads**2 * (sector.teeth / 2 + 4)
    fields = unknowns * (3 * loads + 2 * _SPACE * family)
    return Need(unknowns, _BASE + 8 * (_FACTOR * unknowns ** (4 / 3) + matrices + fields) + _SPARSE * unknowns)


def available_memory() -> float | None:
    """Bytes that programs can still take (MemAvailable); None where the system does not tell."""
    try:
        lines = _MEMORY_TABLE.read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    found = [line.split()[1] for line in lines if line.startswith("MemAvailable:")]
    return 1024.0 * float(found[0]) if found else None


def require_memory(need: Need, counts: Any) -> None:
    """MeshError where the memory is not there, with the element counts (MeshSpec) to lower."""
    there = available_memory()
    if there is None or need.memory <= there:
        return
    named = ", ".join(f"{name} = {getattr(counts, name)}" for name in ("flank", "thickness", "root", "rim", "width"))
    raise MeshError(
        f"the reduction takes about {need.memory / 1e9:.1f} GB of memory ({need.unknowns} unknowns a sector), "
        f"{there / 1e9:.1f} GB are free: lower the counts of body.mesh ({named}, times scale = {counts.scale:g}), "
        "or end other programs"
    )
