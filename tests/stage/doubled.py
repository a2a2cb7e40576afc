"""Two stages in one."""

from __future__ import annotations

from collections.abc import Callable

from gearfmu.stagefile.forms.general import Stage

Place = tuple[float, float]


def doubled(stage: Stage, named: Callable[[str], str], placed: Callable[[Place], Place]) -> Stage:
    """A stage on the ground and another like it, whose names `named` gives and whose axes (x, y), m, `placed`."""
    bodies = {named(n): body.model_copy(update={"name": named(n)}) for n, body in stage.bodies.items()}
    rotors = {
        named(n): rotor.model_copy(
            update={"axis": placed(rotor.axis), "bodies": {named(body): at for body, at in rotor.bodies.items()}}
        )
        for n, rotor in stage.rotors.items()
    }
    meshes = tuple(
        mesh.model_copy(update={"name": named(mesh.name), "gears": tuple(map(named, mesh.gears))})
        for mesh in stage.engagements
    )
    supports = tuple(s.model_copy(update={"name": named(s.name), "body": named(s.body)}) for s in stage.supports)
    ports = {named(n): port.model_copy(update={"body": named(port.body)}) for n, port in stage.ports.items()}
    return stage.model_copy(
        update={
            "bodies": stage.bodies | bodies,
            "rotors": stage.rotors | rotors,
            "engagements": stage.engagements + meshes,
            "supports": stage.supports + supports,
            "ports": stage.ports | ports,
        }
    )
