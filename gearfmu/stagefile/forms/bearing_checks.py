"""Do rolling bearings fit where a stage file uses them? Fields under the names that the file gives them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from gearfmu.stagefile.tables.bearings import BallBearing, Bearings, OperatingSpec, RollerBearing, RollingMount
from gearfmu.stagefile.tables.gear import GearSpec
from gearfmu.stagefile.tables.ports import SupportSpec

Found = Iterator[tuple[str, str, str]]
SPRINGS = ("radial", "axial", "tilt", "torsion")


@dataclass(frozen=True)
class Use:
    """A place where a stage uses a rolling bearing. place: its table; key: field with the bearing's name."""

    place: str
    key: str
    name: str
    part: SupportSpec | RollingMount


def uses_of_supports(supports: Iterable[SupportSpec]) -> list[Use]:
    """Supports with rolling bearings."""
    return [Use(f"supports.{s.name}", "bearing", s.bearing, s) for s in supports if s.bearing is not None]


def uses_of_gears(gears: Iterable[GearSpec]) -> list[Use]:
    """Gears of a pair on rolling bearings."""
    held = [(gear.name, gear.bearing) for gear in gears if isinstance(gear.bearing, RollingMount)]
    return [Use(f"gears.{name}.bearing", "rolling", mount.rolling, mount) for name, mount in held]


def use_problems(uses: Iterable[Use], bearings: Bearings, operating: OperatingSpec | None) -> Found:
    """(field, value, remedy) of everything that is wrong with the uses of rolling bearings."""
    uses = list(uses)
    if uses and operating is None:
        remedy = f'{uses[0].place} has a rolling bearing, which is linearised at a load: write torque = "100 N*m"'
        yield "operating.torque", "missing", remedy
    for use in uses:
        if use.name not in bearings:
            known = ", ".join(sorted(bearings)) or "none"
            yield f"{use.place}.{use.key}", use.name, f"no such bearing: write [bearings.{use.name}]; there are {known}"
        else:
            yield from _sides(use, bearings[use.name])
        yield from _springs(use)


def _sides(use: Use, bearing: BallBearing | RollerBearing) -> Found:
    """Bearings that carry one axial direction say which."""
    angled = bearing.contact_angle > 0
    sided = angled or bearing.preload > 0
    if sided and use.part.carries is None and use.part.span is None:
        why = "has a contact angle" if angled else "is preloaded"
        remedy = f'{use.name} {why}: say which axial force of the shaft it carries, carries = "+z" or "-z"'
        yield f"{use.place}.carries", "missing", remedy
    if not sided and use.part.carries is not None:
        remedy = f"{use.name} has no contact angle and no preload: leave it away"
        yield f"{use.place}.carries", use.part.carries, remedy


def _springs(use: Use) -> Found:
    """A rolling bearing stands in place of springs, between a shaft or gear and the ground."""
    if isinstance(use.part, RollingMount):
        return
    for field, value in use.part:
        if field in SPRINGS and value is not None:
            yield f"{use.place}.{field}", f"{value}", f"{use.name} has its own stiffness: leave it away"
    if use.part.to is not None:
        yield f"{use.place}.to", use.part.to, "a rolling bearing rests on the ground: leave it away"


def unused_problems(supports: Iterable[SupportSpec]) -> Found:
    """What is said of rolling bearings where there is none."""
    for support in supports:
        for field, value in support:
            if support.bearing is None and field in ("span", "carries") and value is not None:
                remedy = 'it is about a rolling bearing: name one, bearing = "…", or leave it away'
                yield f"supports.{support.name}.{field}", f"{value}", remedy
