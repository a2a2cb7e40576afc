"""Descriptions of an FMU's variables: the kernel's table has one text for all instances, here each names its own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from gearfmu.kernel import Variable
from gearfmu.kernel.instance import INSTANCES
from gearfmu.spec.forms.general import Stage

OF_SUPPORT, OF_MODE = (13, 14, 15), 2**24  # numbers of the table; where references of amplitudes begin
AXES = {"x": "along x", "y": "along y", "z": "along z", "rx": "about x", "ry": "about y", "rz": "about z"}
LOADS = {f"{kind}{axis}": AXES[f"{tilt}{axis}"] for kind, tilt in (("f", ""), ("m", "r")) for axis in "xyz"}


def named(variables: Sequence[Variable], stage: Stage) -> list[Variable]:
    """The variables with descriptions that differ: "mesh of planet 3 with the ring: tooth pairs in contact"."""
    subjects = {mesh.name: mesh_name(*mesh.gears) for mesh in stage.engagements}
    subjects |= {f"{name}.gear": f"rotor {spoken(name)}" for name in stage.rotors}
    subjects |= {name: f"shaft {spoken(name)}" for name in stage.ports}
    return [replace(v, description=f"{subject}: {v.description}" if (subject := _subject(v, subjects)) else
                    v.description) for v in variables]  # fmt: skip


def spoken(name: str) -> str:
    """planet3 → planet 3, input_shaft → input shaft."""
    return re.sub(r"(?<=[A-Za-z])(?=\d)", " ", name).replace("_", " ")


def mesh_name(first: str, second: str) -> str:
    """The gear that there are several of comes first: "mesh of planet 3 with the ring"."""
    one, other = sorted((first, second), key=lambda name: not name[-1:].isdigit())
    return f"mesh of {spoken(one)} with {'' if other[-1:].isdigit() else 'the '}{spoken(other)}"


def _subject(variable: Variable, subjects: dict[str, str]) -> str:
    """Shaft, rotor, mesh, support or mode that a variable belongs to; "" for those of the whole stage."""
    place, _, last = variable.name.rpartition(".")
    if variable.reference >= OF_MODE:
        gear, _, motion = place.partition(".")
        return f"gear {spoken(gear)}, {f'rigid {AXES[last]}' if motion else spoken(last)}"
    if variable.reference // INSTANCES in OF_SUPPORT:
        return f"{spoken(place.replace('.', ' '))}, {(AXES | LOADS)[last.removesuffix('_mean')]}"
    while place and place not in subjects:
        place = place.rpartition(".")[0]
    return subjects.get(place, "")
