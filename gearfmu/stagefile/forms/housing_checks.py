"""Does a housing fit the stage that it carries? One housing, seats and feet that exist. Where seats lie is known from
its mesh (stage/assembly/housed.py); what hangs freely is refused by `Stage.require_motion`."""

from __future__ import annotations

from collections.abc import Iterator

from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.housing import HousingBody
from gearfmu.stagefile.tables.ports import SupportSpec

Found = Iterator[tuple[str, str, str]]


def housing_problems(stage: Stage) -> Found:
    """(field, value, remedy) of everything that is wrong with the housing of a stage."""
    for other in stage.housings[1:]:
        yield f"bodies.{other.name}.kind", "housing", f"{stage.housings[0].name} is one already: keep one housing"
    for housing in stage.housings[:1]:
        yield from _alone(stage, housing)
        for support in stage.supports:
            if housing.name in (support.body, support.to):
                yield from _support(stage, housing, support)


def _alone(stage: Stage, housing: HousingBody) -> Found:
    for name, rotor in stage.rotors.items():
        if housing.name in rotor.bodies:
            yield f"rotors.{name}.bodies.{housing.name}", housing.name, "a housing stands: name it in no rotor"
    for name, port in stage.ports.items():
        if port.body == housing.name:
            yield f"ports.{name}.body", housing.name, "a housing does not turn: name a shaft or a gear"


def _support(stage: Stage, housing: HousingBody, support: SupportSpec) -> Found:
    place, foot = f"supports.{support.name}", support.body == housing.name
    known, what = (housing.made_of.feet, "feet") if foot else (housing.made_of.seats, "seats")
    if foot and support.to is not None:
        yield f"{place}.to", support.to, f"a foot of {housing.name} stands on the ground: leave `to` away"
    if foot and support.bearing is not None:
        yield f"{place}.bearing", support.bearing, "a foot has springs: write radial, axial, tilt and torsion"
    if foot and support.at is not None:
        yield f"{place}.at", f"{support.at:g}", "its node set says where a foot lies: leave it away"
    if support.node not in known:
        remedy = f"no node of {housing.name}: its {what} are {', '.join(known) or f'not named in its {housing.table}'}"
        yield f"{place}.node", support.node or "missing", remedy
    spins = not foot and support.body in stage.bodies and not stage.rotors[stage.rotor_of(support.body)].stands
    if spins and support.torsion is not None:
        yield f"{place}.torsion", f"{support.torsion}", "a bearing on a housing cannot hold a spin: leave it away"
