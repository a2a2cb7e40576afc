"""Flanks that are no nominal involutes, by hand: rigid geometry says what the unloaded transmission error is, and the
loaded one lies as far from that of nominal flanks."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from by_hand import Pair
from scipy.interpolate import BarycentricInterpolator

from gearfmu.body import Body, load_bodies
from gearfmu.geometry import GearGeometry, PairGeometry
from gearfmu.geometry.relief import relief_at
from gearfmu.stage import StageModel, Steady, assemble, loaded_te, simulate
from gearfmu.stage.assembly.blob import read_blob
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage
from gearfmu.stagefile.tables.bodies import (
    Eccentricity,
    EndRelief,
    GearSpec,
    LeadSpec,
    ProfileSpec,
    RootRelief,
    TipRelief,
    Wobble,
)
from gearfmu.stagefile.tables.connections import Misalignment

NO_CORNERS = {"effect.tip_contact": 0.0}
PROFILES: dict[str, dict[str, Any]] = {
    "slope": {"profile": ProfileSpec(slope=10e-6)},
    "crowning": {"profile": ProfileSpec(crowning=8e-6)},
    "linear tip relief": {"tip_relief": TipRelief(amount=15e-6, kind="linear")},
    "arc of tip relief": {"tip_relief": TipRelief(amount=15e-6, kind="arc")},
    "linear root relief": {"root_relief": RootRelief(amount=12e-6, kind="linear")},
    "root relief": {"root_relief": RootRelief(amount=12e-6)},
}


def changed(spec: Stage, pinion: dict[str, Any], wheel: dict[str, Any] | None = None) -> Stage:
    """The stage with other fields of its gears; reliefs begin in the middle of single contact, said or not."""
    pair, gears = spec.written.geometry, []
    for i, update in enumerate((pinion, wheel or {})):
        middle = (pair.inner_single_contact(i) + pair.outer_single_contact(i)) / 2
        reliefs = {
            name: update[name].model_copy(update={"start_roll": middle})
            for name in ("tip_relief", "root_relief")
            if update.get(name) is not None and isinstance(update[name].start_roll, str)
        }
        gears.append(spec.written.gears[i].model_copy(update=update | reliefs))
    return rewritten(spec, gears=tuple(gears))


def depth_by_hand(gear: GearSpec, shape: GearGeometry, roll: float) -> float:
    """What the profile of a gear has lost at a roll (m), formulas of docs/theory.md, 2.2."""
    middle, half = (shape.s_form + shape.s_tip) / 2, (shape.s_tip - shape.s_form) / 2
    depth = 0.0
    if gear.profile is not None:
        x = (roll - middle) / half
        depth += gear.profile.crowning * x**2 - gear.profile.slope * x / 2
    for relief, end in ((gear.tip_relief, shape.s_a), (gear.root_relief, shape.s_form)):
        if relief is not None:
            depth += float(relief_at(roll, relief.amount, float(relief.start_roll), end, relief.kind))
    return depth


def gap_by_hand(spec: Stage, pair: PairGeometry, position: float) -> float:
    """The smallest depth of both gears together among the pairs that are on their flanks."""
    pairs = Pair(spec, ()).rolls(position).values()
    return min(
        sum(
            depth_by_hand(gear, shape, roll)
            for gear, shape, roll in zip(spec.written.gears, pair.gears, rolls, strict=True)
        )
        for rolls in pairs
    )


# ---- along the profile -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("gear", "name"),
    [(0, name) for name in PROFILES]
    + [pytest.param(1, name, marks=() if name in ("slope", "root relief") else pytest.mark.full) for name in PROFILES],
)
def test_unloaded_te_is_the_gap_of_the_modified_profile(
    name: str, gear: int, spec: Stage, bodies: list[Body], pair: PairGeometry
) -> None:
    """A linear relief's bend is rounded over one interval of the table: by an eighth of what it changes there."""
    update = PROFILES[name]
    modified = changed(spec, update if gear == 0 else {}, update if gear == 1 else {})
    found = loaded_te(assemble(modified, bodies), [0.0], 24, **NO_CORNERS)
    by_hand = np.array([gap_by_hand(modified, pair, p) for p in found.position])
    error = np.abs(found.te[0] - by_hand).max()
    assert np.ptp(by_hand) > 1e-6 and error < (40e-9 if "linear" in name else 12e-9)


