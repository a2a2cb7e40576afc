"""The kernel keeps to gk_ranges.h, the header that Python reads: a number at a limit is taken, one beyond refused."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from small_model import pair_blob, with_nodes

from gearfmu.errors import ModelError
from gearfmu.kernel import Kernel
from gearfmu.quantities import HEADER, kernel_limits
from gearfmu.stage.assembly.blob import read_blob, write_blob

BLOB = with_nodes(pair_blob(("chain", "spring")))
KNOWN: Mapping[str, Any] = read_blob(BLOB)
VARIABLES = {v.name: v for v in Kernel(BLOB).variables.values()}
Change = Callable[[float], dict[str, Any]]


def at(section: str, place: int) -> Change:
    """One number of a section of the small pair's blob."""

    def change(value: float) -> dict[str, Any]:
        numbers = KNOWN[section].copy()
        numbers[place] = value
        return {section: numbers}

    return change


def filled(section: str, shape: tuple[int, ...]) -> Change:
    """A section that the small pair has not, all of one number."""
    return lambda value: {section: np.full(shape, value)}


def flank(value: float) -> dict[str, Any]:
    return {"flank_size0": np.array([1, 1, 4], np.int32), "flank0": np.full((1, 2, 1, 4), value)}


CASES: dict[str, list[Change]] = {
    "SLICES": [at("counts", 1)],
    "ROTORS": [at("counts", 2)],
    "GEARS": [at("counts", 3)],
    "ENGAGEMENTS": [at("counts", 4)],
    "PORTS": [at("counts", 5)],
    "SUPPORTS": [at("counts", 6)],
    "TEETH": [at("size0", 1)],
    "NODES": [at("nodes0", 0), at("nodes1", 1)],
    "BASE_RADIUS": [at("gear0", 0)],
    "FACE_WIDTH": [at("gear0", 5)],
    "STRIP": [at("gear0", 7)],
    "RELIEF": [at("gear0", 8)],
    "TIP_EDGE": [at("gear0", 10)],
    "PLACE": [at("gear0", 13)],
    "AXIS": [at("engagement", place) for place in range(4)],
    "BACKLASH": [at("engagement", 4)],
    "CONTACT_DAMPING": [at("engagement", 6)],
    "TILT": [at("engagement", 8), at("engagement", 9)],
    "FLANK_DEPTH": [filled("lead1", (2, 33)), flank],
    "RUNOUT": [filled("runout0", (4,))],
    "DAMPING_RATIO": [at("zeta0", 0), at("zeta_ground0", 3)],
    "PENALTY": [at("nodal", 0)],
    "PORT_STIFFNESS": [at("ports", 0), at("ports", 4), at("ports", 6)],
    "PORT_DAMPING": [at("ports", 1), at("ports", 5), at("ports", 7)],
    "INERTIA": [at("ports", 2), at("ports", 3), at("inertia", 0)],
    "CUT": [at("limits", 0), at("limits", 1)],
}
OF_VARIABLES = {
    "BACKLASH": "backlash",
    "CONTACT_DAMPING": "contact_damping",
    "FRICTION": "friction_coefficient",
    "VISCOSITY": "oil_viscosity",
    "ROUGHNESS": "flank_roughness",
    "FILM_ROUGHNESS": "film_roughness",
    "CAPACITY": "pinion.clutch.capacity",
    "SPEED": "pinion.disc.w_start",
    "STEP": "h",
    "SLICES": "slices",
}


def verdict(sections: dict[str, Any]) -> str:
    """What the kernel says of the blob with these sections; empty when it takes it."""
    try:
        Kernel(write_blob(KNOWN | sections))
    except ModelError as error:
        return str(error)
    return ""


def beyond(limit: float, outwards: int, whole: bool) -> float:
    """A number just beyond a limit."""
    return limit + outwards * (1 if whole else max(1e-6 * abs(limit), 1e-15))


@pytest.mark.parametrize("row", CASES)
def test_a_number_of_the_blob_ends_where_the_header_says(row: str) -> None:
    for change in CASES[row]:
        for limit, outwards in zip(kernel_limits()[row], (-1, 1), strict=True):
            section, values = next(reversed(change(limit).items()))
            whole = values.dtype.kind == "i"
            assert "is out of range" not in verdict(change(limit)), f"{section} at {limit:g}"
            said = verdict(change(beyond(limit, outwards, whole)))
            assert "out of range" in said, f"{section} beyond {limit:g}: {said or 'taken'}"
            if section not in ("flank0", "runout0"):
                shown = re.search(r" = (\S+) is out of range, from (\S+) to ([^;]+); correct the stage", said)
                assert shown and tuple(map(float, shown.groups()[1:])) == pytest.approx(kernel_limits()[row])


@pytest.mark.parametrize("row", OF_VARIABLES)
def test_a_variable_ends_where_the_header_says(row: str) -> None:
    name = OF_VARIABLES[row]
    assert (VARIABLES[name].minimum, VARIABLES[name].maximum) == kernel_limits()[row]
    for limit, outwards in zip(kernel_limits()[row], (-1, 1), strict=True):
        Kernel(BLOB, {name: limit})
        with pytest.raises(ModelError, match=f"{re.escape(name)} = .*out of range"):
            Kernel(BLOB, {name: beyond(limit, outwards, VARIABLES[name].type == "Integer")})
    with pytest.raises(ModelError, match="not finite"):
        Kernel(BLOB, {name: math.nan})


def test_every_row_of_the_header_is_tried_and_used() -> None:
    assert set(kernel_limits()) == set(CASES) | set(OF_VARIABLES) | {"TORQUE"}
    torque = {v.name: v for v in Kernel(pair_blob(("torque", "fixed"))).variables.values()}["pinion.tau"]
    assert (torque.minimum, torque.maximum) == kernel_limits()["TORQUE"]
    assert HEADER.read_text(encoding="utf-8").count("#define GK_LOW_") == len(kernel_limits())


@pytest.mark.parametrize(("name", "value"), [("slices", 2.5), ("mesh.force", 0.0), ("no.such", 0.0)])
def test_what_no_variable_takes_is_refused(name: str, value: float) -> None:
    kernel = Kernel(BLOB)
    with pytest.raises(ModelError, match=re.escape(name) if name != "no.such" else "no variable"):
        kernel.set(name, value)
