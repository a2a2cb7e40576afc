"""Physics of the shipped pair: free rattle keeps its energy and its backlash, coast flanks and bearings that are
off, bad values refused. An effect that is off is not there: whatever its data say, not one bit of the run changes; on,
they matter. Other effects: test_effects.py."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gearfmu.body import Body
from gearfmu.errors import SimulationError
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, Steady, Trace, assemble, simulate
from gearfmu.stage.assembly.blob import GEAR_NUMBERS, read_blob, write_blob
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import PortSpec

PITCH = 2 * math.pi / 24  # rad, of the wheel
LOAD = 302.0
H = 60e-6
FAST = 1
SPEED = 15.0  # rad/s of the pinion before free rattle
UNDAMPED = {"effect.contact_damping": 0.0, "effect.modal_damping": 0.0}


def free(spec: Stage, bodies: list[Body], bearing_damping: float) -> StageModel:
    """Both shafts free, torque ports; bearings with the damping ratio given."""
    supports = tuple(support.model_copy(update={"damping_ratio": bearing_damping}) for support in spec.supports)
    free = with_ports(spec, dict.fromkeys(spec.ports, PortSpec(kind="torque")))
    return assemble(free.model_copy(update={"supports": supports}), bodies)


def rattle(
    model: StageModel, bodies: list[Body], duration: float = 0.03, speed: float = SPEED, **parameters: float
) -> Trace:
    """Gears thrown together, the pinion at `speed` in rad/s, so that they bounce between drive and coast flanks where
    they are: their momenta along the mesh cancel."""
    pinion, wheel = ((body.inertia[2, 2], body.flank.r_b) for body in bodies)
    start = {"pinion.w_start": speed, "wheel.w_start": speed * pinion[0] / pinion[1] * wheel[1] / wheel[0]}
    return simulate(model, lambda time: {}, duration, 30e-6, {"level": FAST, "h": 5e-6, **start, **parameters})


def compliance(model: StageModel, positions: float | np.ndarray, torque: float, **parameters: float) -> np.ndarray:
    """te over torque, m/(N·m), at positions in pitches."""
    kernel = statics_of(model, **parameters)
    return np.array([kernel.transmission(-p * PITCH, torque).te / torque for p in np.atleast_1d(positions)])


@pytest.mark.parametrize("level, h", [(0, 7.5e-6), (1, 5e-6), (1, 7.5e-6), (2, 5e-6)])
def test_free_rattle_keeps_its_energy_and_its_backlash(
    spec: Stage, bodies: list[Body], pair: PairGeometry, level: int, h: float
) -> None:
    """Some 80 impacts without damping, from three speeds: how often they meet in one run is chance. The energy goes up
    and down with the place on the flanks where the gears meet, by the same at every step size: rows depend on the roll,
    and the slope of elastic displacement along the flank does no work in the model. It does not run away."""
    model, impacts = free(spec, bodies, 0.0), []
    for speed in (14.0, SPEED, 16.0):
        trace = rattle(model, bodies, speed=speed, level=level, h=h, **UNDAMPED)
        stored, te = trace["energy.stored"][1:], trace["mesh.te"]
        drift = np.ptp(stored) / stored[0]
        impacts.append(trace["mesh.impacts"][-1])
        assert trace.meta["outcome"] == "completed" and trace["solver.retried_steps"][-1] == 0
        assert drift < 1.5e-3
        assert trace["mesh.force_drive"].max() > 100 and trace["mesh.force_coast"].max() > 100
        depth = 0.5 * (np.ptp(te) - pair.normal_backlash)
        assert 0 < depth < 30e-6  # compliance of mesh and bearings under the impacts, nothing more
    assert np.median(impacts) > 40


def test_coast_flank_off(spec: Stage, bodies: list[Body]) -> None:
    trace = rattle(free(spec, bodies, 0.03), bodies, **{"effect.coast_flank": 0.0})
    assert np.all(trace["mesh.force_coast"] == 0) and trace["mesh.te"].min() < -1e-3  # one impact, then apart for good


def test_energy_that_a_long_run_gathers_does_not_end_it(plain: StageModel) -> None:
    """Without tip corners pairs enter deflected and bring energy along, which dampers take: soon as much as is stored,
    a thousandth of what passes the shafts."""
    speed = 100.0
    off = {"level": FAST, "effect.tip_contact": 0.0}
    trace = simulate(plain, Steady(plain, speed, LOAD), 0.3, 50e-6, off)
    assert trace.meta["outcome"] == "completed"
    assert trace["energy.residual"][-1] > 0.6 * trace["energy.stored"][-1]
    assert trace["energy.residual"][-1] < 2e-3 * 2 * LOAD * speed * trace.time[-1]


def test_bearings_off(plain: StageModel) -> None:
    trace = simulate(plain, Steady(plain, 200.0, LOAD), 3e-3, H, {"level": FAST, "effect.bearings": 0.0})
    for shaft in ("pinion", "wheel"):
        assert np.all(trace[f"{shaft}.gear.x"] == 0) and np.all(trace[f"{shaft}.gear.y"] == 0)
        held = np.hypot(trace[f"bearing.{shaft}.fx_mean"], trace[f"bearing.{shaft}.fy_mean"])[1:].mean()
        assert held == pytest.approx(trace["mesh.force_mean"][1:].mean(), rel=0.05)
    assert compliance(plain, 0.2, LOAD, **{"effect.bearings": 0.0}) < 0.6 * compliance(plain, 0.2, LOAD)


def test_backlash_is_what_the_coast_flank_is_away(plain: StageModel, pair: PairGeometry) -> None:
    backlash = np.array([0.0, 5e-5, 1e-4, 2e-4])
    te = [statics_of(plain, backlash=j).transmission(0.0, -1e-3).te for j in backlash]
    assert np.allclose(te, -backlash * math.cos(pair.alpha_wt), rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("angle", [1.0, -1.0, 50.0, 1e3, 1e6, 1e7, -1e9])
def test_absurd_angles_have_a_named_outcome(plain: StageModel, angle: float) -> None:
    """A shaft end turned by this much within 60 µs: either the springs' answer to the rest beyond whole turns, or a
    named end with finite outputs; never garbage."""
    assert ended(plain, angle) == ended(plain, math.remainder(angle, 2 * math.pi))


def ended(plain: StageModel, angle: float) -> str:
    """How 20 steps end after the pinion's shaft end was turned by an angle (rad)."""
    kernel = plain.kernel(level=float(FAST))
    kernel.initialize()
    kernel.set("pinion.phi", angle)
    outcome = "ok"
    try:
        for step in range(20):
            kernel.step(step * H, H)
    except SimulationError as error:
        outcome = error.outcome
        assert error.time <= 20 * H
    assert outcome in {"ok", "penetration", "diverged", "energy"}
    assert all(math.isfinite(kernel.get(name)) for name in kernel.variables)
    return outcome