@pytest.mark.parametrize(
    ("effect", "pinion"),
    [("flank_deviations", PROFILES["slope"]), ("runout", {"eccentricity": Eccentricity(amount=20e-6)})],
    ids=["flank_deviations", "runout"],
)
def test_without_the_effect_flanks_are_nominal_to_the_last_bit(
    effect: str, pinion: dict[str, Any], spec: Stage, bodies: list[Body], plain: StageModel
) -> None:
    model, off = assemble(changed(spec, pinion), bodies), {f"effect.{effect}": 0.0}
    assert np.array_equal(loaded_te(model, [302.0], 8, **off).te, loaded_te(plain, [302.0], 8).te)
    assert f"effect.{effect}" not in plain.kernel().variables


# ---- eccentricity ----------------------------------------------------------------------------------------------------
def revolution(model: StageModel, pitches: int, positions: int, torque: float, **parameters: float) -> np.ndarray:
    """te (m) at even positions over so many pitches."""
    kernel = statics_of(model, **parameters)
    pitch = 2 * math.pi / model.stage.gears[1].teeth
    return np.array([kernel.transmission(-pitch * i / positions, torque).te for i in range(pitches * positions)])


def orders(te: np.ndarray) -> np.ndarray:
    """Amplitudes (m) by cycles over the whole of te."""
    return 2 / te.size * np.abs(np.fft.rfft(te))


@pytest.mark.parametrize(("gear", "teeth"), [(0, 16), (1, 24)])
@pytest.mark.parametrize("torque", [0.1, 302.0])
def test_an_eccentric_gear_moves_te_by_its_eccentricity_once_a_turn(
    gear: int, teeth: int, torque: float, spec: Stage, bodies: list[Body]
) -> None:
    """The projection on the line of action is e sin(φ + …), all flanks of one side alike: amplitude e at the shaft
    order, loaded or not. What it turns the line of action by is of the order e²/a."""
    update = {"eccentricity": Eccentricity(amount=20e-6, angle=0.7)}
    model = assemble(changed(spec, *((update, {}) if gear == 0 else ({}, update))), bodies)
    found = orders(revolution(model, teeth, 4, torque))
    assert found[1] == pytest.approx(20e-6, rel=0.01) and found[2] < 0.05e-6


def test_the_phase_of_an_eccentricity_is_that_of_its_angle(spec: Stage, bodies: list[Body]) -> None:
    """Drive flanks of the pinion, line of action at t = −α_wt: n = (sin α, cos α); an axis at angle ψ from tooth 0 goes
    e (cos, sin)(φ + ψ), towards the wheel's flank by e sin(φ + ψ + α_wt): te falls by that."""
    psi, pair = 0.7, spec.written.geometry
    model = assemble(changed(spec, {"eccentricity": Eccentricity(amount=20e-6, angle=psi)}), bodies)
    te = revolution(model, 16, 4, 0.01)
    phi = 2 * math.pi * np.arange(te.size) / te.size
    expected = -20e-6 * np.sin(phi + psi + pair.alpha_wt)
    assert np.abs(te - te.mean() - expected).max() < 0.1e-6


