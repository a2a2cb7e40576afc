"""The verb effects: the table of effects (stage/effects.py), with a stage its own numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from gearfmu.commands.shared import stage_names

if TYPE_CHECKING:
    from gearfmu.stage import StageModel
    from gearfmu.stage.effects import Cost
    from gearfmu.stagefile.forms.general import EngagementSpec, Stage, ToothedBody

FIELDS = ("formula", "matters", "off", "switch", "code")


@click.command()
@click.argument("stage", required=False, shell_complete=stage_names)
def effects(stage: str | None) -> None:
    """The effects there are: formula, when each matters, its price, how to switch it; with STAGE its numbers."""
    from gearfmu.stage.effects import EFFECTS, NEGLECTED, costs

    found, numbers = costs(), _numbers(stage) if stage else {}
    for effect in EFFECTS:
        click.echo(f"{effect.name}: {effect.title}")
        lines = {"in the stage": numbers[effect.name]} if stage else {}
        lines |= {field: getattr(effect, field).replace("`", "") for field in FIELDS}
        lines |= {"theory": effect.equation, "cost": _cost(found.get(effect.name))}
        for name, text in lines.items():
            click.echo(f"  {name:<12}  {text}")
    click.echo("left out:")
    for term in NEGLECTED:
        click.echo(f"  {term.name}: {term.formula}; {term.why}")
    for line in _left_out(stage) if stage else ():
        click.echo(f"  in the stage  {line}")


def _cost(cost: Cost | None) -> str:
    if cost is None:
        return "not measured"
    price = "" if math.isnan(cost.without) else f"; off, {cost.price_of_off:+.1%} against a kernel without it"
    return f"{cost.share:.1%} of a step of {cost.on:.0f} instructions{price}"


def _numbers(stage: str) -> dict[str, str]:
    """Data of a stage for each effect, by its name: of every mesh, gear or bearing in the order of the file; of a
    planetary set its meshes with one planet."""
    from gearfmu.commands.models import model_of
    from gearfmu.stage.assembly.teeth import FlankField
    from gearfmu.stage.effects import torque_on_flanks_alone
    from gearfmu.stagefile.forms.shapes import face_width, gear_shape, mesh_shape

    model = model_of(stage)
    spec = model.stage
    meshes, gears, turning = spec.engagements, spec.gears, "no carrier: it costs nothing"
    if spec.carriers:
        meshes = meshes[:: len(meshes) // 2]
        turning = f"up to {model.stage.limits[1][0]:g} rad/s of the carrier"
    modes = model.modes_of_levels()
    widths = [face_width(spec, mesh) for mesh in meshes]
    alone = [torque_on_flanks_alone(model, mesh.name) for mesh in meshes]
    reliefs = [1e6 * gear.tip_relief.amount if gear.tip_relief else 0.0 for gear in gears]
    fields = [FlankField(gear, gear_shape(gear)) for gear in gears]
    misplaced = [1e6 * float(abs(field.index()).max()) for field in fields]
    deviating = [1e6 * field.span for field in fields]
    return {
        "elastic": f"{modes['full']} stored modes",
        "modes": ", ".join(f"{name} {count}" for name, count in modes.items()),
        "residual": "of all modes that are not dynamic",
        "hertz": f"local law up to {_listed(f'{mesh.torque_max:g} N·m' for mesh in meshes)}",
        "slices": f"{spec.slices} over {_listed(f'{1e3 * width:g} mm' for width in widths)}",
        "coast_flank": _listed(f"{1e6 * mesh_shape(spec, mesh).normal_backlash:.1f} µm" for mesh in meshes)
        + " of backlash along the normal",
        "contact_damping": _listed(f"{mesh.damping:g} N·s/m" for mesh in meshes) + " per metre of face width",
        "tip_relief": _listed(f"{amount:g} µm" for amount in reliefs) + _idle(not any(reliefs)),
        "tip_contact": _listed(f"{1e3 * g.tip_edge_radius:g} mm" for g in gears)
        + f" edge radius; flanks carry alone up to {_listed(f'{torque:.3g} N·m' for torque in alone)}",
        "bearings": _listed(s.bearing or _stiffness(s.radial) for s in spec.on_rigid_ground().supports if s.to is None),
        "housing": ", ".join(f"{len(h.made_of.seats)} seats, oscillators to {h.dynamic_to:g} Hz" for h in spec.housings)
        or "none: it costs nothing",
        "modal_damping": _listed(f"{g.modal_damping:g}" for g in gears) + " of critical",
        "roll_motion": "on",
        "pitch_errors": "up to " + _listed(f"{a:g} µm" for a in misplaced) + _idle(not any(misplaced)),
        "coriolis": turning,
        "centrifugal": turning,
        "gyroscopic": _whirling(model),
        "flank_deviations": _listed(f"{size:.3g} µm" for size in deviating) + _idle(not any(deviating)),
        "friction": _listed(map(_friction, meshes)),
        "film": _listed(_film(spec, mesh) for mesh in meshes),
        "runout": _listed(map(_runout, gears)) + _idle(not any(g.eccentricity or g.wobble for g in gears)),
    }


def _runout(gear: ToothedBody) -> str:
    """Eccentricity and wobble of a gear."""
    eccentricity, wobble = (part.amount if part else 0.0 for part in (gear.eccentricity, gear.wobble))
    return f"{1e6 * eccentricity:g} µm with {1e6 * wobble:g} µrad"


def _friction(mesh: EngagementSpec) -> str:
    """Law of a mesh."""
    if mesh.friction is None:
        return "none is stated: it costs nothing"
    constant = mesh.friction.law == "constant"
    return f"coefficient {mesh.friction.coefficient:g}" if constant else f"law {mesh.friction.law}"


def _film(stage: Stage, mesh: EngagementSpec) -> str:
    """Momentum that the film of a mesh takes, spur teeth at the pitch point."""
    if mesh.film is None:
        return "none is stated: it costs nothing"
    from gearfmu.stage.assembly.meshes import REACH, film_stop

    return f"takes {1e3 * film_stop(stage, mesh):.3g} mN·s of an approach from {1e6 * REACH:g} µm at the pitch point"


def _whirling(model: StageModel) -> str:
    """Influence of rotation on the frequencies of gears on their bearings, and of elastic patterns, at speed_max."""
    from gearfmu.body import load_bodies
    from gearfmu.stage.run.inertia import WHIRL_BAND, whirling

    shift, coupled, silent = whirling(model.stage, load_bodies(model.stage))
    missing = f"; not known of elastic patterns of {_listed(silent)}: `gearfmu reduce STAGE --force`" if silent else ""
    return (
        f"at speed_max frequencies of bodies on their bearings below {WHIRL_BAND / 1e3:g} kHz move by up to "
        f"{shift:.2%}, the two patterns of a pair of modes are coupled by up to {coupled:.2%}{missing}"
    )


def _left_out(stage: str) -> Iterable[str]:
    """Sizes of neglected terms, a line for every gear whose file has them."""
    from gearfmu.commands.models import bodies_of
    from gearfmu.stage.assembly.observed import gear_bodies
    from gearfmu.stage.run.inertia import inertia_terms

    spec, bodies = bodies_of(stage)
    for gear in inertia_terms(spec, gear_bodies(spec, bodies)):
        yield (
            f"{gear.name} at {gear.speed:.0f} rad/s: stiffening {gear.stiffening:.1e} (Coriolis forces of the same "
            f"modes {gear.whirl:.1e}), stretch {1e6 * gear.growth:.2f} µm (the tooth yields "
            f"{1e6 * gear.deflection:.2f} µm), inertia {gear.by_load:.1e} by load, {gear.by_speed:.1e} by speed"
        )


def _listed(texts: Iterable[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last


def _stiffness(radial: float | str | None) -> str:
    return f"{radial:g} N/m" if isinstance(radial, float) else radial or "free"


def _idle(idle: bool) -> str:
    return ": none, it costs nothing" if idle else ""
