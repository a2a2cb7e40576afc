"""Bearing forces and port torques against statics: T/r_b along the line of action, and no force left over on
average."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun

from gearfmu.body import Body
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, Steady, assemble, simulate
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import PortSpec

LOAD, SPEED = 302.0, 2000 * math.pi / 30  # N·m, rad/s of the pinion
FAST = 1
SHAFTS = ("pinion", "wheel")


@pytest.fixture(scope="module")
def held(spec: Stage, bodies: list[Body]) -> StageModel:
    """A given torque on the pinion, the wheel's bore held."""
    ports = {"pinion": PortSpec(kind="torque"), "wheel": PortSpec(kind="fixed")}
    return assemble(with_ports(spec, ports), bodies)


def at_rest(held: StageModel, torque: float) -> Kernel:
    """In equilibrium under the torque (N·m) on the pinion; only flanks carry, along the line of action."""
    return begun(held.kernel(level=FAST, **{"effect.tip_contact": 0.0}), {"pinion.tau": torque})


def bearing(kernel: Kernel, shaft: str, mean: bool = False) -> np.ndarray:
    """Force (2,) of the gear on its bearing, N."""
    return np.array([kernel.get(f"bearing.{shaft}.f{axis}{'_mean' * mean}") for axis in "xy"])


def push(pair: PairGeometry, drive: bool = True) -> np.ndarray:
    """Unit vector (2,) of the contact force on the pinion: away from the wheel by the sine, against the torque by the
    cosine of the working pressure angle. Bores that yield along the line of action do not turn it."""
    return np.array([-math.sin(pair.alpha_wt), math.cos(pair.alpha_wt) * (-1 if drive else 1)])


@pytest.mark.parametrize("torque", [LOAD, 30.0, -LOAD])
def test_at_rest_bearings_and_ports_hold_the_contact_force(
    held: StageModel, spec: Stage, pair: PairGeometry, torque: float
) -> None:
    """On drive and coast flanks."""
    kernel = at_rest(held, torque)
    force = torque / pair.gears[0].r_b
    on_pinion, on_wheel = (bearing(kernel, shaft) for shaft in SHAFTS)
    along = push(pair, drive=torque > 0)
    assert kernel.get("mesh.force") == pytest.approx(force, rel=1e-6)
    assert kernel.get("wheel.tau") == pytest.approx(-torque * 24 / 16, rel=1e-6)
    assert np.allclose(on_pinion, abs(force) * along, rtol=0, atol=5e-5 * abs(force))
    assert np.allclose(on_wheel, -on_pinion, rtol=0, atol=1e-5 * abs(force))
    for gear in spec.written.gears:
        place = np.array([kernel.get(f"{gear.name}.gear.{axis}") for axis in "xy"])
        assert np.allclose(place * gear.bearing.stiffness, bearing(kernel, gear.name), rtol=1e-6)
        assert np.allclose(bearing(kernel, gear.name, mean=True), bearing(kernel, gear.name), rtol=1e-12)


def test_on_average_nothing_is_left_of_contact_and_bearing_forces(relieved: StageModel, pair: PairGeometry) -> None:
    """Steady run over whole mesh periods: no gear gains momentum, so the means over the communication steps add up to
    zero; so do the values at their ends, a bit less."""
    step = 2 * math.pi / 16 / SPEED / 31
    trace = simulate(relieved, Steady(relieved, SPEED, LOAD), 1800 * step, step, {"level": FAST})
    settled = slice(1 + 1800 - 31 * 24, None)
    force = trace["mesh.force_mean"][settled].mean()
    assert force == pytest.approx(LOAD / pair.gears[0].r_b, rel=5e-3)
    wanted = force * push(pair)
    for shaft, sign in zip(SHAFTS, (1, -1), strict=True):
        for kind, share in (("_mean", 3e-3), ("", 6e-3)):
            found = [trace[f"bearing.{shaft}.f{axis}{kind}"][settled].mean() for axis in "xy"]
            assert np.allclose(found, sign * wanted, rtol=0, atol=share * force)
