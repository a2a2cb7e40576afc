"""A housing for tests, made of a few numbers: rigid, or with drawn modes."""

from __future__ import annotations

import numpy as np

from gearfmu.body.body import Body, How, Node, Sensors
from gearfmu.fem.coupling import rigid_fields
from gearfmu.reduction.cyclic.frf import FrfError
from gearfmu.reduction.full_order import COMPONENTS
from gearfmu.stagefile.forms.general import Stage

FEET = {
    "foot0": (-0.05, -0.09, 0.01),
    "foot1": (0.29, -0.09, 0.01),
    "foot2": (-0.05, -0.09, 0.12),
    "foot3": (0.29, -0.09, 0.12),
}
SENSORS = {"top": (0.12, 0.25, 0.064), "cover": (0.06, 0.16, 0.13)}


def points_of(stage: Stage) -> dict[str, np.ndarray]:
    """Where the seats of a housed stage are, by its supports, and the feet."""
    (housing,) = stage.housings
    found = {}
    for support in stage.supports:
        if support.to == housing.name:
            axis = stage.rotors[stage.rotor_of(support.body)].axis
            found[str(support.node)] = np.array([*axis, stage.place(support.body, support.at)])
    return found | {name: np.array(FEET[name]) for name in housing.made_of.feet}


def housing_of(stage: Stage, mass: float, modes: int = 0, seed: int = 1, sensors: bool = True) -> Body:
    """A housing of that mass, an even cube of 300 mm by its inertia, with its centre off the origin and drawn modes
    between 300 Hz and 6 kHz that give its interfaces some compliance."""
    rng, points = np.random.default_rng(seed), points_of(stage)
    frequency = np.sort(rng.uniform(300.0, 6000.0, modes))
    scale = np.tile([1, 1, 1, 8, 8, 8], len(points))[:, None] / np.sqrt(mass)
    rows = scale * rng.standard_normal((6 * len(points), modes))
    residual = 1e-10 * np.diag(np.tile([1, 1, 1, 60, 60, 60], len(points)))
    static = (rows / (2 * np.pi * frequency) ** 2) @ rows.T + (residual if modes else 0.0 * residual)
    felt = None
    if sensors:
        own = rng.standard_normal((3 * len(SENSORS), modes)) / np.sqrt(mass)
        at = np.array(list(SENSORS.values()))
        felt = Sensors(tuple(SENSORS), at, own, (own / (2 * np.pi * frequency) ** 2) @ rows.T)
    centre, fields, spin = np.array([0.1, 0.06, 0.07]), np.eye(6), mass * 0.3**2 / 6 * np.eye(3)
    fields[:3] = rigid_fields(centre)
    inertia = fields.T @ np.block([[mass * np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), spin]]) @ fields
    return Body(
        name=stage.housings[0].name,
        how=How("0" * 64, "drawn"),
        mass=inertia,
        nodes=tuple(Node(at, "rigid", COMPONENTS, p, (p[2] - 0.01, p[2] + 0.01)) for at, p in points.items()),
        frequency=frequency,
        damping_ratio=np.full(modes, 0.01),
        rows=rows,
        static=static,
        error=FrfError.of(np.array([50.0, 1e4]), np.zeros(2), (50.0, 1e4), 0.4, ()),
        sensors=felt,
    )
