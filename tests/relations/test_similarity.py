"""Similarity: with all lengths × c, forces × c² and times × c a stage of the same material is the same stage.
Transmission error grows with c, forces with c², frequencies fall with 1/c; bodies are reduced anew.

A number of a stage is scaled by the dimension of its unit, which its range gives (`Quantity`), so that no field can be
forgotten. c is a power of 4, so that even c^(−3/2), by which mass-normalised rows are scaled, is exact in binary
numbers: what remains is rounding, and constants with a unit that nobody wrote down.

Where it does not hold: flanks under a half-width of 5 µm are rough rather than Hertzian (gk_law.c), a length of every
gear, and so is the reach of the squeeze film, 100 µm (gk_film.c); deviations drawn within a class follow formulas of
ISO 1328-1 in millimetres and micrometres; the coefficients of Benedict and Kelley and of ISO/TR 14179 have units; a
default step is one of a ladder in microseconds.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, get_args

import pint
import pytest
from kinds import KINDS, Drawn, Kind, assembled, channels, differences, drawn, every, some

from gearfmu.body import reduce_body
from gearfmu.stage import StageModel, Steady, simulate
from gearfmu.stage.run.te import loaded_te
from gearfmu.stagefile.forms.expand import expand
from gearfmu.stagefile.forms.general import ToothedBody
from gearfmu.stagefile.forms.planetary import CarrierMeshSpec, CarrierSpec
from gearfmu.stagefile.reading.base import Quantity, Spec
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import BodySpec, MeshSpec

C = 4.0
H = 10e-6  # s
STEPS = 10  # of communication
FAST = {"level": 1.0}
COARSEST = BodySpec(
    strip_half_width=4.5e-4,
    modes=12,
    roll_points=6,
    width_functions=2,
    mesh=MeshSpec(flank=2, thickness=1, root=2, rim=1, width=1),
)
EXPONENTS = {"[length]": 1, "[mass]": 3, "[time]": 1}  # of c: force = mass · length/time² is 2, density 0
UNITS = pint.UnitRegistry(cache_folder=None)


@cache
def exponent(unit: str) -> int:
    """Power of c by which numbers of this SI unit are scaled."""
    text = unit.replace(".", "*").replace("s2", "s^2").replace("m2", "m^2").replace("m3", "m^3")
    dimension = UNITS.parse_units(text).dimensionality if text else {}
    return int(sum(EXPONENTS[name] * power for name, power in dimension.items()))


def quantities(annotation: Any) -> list[Quantity]:
    """All that a type says of its numbers, however deep."""
    own = [item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, Quantity)]
    return own + [found for part in get_args(annotation) for found in quantities(part)]


def scaled(spec: Any, c: float) -> Any:
    """A spec with every number of it scaled."""
    update = {}
    for name, field in type(spec).model_fields.items():
        known = [q for q in field.metadata if isinstance(q, Quantity)] + quantities(field.annotation)
        powers = {exponent(q.unit) for q in known}
        update[name] = _scaled(getattr(spec, name), c, powers, f"{type(spec).__name__}.{name}")
    return spec.model_copy(update=update)


def _scaled(value: Any, c: float, powers: set[int], place: str) -> Any:
    if isinstance(value, Spec):
        return scaled(value, c)
    if isinstance(value, Mapping):
        return {key: _scaled(item, c, powers, place) for key, item in value.items()}
    if isinstance(value, tuple):
        return tuple(_scaled(item, c, powers, place) for item in value)
    if not isinstance(value, float):
        return value
    assert len(powers) == 1, f"{place}: a number without a quantity, or with two of them"
    return value * c ** next(iter(powers))


def file_of(name: str) -> Any:
    """The stage of a kind as its file is written, with coarse bodies."""
    kind = KINDS[name]
    return coarse(kind.stage if kind.file == "internal" else load_stage(kind.file).written)


def coarse(value: Any) -> Any:
    """A spec with bodies that take a fraction of a second to reduce."""
    if isinstance(value, BodySpec):
        return COARSEST.model_copy(update={"strip_half_width": value.strip_half_width})
    if isinstance(value, CarrierMeshSpec):
        return value.model_copy(update={"scale": 0.5})
    if isinstance(value, Spec):
        update = {name: coarse(getattr(value, name)) for name in type(value).model_fields}
        return value.model_copy(update=update | ({"modes": 30} if isinstance(value, CarrierSpec) else {}))
    if isinstance(value, Mapping):
        return {key: coarse(item) for key, item in value.items()}
    return tuple(map(coarse, value)) if isinstance(value, tuple) else value


@cache
def bodies_at(name: str, c: float) -> dict[str, Any]:
    """Bodies of a kind, scaled and reduced anew, by the names of its general form."""
    spec = expand(scaled(file_of(name), c))
    return spec.by_name([reduce_body(spec, body) for body in spec.files])


@cache
def model_at(kind: Kind, c: float) -> StageModel:
    """The scaled stage of a kind; of a drawn one with pitch errors instead of a class of tolerances."""
    name = kind.name.split("-")[0]
    if not isinstance(kind, Drawn):
        return assembled(expand(scaled(file_of(name), c)), bodies_at(name, c))
    errors = {"deviations": None, "index_deviation": {0: 4e-6, 1: -3e-6, 2: 6e-6}}
    teeth = {n: b.model_copy(update=errors) if isinstance(b, ToothedBody) else b for n, b in kind.stage.bodies.items()}
    return assembled(scaled(kind.stage.model_copy(update={"bodies": teeth}), c), bodies_at(name, c))


def load_at(kind: Kind, c: float) -> Kind:
    """The kind under its load, scaled."""
    span = STEPS * kind.step * c
    return replace(kind, torque=kind.torque * c**3, speed=kind.speed / c, step=kind.step * c, duration=span)


Parameters = Mapping[str, tuple[float, str]]  # number and unit, by name


def misfits(kind: Kind, parameters: Parameters) -> dict[str, float]:
    """Largest difference of every channel of a run between a stage and the scaled one, over the largest of its family;
    of work and losses over the largest energy that is stored."""
    found = []
    for c in (1.0, C):
        own, driven = load_at(kind, c), model_at(kind, c).driven_by_springs()
        settings = {name: x * c ** exponent(unit) for name, (x, unit) in parameters.items()}
        wound = Steady(driven, own.speed, own.torque)  # without friction: it is no part of the relation
        trace = simulate(driven, lambda time, wound=wound: wound(time), own.duration, own.step, FAST | settings)
        assert trace.meta["outcome"] == "completed"
        values = {name: v / c ** exponent(trace.channels[name].unit) for name, v in channels(trace).items()}
        assert values.pop("solver.h")[-1] == pytest.approx(H)
        found.append({_with_family(name): value for name, value in values.items()})
    return differences(*found)


def _with_family(name: str) -> str:
    """The three directions of forces, moments and displacements are one family, all energies are another."""
    place, _, last = name.rpartition(".")
    axis = re.fullmatch(r"([fmr]?)[xyz](_mean)?", last)
    if place == "energy":
        return f"{last}.joule"
    return f"{place}_{last}.{axis[1] or 'd'}{axis[2] or ''}" if axis else name


def holds(kind: Kind, parameters: Parameters, within: float) -> None:
    found = misfits(kind, {"h": (H, "s")} | dict(parameters))
    worst = max(found, key=found.__getitem__)
    print(f"{kind.name}: {worst} {found[worst]:.1e}")
    assert found[worst] < within, {name: value for name, value in found.items() if value >= within}


# ---- what is scaled --------------------------------------------------------------------------------------------------


def test_numbers_are_scaled_by_the_dimension_of_their_unit() -> None:
    """By hand: force c², stiffness c, torque c³, inertia c⁵, viscosity c, speed 1/c; moduli and densities stay."""
    by_hand = {"N": 2, "N/m": 1, "N.m": 3, "kg*m^2": 5, "Pa*s": 1, "rad/s": -1, "Hz": -1, "Pa": 0, "kg/m^3": 0, "J": 3}
    assert {unit: exponent(unit) for unit in by_hand} == by_hand
    stage = scaled(KINDS["pair"].stage, C)
    assert stage.bodies["pinion"].normal_module == C * KINDS["pair"].stage.bodies["pinion"].normal_module
    assert stage.bodies["pinion"].material == KINDS["pair"].stage.bodies["pinion"].material
    assert stage.supports[0].radial == C * KINDS["pair"].stage.supports[0].radial


# ---- bodies, statics, motion -----------------------------------------------------------------------------------------
DEAR = ("set", "helical_set")


@pytest.mark.parametrize("kind", some(["pair", "helical"], ["internal", "train", *DEAR]))
def test_frequencies_fall_with_the_size(kind: Kind) -> None:
    small, large = bodies_at(kind.name, 1.0), bodies_at(kind.name, C)
    for part, body in small.items():
        if body.exact is None:
            assert C * large[part].frequency == pytest.approx(body.frequency, rel=1e-7), part


@pytest.mark.parametrize("kind", some(["pair", "helical", "internal"], ["train", *DEAR]))
def test_transmission_error_grows_with_the_size(kind: Kind) -> None:
    """Stiffness per face width stays, to the roughness of light contacts."""
    small, large = (loaded_te(model_at(kind, c), [load_at(kind, c).torque], 3) for c in (1.0, C))
    assert large.te / C == pytest.approx(small.te, rel=1e-6)
    assert large.stage_stiffness / C == pytest.approx(small.stage_stiffness, rel=1e-3)


@pytest.mark.parametrize("kind", every(full=DEAR, seeds=()))
def test_a_scaled_stage_moves_alike(kind: Kind) -> None:
    """With straight contacts, which know no roughness. Within 1e-6, of the train within 1.1e-4: rows of one mode of its
    first pinion are exact to 7e-4; of the set within 3.3e-4: with such coarse bodies its step needs γ = .455, a bound
    that rounding moves by 1 %. Red where a damper of one direction acts on the force of another (seats 7e-3)."""
    holds(kind, {"effect.hertz": (0.0, "")}, 5e-4)


@pytest.mark.parametrize("kind", some(["pair", "helical", "internal"], DEAR))
def test_curved_contacts_scale_but_for_the_roughness_of_light_ones(kind: Kind) -> None:
    """Slices of a set that hardly carry differ by 5e-4 of the largest, axial forces on a spur ring by 3e-3."""
    holds(kind, {}, 5e-3)


@pytest.mark.parametrize("kind", some(["pair", "helical", "internal"]))
def test_friction_of_a_constant_coefficient_scales(kind: Kind) -> None:
    holds(kind, {"effect.friction": (1.0, "")}, 3e-4)


@pytest.mark.full
@pytest.mark.parametrize("seed", [seed for seed in range(20) if not drawn(seed).name.startswith("set")])
def test_a_drawn_stage_scales(seed: int) -> None:
    """Not spur sets, whose γ is lowered for one size alone: flanks closer than 50 µm count as closed in the limit of
    the step (gk_limit.c), and pin errors and runout reach that far in the larger one."""
    holds(drawn(seed), {}, 5e-3)
