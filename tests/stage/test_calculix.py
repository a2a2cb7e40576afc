"""Tooth pair and loaded transmission error against CalculiX, an independent finite-element code with its own contact.

The goldens come from static contact solutions of the whole gears with a fine mesh where the teeth touch (programs of
commit 4f20d638). The bores' mean displacement and rotation are held in both codes where they are compared. Helical
pairs: CalculiX's columns of evidence/peers/calculix/helical.csv, our side computed here.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evidence.peers.calculix import helical
from evidence.tables import read_rows
from gearfmu.body import Body, load_bodies
from gearfmu.femesh.sector import gear_sector
from gearfmu.geometry import PairGeometry
from gearfmu.reduction.cyclic.flank import tooth_flank
from gearfmu.reduction.cyclic.sector import SectorBody
from gearfmu.reduction.cyclic.statics import static_tables
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.forms.shapes import gear_geometry
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import GearSpec, SetGearSpec

REFERENCE = Path(__file__).resolve().parents[1] / "reference"
GOLDEN = json.loads((REFERENCE / "calculix_fzg_c.json").read_text(encoding="utf-8"))
TE = json.loads((REFERENCE / "calculix_te.json").read_text(encoding="utf-8"))
POSITIONS = 12  # of one pitch
SECANT = GOLDEN["pitch_point_secant_N_per_mm_um"]
HELD = {"effect.bearings": 0.0}  # axes
LINE_LOAD = 1e3 * GOLDEN["line_load_N_per_mm"]  # N/m


# ---- one tooth pair --------------------------------------------------------------------------------------------------
def theoretical_stiffness(spec: Stage) -> float:
    """c'th of ISO 6336-1 for solid spur gears, of teeth on half planes with a dedendum of 1.2 m (Weber and Banaschek),
    N/m²."""
    (z1, x1), (z2, x2) = ((gear.teeth, gear.profile_shift) for gear in spec.gears)
    flexibility = (
        0.04723
        + 0.15551 / z1
        + 0.25791 / z2
        - 0.00635 * x1
        - 0.11654 * x1 / z1
        - 0.00193 * x2
        - 0.24188 * x2 / z2
        + 0.00529 * x1**2
        + 0.00182 * x2**2
    )
    return 1e9 / flexibility


def rack_factor(spec: Stage) -> float:
    """C_B of ISO 6336-1 for a dedendum other than 1.2 m."""
    return 1 + 0.5 * (1.2 - np.mean([gear.rack.dedendum for gear in spec.gears]))


def disc_torsion(spec: Stage, pair: PairGeometry) -> float:
    """Twist of plane discs between bore and root circle as displacement along the line of action, m per N/m (exact,
    plane shear)."""
    total = 0.0
    for gear, shape in zip(spec.gears, pair.gears, strict=True):
        shear = gear.material.youngs_modulus / (2 * (1 + gear.material.poisson_ratio))
        total += shape.r_b**2 / (4 * math.pi * shear) * ((gear.bore_diameter / 2) ** -2 - shape.r_f**-2)
    return total


def test_pair_stiffness_at_the_pitch_point(plain: StageModel, spec: Stage, pair: PairGeometry) -> None:
    """One pair, 300 N/mm, neighbours off, bores averaged: the kernel on the reduced bodies against CalculiX, and
    against ISO 6336 with the discs' torsion in series; the bare c'th lies some 20 % higher."""
    kernel = plain.kernel(**{"level": 0.0, "effect.bearings": 0.0, "effect.tip_contact": 0.0})
    kernel.prepare()
    pinion, wheel = pair.gears
    turn = pair.path["C"] / pinion.r_b - pinion.psi_b - pair.alpha_wt  # of the pinion, to bring tooth 0 there
    state = kernel.transmission(-turn * pinion.r_b / wheel.r_b, LINE_LOAD * spec.gears[0].face_width * pinion.r_b)
    assert [tooth for tooth, forces in state.forces.items() if sum(forces) > 0] == [(0, 0)]
    secant = 1e-9 * LINE_LOAD / state.te
    assert theoretical_stiffness(spec) == pytest.approx(15.78e9, rel=1e-3) and rack_factor(spec) == 0.975
    iso = 1e-9 / (1 / (theoretical_stiffness(spec) * rack_factor(spec)) + disc_torsion(spec, pair))
    assert secant == pytest.approx(SECANT["half_width_averaged"], rel=0.015)
    assert secant == pytest.approx(iso, rel=0.10)


# ---- transmission error ----------------------------------------------------------------------------------------------
def beside(model: StageModel, table: str) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Our and CalculiX's transmission errors (µm) of every torque of a table at all positions of the pitch."""
    theirs = {float(torque): np.array(curve) for torque, curve in TE[table].items()}
    ours = loaded_te(model, list(theirs), POSITIONS, **HELD)
    yield from zip(1e6 * ours.te, theirs.values(), strict=True)


def test_transmission_error_over_one_pitch(plain: StageModel) -> None:
    """Mean and peak to peak within 3 % of CalculiX, tip contact included."""
    for here, theirs in beside(plain, "averaged"):
        assert here.mean() == pytest.approx(theirs.mean(), rel=0.03)
        assert np.ptp(here) == pytest.approx(np.ptp(theirs), rel=0.03)


