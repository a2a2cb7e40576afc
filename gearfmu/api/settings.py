"""Keyword arguments with their types, for completion and type checkers: parameters of the kernel and options of runs.

Parameters of single meshes and ports ("stage1.backlash") depend on the stage: give them as **dict[str, Any]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias, TypedDict

from gearfmu.api.models import PathLike
from gearfmu.quantities import in_range, range_of, to_si
from gearfmu.scenefile.scene import Contact, Integrator, Level
from gearfmu.stagefile.tables.profile import Profile

Quantity: TypeAlias = str | float  # "302 N*m", or the SI number
Settings = TypedDict(
    "Settings",
    {
        "level": Level,
        "integrator": Integrator,
        "h": float,
        "slices": int,
        "phi_reference": Literal["as_given", "unloaded"],
        "contact": Contact,
        "backlash": float,
        "contact_damping": float,
        "contact_penalty": float,
        "friction_law": Literal["constant", "benedict_kelley", "iso_tr_14179"],
        "friction_coefficient": float,
        "oil_viscosity": float,
        "flank_roughness": float,
        "film_roughness": float,
        "effect.residual": bool,
        "effect.hertz": bool,
        "effect.coast_flank": bool,
        "effect.contact_damping": bool,
        "effect.tip_relief": bool,
        "effect.tip_contact": bool,
        "effect.bearings": bool,
        "effect.modal_damping": bool,
        "effect.elastic": bool,
        "effect.roll_motion": bool,
        "effect.coriolis": bool,
        "effect.centrifugal": bool,
        "effect.gyroscopic": bool,
        "effect.flank_deviations": bool,
        "effect.runout": bool,
        "effect.friction": bool,
        "effect.film": bool,
    },
    total=False,
)
Settings.__doc__ = """Parameters of the kernel (docs/variables.md), SI; those with dots go into a dictionary:
`own: gf.Settings = {"level": "fast", "effect.hertz": False}`, then `gf.simulate(…, **own)`."""


class RunSettings(Settings, total=False):
    """Settings of `simulate`. profile : torque, speed or both over time, a CSV file or arrays in SI."""

    profile: PathLike | Profile | None


class Starts(Settings, total=False):
    """Start values of an FMU. torque, speed : of the input, which it carries at the start."""

    torque: Quantity
    speed: Quantity


class PlanOptions(TypedDict, total=False):
    """Options of `plan`."""

    may_drop: Sequence[str]
    fresh: bool
    tell: Callable[[str], None]
    name: str


def checked(field: str, value: Quantity, name: str) -> float:
    """`in_si` of a number in the range of that name; SpecError where it is not."""
    return in_range(field, in_si(value, range_of(name).unit), name)


def in_si(value: Quantity, unit: str) -> float:
    """A quantity with its unit, or the SI number, as SI number."""
    return to_si(value, unit) if isinstance(value, str) else float(value)
