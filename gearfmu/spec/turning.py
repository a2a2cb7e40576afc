"""What turns with what: speeds through the meshes of a stage, and the two ports that it is driven and loaded by."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.spec.general import GeneralStage, ToothedBody
from gearfmu.spec.ports import PortSpec


@dataclass(frozen=True)
class Shafts:
    """The ports that a stage is driven and loaded by, and its ratio: speed of the input over speed of the output,
    negative where they turn against each other, as in a single external pair."""

    input: str
    output: str
    ratio: float


def shafts_of(stage: GeneralStage) -> Shafts:
    """Input and output of a stage: its first and its second port. SpecError where it has fewer, or where no meshes lead
    from one to the other."""
    if len(stage.ports) < 2:
        raise _refused(stage, ", ".join(stage.ports), "a stage needs an input and an output: write a second [ports.…]")
    first, second = list(stage.ports)[:2]
    driven, turning = stage.rotor_of(stage.ports[second].body), turns(stage, first)
    if driven not in turning or driven == stage.rotor_of(stage.ports[first].body):
        remedy = "no meshes lead from the first port to the second: put the two that drive and load the stage first"
        raise _refused(stage, f"{first}, {second}", remedy)
    return Shafts(first, second, float(1 / turning[driven]))


def turns(stage: GeneralStage, port: str) -> dict[str, Fraction]:
    """Speeds of the rotors that are geared to the rotor of `port`, itself among them, by name: per its unit speed."""
    found = {stage.rotor_of(stage.ports[port].body): Fraction(1)}
    for _ in stage.engagements:
        for mesh in stage.engagements:
            for here, there in (mesh.gears, mesh.gears[::-1]):
                known, other = stage.rotor_of(here), stage.rotor_of(there)
                if known in found and other not in found:
                    sense = 1 if stage.internal(mesh) else -1
                    found[other] = sense * found[known] * Fraction(_teeth(stage, here), _teeth(stage, there))
    return found


def mesh_teeth(stage: GeneralStage) -> dict[str, tuple[str, int]]:
    """Of every engagement by name: the rotor of its gear A and that gear's teeth. The mesh frequency is their speed
    times their number."""
    return {m.name: (stage.rotor_of(m.gears[0]), _teeth(stage, m.gears[0])) for m in stage.engagements}


def with_ports(spec: Any, ports: dict[str, PortSpec]) -> Any:
    """The StageSpec or GeneralStage with other ports of the same names, at the places where they were."""
    own = {
        name: old.model_copy(update={field: getattr(ports[name], field) for field in PortSpec.model_fields})
        if name in ports
        else old
        for name, old in spec.ports.items()
    }
    return spec.model_copy(update={"ports": own})


def require_two_driven(stage: Any, shafts: Shafts, by: str) -> None:
    """SpecError where a spring port beside input and output would have to be driven, which `by` ("a scene") does not
    do."""
    for name, port in stage.ports.items():
        if name not in (shafts.input, shafts.output) and port.kind == "spring":
            remedy = f"{by} drives {shafts.input} and {shafts.output} only: make this port one of kind torque or fixed"
            raise SpecError([Problem(str(stage.source), f"ports.{name}.kind", '"spring"', remedy)])


def _teeth(stage: GeneralStage, gear: str) -> int:
    body = stage.bodies[gear]
    assert isinstance(body, ToothedBody)
    return body.teeth


def _refused(stage: GeneralStage, value: str, remedy: str) -> SpecError:
    return SpecError([Problem(str(stage.source), "ports", value, remedy)])