# ---- an effect that is off is not there ------------------------------------------------------------------------------
DURATION = 4e-3
GEARS = (0, 1)
ENGAGEMENT_NUMBERS = ("x_a", "y_a", "x_b", "y_b", "backlash", "nominal_backlash", "damping")  # the first ones
Sections = dict[str, np.ndarray]


def of_gears(name: str, factor: float) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        for g in GEARS:
            sections[f"gear{g}"][GEAR_NUMBERS.index(name)] *= factor

    return change


def of_pair(name: str, factor: float) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        sections["engagement"][ENGAGEMENT_NUMBERS.index(name)] *= factor

    return change


def of_sections(factor: float, *names: str) -> Callable[[Sections], None]:
    def change(sections: Sections) -> None:
        for name in names:
            sections[name][:] *= factor

    return change


def of_supports(sections: Sections) -> None:
    """What only a stage on its bearings has: the set that is not held."""
    for name in ("omega_ground0", "damper0", "kappa0", "support_compliance0"):
        sections[name][:] *= 0.3


DATA = {
    "effect.elastic": of_sections(1.2, "residual_own0", "residual_own1"),
    "effect.tip_relief": of_gears("relief", 2.0),
    "effect.tip_contact": of_gears("tip_edge", 1.001),  # more would leave a step between flank and edge
    "effect.contact_damping": of_pair("damping", 5.0),
    "effect.coast_flank": of_pair("backlash", 0.5),
    "effect.bearings": of_supports,
    "effect.modal_damping": of_sections(20, "zeta0", "zeta1", "zeta_ground0"),
}


def with_data(model: StageModel, change: Callable[[Sections], None]) -> StageModel:
    sections = {name: np.array(value) if isinstance(value, np.ndarray) else value
                for name, value in read_blob(model.blob).items()}  # fmt: skip
    change(sections)
    return replace(model, blob=write_blob(sections))


def swinging(time: float) -> dict[str, float]:
    """The pinion's shaft end turns and swings by ±10 mrad: the load reverses through the backlash."""
    phi = 210.0 * time + 0.01 * math.sin(2 * math.pi * 500 * time + 0.5)
    return {"pinion.phi": phi, "pinion.w": 210.0, "wheel.phi": -140.0 * time, "wheel.w": -140.0}


def bits(model: StageModel, effect: str, on: bool) -> bytes:
    trace = simulate(model, swinging, DURATION, H, {"level": 1, effect: float(on)})
    assert trace.meta["outcome"] == "completed" and np.abs(trace["mesh.force"]).max() > 2000
    return trace["mesh.te"].tobytes() + trace["mesh.force"].tobytes()


@pytest.mark.parametrize("effect", DATA)
def test_data_of_an_effect_count_when_it_is_on_and_only_then(relieved: StageModel, effect: str) -> None:
    if effect == "effect.tip_contact":  # relieved tips do not touch
        relieved = with_data(relieved, of_gears("relief", 0.0))
    other = with_data(relieved, DATA[effect])
    assert bits(relieved, effect, on=False) == bits(other, effect, on=False)
    assert bits(relieved, effect, on=True) != bits(other, effect, on=True)