@pytest.mark.full
def test_transmission_error_on_rigid_bores(spec: Stage) -> None:
    """Bores clamped node by node there, rigid here, all positions and loads: mean and peak to peak within 3 %, as for
    averaged bores, which are 4 % softer; in truth single positions stay within 1 %."""
    bodies = [with_rigid_bore(spec, index, body) for index, body in enumerate(load_bodies(spec))]
    for here, theirs in beside(assemble(spec, bodies), "clamped"):
        assert here.mean() == pytest.approx(theirs.mean(), rel=0.015)
        assert np.ptp(here) == pytest.approx(np.ptp(theirs), rel=0.01)
        assert np.allclose(here, theirs, rtol=0.015)


def with_rigid_bore(spec: Stage, index: int, stored: Body) -> Body:
    """A stored body with the static tables of a gear whose bore is rigid; its modes stay, of use at level rigid."""
    gear = spec.gears[index]
    geometry = gear_geometry(gear, spec.written.pair, (1, -1)[index])
    sector = gear_sector(geometry, gear.face_width, gear.body.mesh)
    body = SectorBody(sector, gear.material, *tooth_flank(geometry, gear), rigid_bore=True)
    tables = static_tables(body, [])
    flank = replace(stored.flank, static=tables.static_ff, node=tables.static_fb)
    return replace(stored, flank=flank, static=tables.static_bb)


def test_sun_and_planet_within_3_percent_at_two_loads() -> None:
    """The shipped bodies of `planetary54` as a pair: mean and peak to peak, and single positions but where a tooth pair
    begins or ends at a tip edge: 3.3 and 7.3 % there at the smaller load, where CalculiX hardly settles."""
    model = assemble(sun_planet(), load_bodies(load_stage("planetary54"))[:2])
    for light, (here, theirs) in zip((True, False), beside(model, "sun_planet"), strict=True):
        inside = [k for k in range(POSITIONS) if not light or k not in (5, 6)]
        assert np.allclose(here[inside], theirs[inside], rtol=0.03)
        assert here.mean() == pytest.approx(theirs.mean(), rel=0.03)
        assert np.ptp(here) == pytest.approx(np.ptp(theirs), rel=0.03)


def sun_planet() -> Stage:
    """Sun and first planet of `planetary54` on fixed axes, without tip relief."""
    of_set, pair = load_stage("planetary54").written, load_stage("fzg_c")
    form = pair.written
    gears = tuple(as_gear(*both) for both in zip(form.gears, (of_set.sun, of_set.planet), strict=True))
    return rewritten(
        pair, name="sun_planet", pair=form.pair.model_copy(update=shared(form.pair, of_set.set)), gears=gears
    )


def as_gear(form: GearSpec, gear: SetGearSpec) -> GearSpec:
    """A gear of a set as one of a pair."""
    return form.model_copy(update=shared(form, gear) | {"name": form.name, "tip_relief": None})


def shared(form: Any, other: Any) -> dict[str, Any]:
    """What another table says in fields of the same names."""
    return {name: getattr(other, name) for name in type(form).model_fields if hasattr(other, name)}


# ---- helical pairs ---------------------------------------------------------------------------------------------------
def error(case: helical.Case, bodies: list[Body], slices: int) -> float:
    """Of the kernel with bores held, m."""
    model = assemble(helical.stage(case.helix, case.axes), bodies)
    kernel = statics_of(model, **{"effect.bearings": 0.0, "slices": float(slices)})
    return kernel.transmission(-case.position / helical.POSITIONS * place_of(model, None).pitch, case.torque).te


@pytest.mark.full  # four reductions
@pytest.mark.parametrize("helix", [20, 30])
def test_te_within_2_5_percent_peak_to_peak_10_and_layer_loads_6(
    helix: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Axes parallel and tilted. Layer loads of the largest one, also where lines of contact end inside the width; peak
    to peak where all positions of a pitch are there, with five and seven slices within 15 %."""
    bodies = helical.bodies(tmp_path_factory.mktemp("helical"), helix)
    loads: dict[tuple[str, float], list[tuple[float, float]]] = {}
    for row in read_rows(helical.HERE / "helical.csv"):
        case = helical.case_of(row)
        if case.helix != helix:
            continue
        ours, theirs = helical.ours(case, bodies), helical.shares(row)
        te, off = float(row["te_um"]), np.abs(ours.share - theirs).max() / theirs.max()
        assert 1e6 * ours.te == pytest.approx(te, rel=0.025) and off < 0.06
        loads.setdefault((case.axes, case.torque), []).append((te, 1e6 * ours.te))
    assert {axes for axes, _ in loads} == {"parallel", "tilted"}
    whole: list[Any] = [np.ptp(curve, axis=0) for curve in loads.values() if len(curve) == helical.POSITIONS]
    assert whole and all(mine == pytest.approx(theirs, rel=0.1) for theirs, mine in whole)
    for axes, torque in (load for load, curve in loads.items() if len(curve) == helical.POSITIONS):
        cases = [helical.Case(helix, axes, torque, place) for place in range(helical.POSITIONS)]
        wanted = np.ptp([te for te, _ in loads[axes, torque]])
        for slices in (5, 7):
            mine = 1e6 * np.ptp([error(case, bodies, slices) for case in cases])
            assert mine == pytest.approx(wanted, rel=0.15)
