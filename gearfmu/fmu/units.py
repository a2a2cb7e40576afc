"""Units of the kernel's variables as FMI 2 units: exponents of the SI base units, and the usual display units."""

from __future__ import annotations

import math
import re

from gearfmu.errors import FmuError
from gearfmu.kernel import Variable

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
ATOMS: dict[str, dict[str, int]] = {
    **{name: {name: 1} for name in BASE},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
}
DISPLAY = {  # the first is that of the variables
    "rad": (("deg", 180 / math.pi),),
    "rad/s": (("rev/min", 30 / math.pi),),
    "m": (("um", 1e6), ("mm", 1e3)),
    "s": (("us", 1e6), ("ms", 1e3)),
}
SAME = {"N.s/m2": "Pa.s"}  # one unit has one name in an FMU


def unit_of(variable: Variable) -> str | None:
    """Name of a variable's unit in the model description: "1" for a Real without one, as in Modelica; None for other
    types."""
    return SAME.get(variable.unit, variable.unit or "1") if variable.type == "Real" else None


def base_exponents(unit: str) -> dict[str, int]:
    """Exponents of the SI base units of a unit in Modelica notation, e.g. "N.s/m2" → {"kg": 1, "m": -1, "s": -1}.

    Products are written with ".", one "/" divides by all that follows it. Raises FmuError on anything else."""
    exponents: dict[str, int] = {}
    if unit == "1":
        return exponents
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for factor in filter(None, part.split(".")):
            match = re.fullmatch(r"([A-Za-z]+)(-?\d+)?", factor)
            if not match or match[1] not in ATOMS:
                raise FmuError(f"unit {unit!r}: {factor!r} is not known; known are {', '.join(ATOMS)}")
            for base, power in ATOMS[match[1]].items():
                exponents[base] = exponents.get(base, 0) + sign * power * int(match[2] or 1)
    return {base: exponents[base] for base in BASE if exponents.get(base)}
