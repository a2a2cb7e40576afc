"""Scenes on sets that are not as they should be: pins out of place, a sun that floats, supports too soft or too stiff,
teeth without relief, the carrier held."""

from __future__ import annotations

import numpy as np

from evidence.stability.case import Case, Finding
from evidence.stability.checks import at_least, at_most, near
from evidence.stability.motion import Constant
from evidence.stability.set_bench import (
    MESHES,
    NOMINAL,
    RATIO,
    SPEED,
    TORQUE,
    Carried,
    SetVariant,
    carries,
    set_finding,
    set_run,
    shares,
    steady,
    sun_torque,
)
from gearfmu.spec.tables.ports import PortSpec

TURNING = Constant(SPEED)
DURATION, SETTLED = 0.022, 0.012  # s
FAR: tuple[tuple[int, tuple[float, float]], ...] = ((0, (0.0, 50e-6)), (1, (6e-6, 0.0)))
BEHIND: tuple[tuple[int, tuple[float, float]], ...] = ((0, (0.0, -35e-6)), (1, (6e-6, 0.0)))
STAR = SetVariant(ports=(PortSpec(kind="fixed"), PortSpec(kind="spring", k=20e3, c=1.0)), ring=TORQUE)
RING_TEETH_OVER_SUN = 3.0


def set_pin_error(case: Case) -> Finding:
    """One pin 50 µm ahead of its place, 600 N·m at 85 rad/s: its planet carries at least a third more than its share,
    the others less, and all together the torque to 2 %."""
    variant = SetVariant(pins=FAR)
    made = set_run(variant, case, Carried(TURNING, steady(NOMINAL)), DURATION)
    said, facts = carries(made, NOMINAL, SETTLED)
    if facts:
        facts |= _shares(shares(made, SETTLED))
        said += at_least("share of the planet on the pin", facts["share_1"], 1.33)
        said += at_most("share of the planet opposite", facts["share_3"], 0.95)
    return set_finding(variant, made, said, facts)


def set_floating_sun(case: Case) -> Finding:
    """The sun on 1e5 N/m, so that nothing centres it but the planets, with pins out of place, 600 N·m: it moves until
    opposite planets push alike, to 3 %, where a sun on its bearing leaves them 5 % and more apart."""
    variant = SetVariant(sun=1e5)
    made = set_run(variant, case, Carried(TURNING, steady(NOMINAL)), DURATION)
    said, facts = carries(made, NOMINAL, SETTLED)
    if facts:
        found = shares(made, SETTLED)
        facts |= _shares(found)
        for a in (0, 1):
            said += near(f"force on planet {a + 1} over that on planet {a + 3}", found[a] / found[a + 2], 1.0, 0.03)
        late = made.time > SETTLED
        facts["sun_off_um"] = 1e6 * float(np.hypot(*(made[f"sun.gear.{axis}"][late] for axis in "xy")).mean())
        said += at_least("way of the sun's axis (µm)", facts["sun_off_um"], 3.0)
    return set_finding(variant, made, said, facts)


def set_planet_without_contact(case: Case) -> Finding:
    """One pin 35 µm behind its place under 60 N·m: its planet stands between sun and ring with next to no force, and
    the others carry the torque to 2 %."""
    variant = SetVariant(pins=BEHIND)
    made = set_run(variant, case, Carried(TURNING, steady(60.0)), DURATION)
    said, facts = carries(made, 60.0, SETTLED)
    if facts:
        found = shares(made, SETTLED)
        facts |= _shares(found)
        said += at_most("share of the planet without contact", abs(facts["share_1"]), 0.02)
        for mesh in (MESHES["sun"][0], MESHES["ring"][0]):
            open_share = made.after(SETTLED).open_share(mesh)
            facts[f"open_{mesh}"] = open_share
            said += at_least(f"contact-loss share of {mesh}", open_share, 0.9)
    return set_finding(variant, made, said, facts)


def set_tip_contact(case: Case) -> Finding:
    """600 N·m without any relief: tips of sun and planets reach in early; the meshes carry the torque to 2 %."""
    return _carried(SetVariant(relief=False), case, NOMINAL)


def set_soft_pins(case: Case) -> Finding:
    """Pins of 1e7 N/m, which the planets push 0.3 mm aside under 600 N·m; the meshes carry the torque to 2 %."""
    return _carried(SetVariant(pin=1e7), case, NOMINAL)


def set_stiff_supports(case: Case) -> Finding:
    """Sun, pins and carrier on 1e10 N/m: what pins are out of place goes into forces alone; 600 N·m are carried
    to 2 %."""
    return _carried(SetVariant(sun=1e10, pin=1e10, carrier=1e10), case, NOMINAL)


def set_thin_ring(case: Case) -> Finding:
    """A ring with 3.4 mm of rim, oval at 0.4 kHz, under 600 N·m at 85 rad/s: it bends between the planets, and the
    meshes carry the torque to 2 %."""
    return _carried(SetVariant(thin=True), case, NOMINAL)


def set_star(case: Case) -> Finding:
    """The carrier held and the ring on a torque port: a gear with standing planets. The sun turns at 340 rad/s, the
    ring with 450 N·m against it; sun and ring keep 3 : 1, and the sun's meshes carry 150 N·m to 2 %."""
    speed, torque = RATIO * SPEED, NOMINAL / RATIO

    def inputs(time: float) -> dict[str, float]:
        return {"sun.phi": speed * time, "sun.w": speed, "ring.tau": RING_TEETH_OVER_SUN * torque}

    made = set_run(STAR, case, inputs, DURATION, {"ring.w_start": -speed / RING_TEETH_OVER_SUN})
    said, facts = [], {}
    if made.time[-1] > SETTLED:
        late = made.time > SETTLED
        facts["carried_Nm"] = abs(sun_torque(made, SETTLED))
        facts["ratio"] = float(made["sun.gear.w"][late].mean() / made["ring.w"][late].mean())
        said += near("torque on the sun that its meshes carry", facts["carried_Nm"], torque, 0.02)
        said += near("speed of the sun over that of the ring", facts["ratio"], -RING_TEETH_OVER_SUN, 0.01)
    return set_finding(STAR, made, said, facts)


def _carried(variant: SetVariant, case: Case, torque: float) -> Finding:
    made = set_run(variant, case, Carried(TURNING, steady(torque)), DURATION)
    said, facts = carries(made, torque, SETTLED)
    return set_finding(variant, made, said, facts)


def _shares(found: np.ndarray) -> dict[str, float]:
    return {f"share_{k + 1}": float(share) for k, share in enumerate(found)}
