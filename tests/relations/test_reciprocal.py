"""What is in equilibrium has a potential: the torque of one port answers the angle of the other as that one answers its
own. Gradients of gaps that are no derivatives break this; turning and mirroring do not see them where they are alike.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from inner import Inner
from kinds import KINDS, Kind, some

from gearfmu.stage import StageModel, Steady
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.bodies import Eccentricity, Wobble

STEP = 2e-6  # rad: of the angles of ports
RIGID = {"effect.elastic": 0.0, "effect.hertz": 0.0}
SAME = 1e-4  # of the stiffness; 2e-5 and less as it is, 5e-4 with rates of the other sign


def unsteady(stage: Stage, wobble: float = 0.0) -> Stage:
    """With toothings beside their axes, and tilted by `wobble` (rad)."""
    bodies = dict(stage.bodies)
    for i, gear in enumerate(stage.gears):
        update: dict[str, object] = {"eccentricity": Eccentricity(amount=2e-5, angle=0.5 + i)}
        if wobble:
            update["wobble"] = Wobble(amount=wobble, angle=0.7 - i)
        bodies[gear.name] = gear.model_copy(update=update)
    return stage.model_copy(update={"bodies": bodies})


def torques(kind: Kind, model: StageModel, angles: tuple[float, float]) -> np.ndarray:
    """(2,) N·m of input and output at rest, outer ends turned by `angles` (rad) from where they carry the load."""
    driven, kernel = model.driven_by_springs(), model.driven_by_springs().kernel(**RIGID)
    wound = Steady(driven, 0.0, kind.torque)(0.0)
    ports = driven.shafts.input, driven.shafts.output
    for port, angle in zip(ports, angles, strict=True):
        kernel.set(f"{port}.phi", wound[f"{port}.phi"] + angle)
    kernel.initialize(0.0)
    return np.array([kernel.get(f"{port}.tau") for port in ports])


@pytest.mark.parametrize("kind", some(["pair", "internal"]))
def test_each_port_answers_the_other_alike(kind: Kind) -> None:
    """Sees a toothing's runout whose rate over the angle has the wrong sign. Rigid spur teeth only: a compliance that
    depends on the position has a torque of its own, which is neglected (4e-4 of the stiffness), and so have slices that
    a tip edge cuts."""
    model = kind.model(unsteady)
    ends = [[torques(kind, model, tuple(s * STEP * np.eye(2)[k])) for s in (-1, 1)] for k in range(2)]
    stiffness = np.array([(high - low) / (2 * STEP) for low, high in ends])
    assert abs(stiffness[0, 1] - stiffness[1, 0]) < SAME * abs(stiffness).max()


def test_toothings_move_as_their_places_change(inner_library: Path) -> None:
    """The motion of a toothing that runs out is the derivative of its place. Sees: rates of eccentricity or wobble that
    are missing or of the wrong sign, which act on nodal contact and its dampers alone."""
    inner = Inner(inner_library, KINDS["helical"].model(partial(unsteady, wobble=3e-4)).blob)
    pose, motion, step = np.linspace(0.1, 1.2, 12), np.linspace(-3.0, 2.0, 12), 1e-6
    (before, _), (after, _) = (inner.runout(pose + side * step * motion, motion) for side in (-1, 1))
    _, moving = inner.runout(pose, motion)
    assert np.ptp(moving - motion) > 1e-4
    assert np.allclose(moving, (after - before) / (2 * step), rtol=0, atol=1e-9)


# ---- sliding by tilt -------------------------------------------------------------------------------------------------
X, Y, PHI, Z, RX, RY = range(6)
SLICES = 5
ROUNDING = 1e-14  # m; levers are some 1e-2 m


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.full) if n == "set" else n for n in KINDS])
def test_sliding_by_tilt_is_that_of_a_rigid_body(inner_library: Path, name: str) -> None:
    """u + ω × r: a point at the height z above mid-width moves by (z·ry, −z·rx) across the axis, whatever the kind of
    stage; so the rows of both tilts are known by hand from those of x and y. Red where friction's moment about a
    diameter has the wrong sign. Of the sets the helical one is quick."""
    stage = KINDS[name].stage
    inner = Inner(inner_library, KINDS[name].model().blob, {"level": 0.0, "slices": SLICES, "effect.friction": 1.0})
    for e, mesh in enumerate(stage.engagements):
        _, _, middle, *rows = inner.rows(e, np.zeros(12)).T
        slide = np.moveaxis(np.reshape(rows[12:], (2, 6, -1)), 1, 0)  # motion, gear, contact
        assert slide.shape[2] >= SLICES and np.allclose(np.hypot(slide[X], slide[Y]), 1.0, rtol=0, atol=1e-12)
        spatial = bool(slide[RX].any())
        assert spatial or "helical" not in name, "gears of a planar model do not tilt"
        up = spatial * middle
        by_hand = np.array([-up * slide[Y], up * slide[X]])
        assert np.abs(slide[[RX, RY]] - by_hand).max() < ROUNDING, mesh.name
        assert not slide[Z].any()
