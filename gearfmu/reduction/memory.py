"""How much memory the reduction of a body takes, known from its mesh before the work, and whether it is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gearfmu.errors import MeshError
from gearfmu.femesh.cyclic_cut import CyclicCut
from gearfmu.femesh.mesh import FeMesh
from gearfmu.stagefile.forms.planetary import CarrierMeshSpec
from gearfmu.stagefile.tables.bodies import BodySpec, MeshSpec

_BASE = 0.2e9  # bytes of the program with its packages, and of small arrays
_FACTOR = 21.0  # entries of the factor per unknown to the power 4/3; measured 19 to 25 on sectors of 5 to 34 thousand
_SPARSE = 3000.0  # bytes per unknown of finite-element matrices, on the sector and in its coordinates
_WHOLE_FACTOR = 30.0  # of the factor of a whole body: measured 29 to 33
_SPACE = 36  # fields of the space of low modes per mode of a family
CARRIER_FACTORS = 5  # of K, at the three points of Krylov's method and at one of the reference
_PART_FACTORS = 3  # of one of its equal parts, in single precision: K and at the last two points
_PART_FACTOR = 48.0  # entries of a carrier's sector per unknown to the power 4/3, and fronts that wait
MESH_COARSER = "mesh the body coarser"  # the remedy for finite elements made elsewhere
_MEMORY_TABLE = Path("/proc/meminfo")


@dataclass(frozen=True)
class Need:
    """Unknowns of one of the `sectors` of a body, or of all of it, and bytes of memory that its reduction takes at
    most, estimated within a quarter."""

    unknowns: int
    memory: float
    sectors: int = 1

    @property
    def whole(self) -> bool:
        """Is the body reduced as a whole?"""
        return self.sectors == 1

    @property
    def size(self) -> str:
        """The unknowns in words."""
        return f"{self.unknowns} unknowns" + ("" if self.whole else " a sector")

    @property
    def text(self) -> str:
        """For a line of progress."""
        return f"{self.size}, about {self.memory / 1e9:.1f} GB"


def gear_need(sector: FeMesh, body: BodySpec) -> Need:
    """Need of a gear: its sector (FeMesh) and counts of the reduction (BodySpec)."""
    return sector_need(sector, sector.teeth, body.modes, 2 * body.roll_points * body.width_functions)


def sector_need(sector: FeMesh | CyclicCut, teeth: int, modes: int, tooth_loads: int) -> Need:
    """Need of a gear that is reduced by cyclic symmetry; sector: its nodes, cut_minus and cut_plus; modes: stored."""
    cut, unknowns = 3 * len(sector.cut_minus), 3 * (len(sector.nodes) - len(sector.cut_plus))
    loads, family = 2 * tooth_loads, modes / teeth + 4
    matrices = 3 * (2 * cut) ** 2 + loads**2 * (teeth / 2 + 4)
    fields = unknowns * (3 * loads + 2 * _SPACE * family)
    memory = _BASE + 8 * (_FACTOR * unknowns ** (4 / 3) + matrices + fields) + _SPARSE * unknowns
    return Need(unknowns, memory, teeth)


def available_memory() -> float | None:
    """Bytes that programs can still take (MemAvailable); None where the system does not report it."""
    try:
        lines = _MEMORY_TABLE.read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    found = [line.split()[1] for line in lines if line.startswith("MemAvailable:")]
    return 1024.0 * float(found[0]) if found else None


def whole_need(unknowns: int, vectors: int, factors: int) -> Need:
    """Need of a body that is reduced as a whole: so many factors of its matrices and full vectors beside them."""
    numbers = factors * _WHOLE_FACTOR * unknowns ** (4 / 3) + unknowns * vectors
    return Need(unknowns, _BASE + 8 * numbers + _SPARSE * unknowns)


def parts_need(unknowns: int, parts: int, vectors: int) -> Need:
    """Need of a body of equal parts (`fem.repeated`), of its `unknowns` in all, and full vectors beside the factors."""
    factors = 4 * _PART_FACTORS * _PART_FACTOR * (unknowns / parts) ** (4 / 3)
    return Need(unknowns, _BASE + factors + 8 * unknowns * vectors + _SPARSE * unknowns)


def modes_need(unknowns: int) -> Need:
    """Need of the lowest modes of a carrier by its sector of so many unknowns."""
    return Need(unknowns, _BASE + 8 * _PART_FACTOR * unknowns ** (4 / 3) + 2 * _SPARSE * unknowns)


def require_memory(need: Need, remedy: str) -> None:
    """MeshError where the memory is not there. remedy: counts to lower."""
    there = available_memory()
    if there is None or need.memory <= there:
        return
    raise MeshError(
        f"the reduction takes about {need.memory / 1e9:.1f} GB of memory ({need.size}), "
        f"{there / 1e9:.1f} GB are free: {remedy}, or end other programs"
    )


def lower_counts(counts: MeshSpec | CarrierMeshSpec, table: str) -> str:
    """The remedy where element counts (MeshSpec, CarrierMeshSpec) of `table` can be lowered."""
    own = {name: value for name, value in counts.model_dump().items() if isinstance(value, int)}
    named = ", ".join(f"{name} = {value}" for name, value in own.items())
    return f"lower the counts of {table} ({named}, times scale = {counts.scale:g})"