def errors_at(model: StageModel, wheel: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """te (m) at angles (rad) of the wheel under torques (N·m), with axes held."""
    kernel = statics_of(model, **{"effect.bearings": 0.0})
    return np.array([kernel.transmission(*place).te for place in zip(wheel, torque, strict=True)])


def turn(spec: Stage, bodies: list[Body], positions: int, torque: float, e: float) -> tuple[np.ndarray, np.ndarray]:
    """te (m) over a turn of a pinion with eccentric teeth, by the eccentric pair and by true pairs. Where the pinion's
    teeth lie at C, the pair is the true one at the centre distance |C_B − C|, turned by that line's angle, with the
    torque about C. True pairs at five distances, and the polynomial between them."""
    psi, pair = 0.7, spec.written.geometry
    base, pitch = [gear.r_b for gear in pair.gears], 2 * math.pi / spec.written.gears[1].teeth
    wheel = -pitch * np.arange(spec.written.gears[0].teeth * positions) / positions
    eccentric = assemble(changed(spec, {"eccentricity": Eccentricity(amount=e, angle=psi)}), bodies)
    found = errors_at(eccentric, wheel, np.full(wheel.size, torque))
    offset = e * np.exp(1j * ((found - base[1] * wheel) / base[0] + psi))
    line = pair.a - offset
    turned, distance = np.angle(line), np.abs(line)
    normal = 1j * np.exp(1j * (turned - pair.alpha_wt))
    about = torque / (1 + (offset.conj() * normal).imag / base[0])
    nodes, curves = pair.a + e * np.cos(np.pi * (np.arange(5) + 0.5) / 5), []
    for a in nodes:
        other = rewritten(spec, pair=spec.written.pair.model_copy(update={"center_distance": a}))
        shift = pair.wheel_phase - other.written.geometry.wheel_phase
        curves.append(errors_at(assemble(other, bodies), wheel - turned + shift, about))
    true = np.diagonal(BarycentricInterpolator(nodes, np.array(curves))(distance))
    phases = np.array([replace(pair, a=a).wheel_phase for a in distance]) - pair.wheel_phase
    return found, true + base[0] * turned + base[1] * (turned + phases)


def test_side_bands_are_those_of_true_pairs_at_the_centre_distance_of_each_angle(bodies: list[Body]) -> None:
    """Of the shipped pair with relief, within 4 %, or 0.4 nm; the page's numbers to their digits. 16 positions a pitch
    would not do: mesh orders from 8 on are folded into the first ones."""
    spec = load_stage("fzg_c/stage_relief")
    found, true = map(orders, turn(spec, bodies, 64, 302.0, 20e-6))
    page = (Path(__file__).parents[2] / "docs" / "theory" / "02-line-contact.md").read_text(encoding="utf-8")
    said = re.search(r"side bands of (\d+) and (\d+) nm beside mesh order 1, (\d+) and (\d+) nm beside order 2", page)
    assert said is not None and found[16] == pytest.approx(true[16], rel=1e-3)
    for order, nm in zip((15, 17, 31, 33), said.groups(), strict=True):
        assert found[order] == pytest.approx(true[order], rel=0.04, abs=0.4e-9)
        assert round(1e9 * found[order]) == int(nm)


# ---- wobble ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("quarter", [0, 1])
def test_a_wobble_at_one_angle_is_a_misalignment(quarter: int, spec: Stage, bodies: list[Body]) -> None:
    """Wheel at rest at angle 0, its toothing leaning towards +x (from +z: the centre distance grows) or +y: the pair
    with that parallelism error, to the last digits."""
    tilt, span = 2e-4, 0.1
    phase = spec.written.geometry.wheel_phase
    wobble = Wobble(amount=tilt, angle=quarter * math.pi / 2 - phase)
    error = {"in_plane": tilt * span} if quarter == 0 else {"out_of_plane": tilt * span}
    misaligned = rewritten(
        spec, pair=spec.written.pair.model_copy(update={"misalignment": Misalignment(span=span, **error)})
    )
    turned = statics_of(assemble(changed(spec, {}, {"wobble": wobble}), bodies)).transmission(0.0, 302.0)
    at_rest = statics_of(assemble(misaligned, bodies)).transmission(0.0, 302.0)
    assert turned.te == pytest.approx(at_rest.te, rel=1e-9)
    slices, same = (np.array(list(state.forces.values())) for state in (turned, at_rest))
    assert np.allclose(slices, same, rtol=1e-4, atol=1e-3) and np.ptp(slices[0]) > 0.05 * slices[0].mean()


# ---- topography ------------------------------------------------------------------------------------------------------
def crowned(shape: GearGeometry, width: float, roll: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Profile crowning 6 µm, slope 4 µm, lead crowning 5 µm as material (R, W) m."""
    x = 2 * (roll - shape.s_form) / (shape.s_tip - shape.s_form) - 1
    return (2e-6 * x - 6e-6 * x**2)[:, None] - 5e-6 * (2 * z / width) ** 2


CLOSED_FORM = {"profile": ProfileSpec(slope=4e-6, crowning=6e-6), "lead": LeadSpec(crowning=5e-6)}


@pytest.fixture
def topography(tmp_path: Path, spec: Stage, pair: PairGeometry) -> dict[str, Any]:
    """A coarse CSV file of both flanks of the pinion, `crowned` on all teeth."""
    shape, width = pair.gears[0], spec.written.gears[0].face_width
    roll, z = np.linspace(shape.s_form, shape.s_tip, 7), np.linspace(-width / 2, width / 2, 5)
    rows = [
        f"{1e3 * r:.15g},{1e3 * y:.15g},{1e6 * d:.15g}"
        for r, line in zip(roll, crowned(shape, width, roll, z), strict=True)
        for y, d in zip(z, line, strict=True)
    ]
    path = tmp_path / "flanks.csv"
    path.write_text("\n".join(["# made for a test", "roll_mm,z_mm,deviation_um", *rows]), encoding="utf-8")
    return {"topography": str(path)}


def test_a_topography_is_the_same_flank_as_its_closed_form(
    topography: dict[str, Any], spec: Stage, bodies: list[Body], pair: PairGeometry
) -> None:
    """The flank is a parabola both ways: splines through its points are that parabola, so that table and transmission
    error are those of `profile` and `lead`. Across the width strips take means of straight lines between 33 places
    either way."""
    shape, gear = pair.gears[0], spec.written.gears[0]
    measured, designed = (assemble(changed(spec, update), bodies) for update in (topography, CLOSED_FORM))
    found, closed = read_blob(measured.blob), read_blob(designed.blob)
    teeth, places, rolls = found["flank_size0"]
    field = np.asarray(found["flank0"]).reshape(teeth, 2, places, rolls)
    by_formula = -crowned(
        shape,
        gear.face_width,
        np.linspace(shape.s_form, shape.s_tip, rolls),
        np.linspace(-gear.face_width / 2, gear.face_width / 2, places),
    )
    assert teeth == 1 and np.abs(field - by_formula.T).max() < 1e-15 and "lead0" in closed
    same = [loaded_te(model, [302.0], 8).te[0] for model in (measured, designed)]
    assert same[0] == pytest.approx(same[1], rel=1e-9)


def test_one_tooth_of_a_topography_is_met_once_a_turn(tmp_path: Path, spec: Stage, bodies: list[Body]) -> None:
    """Tooth 3 of the pinion stands 5 µm out on its left flanks: te falls by 5 µm while it is in mesh, as if it were out
    of its place, and nowhere else; right flanks are driven the other way round and stay."""
    rows = ["tooth,flank,roll_mm,z_mm,deviation_um"]
    rows += [f"{k},left,{r},0,{5 if k == 3 else 0}" for k in range(16) for r in (8, 20)]
    (tmp_path / "teeth.csv").write_text("\n".join(rows), encoding="utf-8")
    model = assemble(changed(spec, {"topography": str(tmp_path / "teeth.csv")}), bodies)
    te = revolution(model, 16, 8, 0.01)
    met = np.flatnonzero(te < -4.99e-6)
    assert 8 < met.size < 14 and np.all(np.diff(met) == 1) and te.min() > -5.01e-6
    assert te[(met.max() + 8) % 128 : met.min() - 8] == pytest.approx(0.0, abs=0.2e-6)
    other = revolution(model, 16, 2, -0.01)
    assert np.ptp(other) < 0.5e-6


# ---- helical gears, and both kinds of contact ------------------------------------------------------------------------
def test_profile_and_lead_of_helical_gears_are_read_at_the_local_roll() -> None:
    """Unloaded, te is the smallest gap of all slices at the rolls of their middles, along the transverse normal."""
    spec = load_stage("helical_demo")
    bodies, pair = load_bodies(spec), spec.written.geometry
    modified = changed(
        spec,
        {"tip_relief": None, "lead": None, "profile": ProfileSpec(crowning=20e-6)},
        {"tip_relief": None, "lead": None},
    )
    model = assemble(modified, bodies)
    te = loaded_te(model, [0.0], 6, **NO_CORNERS).te[0]
    slices, width = modified.slices, modified.gears[0].face_width
    shape, found = pair.gears[0], []
    for p in np.arange(6) / 6:
        gaps = []
        for k in range(slices):
            z = width * ((k + 0.5) / slices - 0.5)
            for tooth in range(-4, 5):
                at = 2 * math.pi * (p + tooth) / shape.z + shape.psi_b + pair.alpha_wt
                roll = shape.r_b * at + z * math.tan(shape.beta_b)
                if roll <= shape.s_tip and pair.length - roll <= pair.gears[1].s_tip:
                    x = 2 * (roll - shape.s_form) / (shape.s_tip - shape.s_form) - 1
                    gaps.append(20e-6 * x**2)
        found.append(min(gaps))
    assert te == pytest.approx(found, abs=0.3e-6)


def test_nodal_contact_sees_the_same_flanks(topography: dict[str, Any], spec: Stage, bodies: list[Body]) -> None:
    """Lead and profile crowning as said and as a topography: nodes of flanks run alike; and not as without."""
    runs = []
    for update in (topography, CLOSED_FORM, {}):
        model = assemble(changed(spec, update | {"eccentricity": Eccentricity(amount=5e-6)}), bodies)
        steady = Steady(model, 200.0, 302.0)
        runs.append(simulate(model, steady, 4e-4, 2e-5, {"contact": 2.0, "integrator": 2.0, "level": 0.0})["mesh.te"])
    assert runs[0] == pytest.approx(runs[1], abs=2e-9) and np.abs(runs[0] - runs[2]).max() > 0.5e-6


def test_end_relief_kinds(spec: Stage, bodies: list[Body]) -> None:
    """Depth of the lead's table at the ends and half way in."""
    for kind, halfway in (("linear", 0.5), ("parabolic", 0.25), ("arc", 0.25)):
        relief = EndRelief(amount=8e-6, length=spec.written.gears[0].face_width / 8, kind=kind)
        sections = read_blob(assemble(changed(spec, {"lead": LeadSpec(end_relief=relief)}), bodies).blob)
        depth = np.asarray(sections["lead0"]).reshape(2, 33)
        expected = np.array([[8e-6, halfway * 8e-6, 0, 0, 8e-6]] * 2)
        assert depth[:, [0, 2, 4, 16, 32]] == pytest.approx(expected, abs=1e-10)


def test_te_over_several_pitches_is_that_of_one_after_the_other(plain: StageModel) -> None:
    """Of a gear whose teeth are alike: columns of the pairs and harmonics of the mesh too."""
    one, two = (loaded_te(plain, [302.0], 8, pitches=n) for n in (1, 2))
    assert two.position[-1] == pytest.approx(15 / 8) and two.pitches == 2
    for name in ("te", "mesh_stiffness", "stage_stiffness", "shares"):
        single, double = getattr(one, name), getattr(two, name)
        assert double == pytest.approx(np.concatenate([single, single], axis=1), rel=1e-6, abs=1e-9)
    assert two.harmonics(3) == pytest.approx(one.harmonics(3), rel=1e-6)
