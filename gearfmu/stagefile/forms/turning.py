"""What turns with what: speeds through the meshes of a stage, and the two ports that it is driven and loaded by."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from gearfmu.errors import Problem, SpecError
from gearfmu.stagefile.forms.general import EngagementSpec, Stage
from gearfmu.stagefile.forms.shapes import toothed


@dataclass(frozen=True)
class Shafts:
    """The ports that a stage is driven and loaded by, and its ratio: speed of the input over speed of the output,
    negative where they turn against each other, as in a single external pair."""

    input: str
    output: str
    ratio: float


def shafts_of(stage: Stage) -> Shafts:
    """Input and output of a stage: its first and its second port. SpecError where it has fewer, or where no meshes lead
    from one to the other."""
    if len(stage.ports) < 2:
        remedy = "a stage needs an input and an output: write a second [ports.…]"
        raise SpecError.of(stage.source, "ports", ", ".join(stage.ports), remedy)
    first, second = list(stage.ports)[:2]
    driven, turning = stage.rotor_of(stage.ports[second].body), turns(stage, first)
    if driven not in turning or driven == stage.rotor_of(stage.ports[first].body):
        remedy = "no meshes lead from the first port to the second: put the two that drive and load the stage first"
        raise SpecError.of(stage.source, "ports", f"{first}, {second}", remedy)
    return Shafts(first, second, float(1 / turning[driven]))


def turns(stage: Stage, port: str) -> dict[str, Fraction]:
    """Speeds of the rotors that are geared to the rotor of `port`, itself among them, and of those that stand, by name:
    per its unit speed. Engagements roll in the axes of the rotor that carries them (Willis). Where a stage has
    carriers, ports beyond input and output stand."""
    known = {name: Fraction(0) for name, rotor in stage.rotors.items() if rotor.stands}
    if stage.carriers:
        known |= {stage.rotor_of(held.body): Fraction(0) for held in list(stage.ports.values())[2:]}
    known[stage.rotor_of(stage.ports[port].body)] = Fraction(1)
    equations = [({name: Fraction(1)}, speed) for name, speed in known.items()]
    return solved(equations + [(factors, Fraction(0)) for factors in rolling(stage)])


def rolling(stage: Stage) -> list[dict[str, Fraction]]:
    """What the meshes say of the rotors' speeds, and those that stand: sums of factors times speeds (by name) that are
    zero, one for each engagement and standing rotor."""
    standing = [{name: Fraction(1)} for name, rotor in stage.rotors.items() if rotor.stands]
    return [_rolling(stage, mesh) for mesh in stage.engagements] + standing


def _rolling(stage: Stage, mesh: EngagementSpec) -> dict[str, Fraction]:
    """Factors of the rotors' speeds in z_A (w_A − w_f) ± z_B (w_B − w_f) = 0."""
    z_a, z_b = (toothed(stage, gear).teeth for gear in mesh.gears)
    z_b *= -1 if stage.internal(mesh) else 1
    factors: dict[str, Fraction] = defaultdict(Fraction)
    for rotor, teeth in ((stage.rotor_of(mesh.gears[0]), z_a), (stage.rotor_of(mesh.gears[1]), z_b)):
        factors[rotor] += teeth
        if (frame := stage.frame_of(mesh)) is not None:
            factors[frame] -= teeth
    return factors


def solved(equations: list[tuple[dict[str, Fraction], Fraction]]) -> dict[str, Fraction]:
    """The unknowns that linear equations (factors by name, right side) decide; elimination without rounding. An
    equation that contradicts those before it is left out."""
    names = list(dict.fromkeys(name for factors, _ in equations for name in factors))
    found: list[tuple[int, list[Fraction]]] = []  # column of 1 that no other row has, row with its right side
    for factors, right in equations:
        row = [*(Fraction(factors.get(name, 0)) for name in names), right]
        for column, own in found:
            row = [a - row[column] * b for a, b in zip(row, own, strict=True)]
        pivot = next((k for k, factor in enumerate(row[:-1]) if factor), None)
        if pivot is not None:
            row = [value / row[pivot] for value in row]
            found = [(k, [a - own[pivot] * b for a, b in zip(own, row, strict=True)]) for k, own in found]
            found.append((pivot, row))
    return {names[k]: row[-1] for k, row in found if sum(map(bool, row[:-1])) == 1}


@dataclass(frozen=True)
class Meshing:
    """How often an engagement meets. rotor: of its gear A, carrier: that carries both gears (None: the ground), by
    name; teeth: of gear A. Mesh frequency: (ω_rotor − ω_carrier)·teeth/2π."""

    rotor: str
    carrier: str | None
    teeth: int

    def relative(self, speeds: Mapping[str, Any]) -> Any:
        """Speed of gear A in the axes that carry it, from speeds by rotor."""
        return speeds[self.rotor] if self.carrier is None else speeds[self.rotor] - speeds[self.carrier]

    @property
    def plain(self) -> list[Any]:
        """For a trace's meta: rotor, teeth, and the carrier where there is one."""
        return [self.rotor, self.teeth, *([] if self.carrier is None else [self.carrier])]

    @classmethod
    def of_plain(cls, known: Sequence[Any]) -> Meshing:
        """The inverse of `plain`."""
        rotor, teeth, *carrier = known
        return cls(str(rotor), str(carrier[0]) if carrier else None, int(teeth))


def meshings(stage: Stage) -> dict[str, Meshing]:
    """The `Meshing` of every engagement by name."""
    return {
        m.name: Meshing(stage.rotor_of(m.gears[0]), stage.frame_of(m), toothed(stage, m.gears[0]).teeth)
        for m in stage.engagements
    }


def undriven(stage: Stage, driven: Collection[str], remedy: str) -> list[Problem]:
    """Every spring port that is not among those `driven`; remedy: what to do about it, {name} stands for the port."""
    return [
        Problem(str(stage.source), f"ports.{name}.kind", '"spring"', remedy.format(name=name))
        for name, port in stage.ports.items()
        if name not in driven and port.kind == "spring"
    ]


def require_driven(stage: Stage, driven: Collection[str], by: str) -> None:
    """SpecError where a spring port beside those `driven` would have to be, which `by` ("a scene") does not do."""
    remedy = f"{by} drives {' and '.join(driven)} only: make this port one of kind torque or fixed"
    if problems := undriven(stage, driven, remedy):
        raise SpecError(problems)
