"""Tooth pair and loaded transmission error against CalculiX, an independent finite-element code with its own contact.

The goldens come from static contact solutions of the whole gears with a fine mesh where the teeth touch
(evidence/peers/calculix). The bores' mean displacement and rotation are held in both codes where they are compared.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import sections

from evidence.peers.calculix import positions, rigid_bores, section, solid, sun_planet
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stagefile.forms.general import Stage

ROOT = Path(__file__).resolve().parents[2]
TABLES = ROOT / "evidence" / "peers" / "calculix"
GOLDEN = json.loads((ROOT / "tests" / "reference" / "calculix_fzg_c.json").read_text(encoding="utf-8"))
SECANT = GOLDEN["pitch_point_secant_N_per_mm_um"]
LINE_LOAD = 1e3 * GOLDEN["line_load_N_per_mm"]  # N/m


def test_pair_stiffness_at_the_pitch_point(plain: StageModel, pair: PairGeometry) -> None:
    """One pair, 300 N/mm, neighbours off, bores averaged: the kernel on the reduced bodies against CalculiX."""
    kernel = plain.kernel(**{"level": 0.0, "effect.bearings": 0.0, "effect.tip_contact": 0.0})
    kernel.prepare()
    pinion, wheel = pair.gears
    turn = pair.path["C"] / pinion.r_b - pinion.psi_b - pair.alpha_wt
    torque = LINE_LOAD * plain.stage.gears[0].face_width * pinion.r_b
    secant = 1e-9 * LINE_LOAD / kernel.transmission(-turn * pinion.r_b / wheel.r_b, torque).te
    print(f"kernel {secant:.3f}, CalculiX {SECANT['half_width_averaged']:.3f} N/(mm µm)")
    assert secant == pytest.approx(SECANT["half_width_averaged"], rel=0.015)


@pytest.mark.parametrize("torque", GOLDEN["te_um_by_torque_Nm_and_position"])
def test_transmission_error_over_one_pitch(plain: StageModel, torque: str) -> None:
    """Mean and peak to peak within 3 % of CalculiX, tip contact included."""
    golden = GOLDEN["te_um_by_torque_Nm_and_position"][torque]
    ours = 1e6 * loaded_te(plain, [float(torque)], GOLDEN["positions_per_pitch"], **{"effect.bearings": 0.0}).te[0]
    here = ours[[int(k) for k in golden]]
    theirs = np.array(list(golden.values()))
    print(
        f"{torque} N·m: mean {here.mean():.3f} / {theirs.mean():.3f} µm, peak to peak {np.ptp(here):.3f} / "
        f"{np.ptp(theirs):.3f} µm"
    )
    assert here.mean() == pytest.approx(theirs.mean(), rel=0.03)
    assert np.ptp(here) == pytest.approx(np.ptp(theirs), rel=0.03)


@pytest.mark.full
def test_transmission_error_on_rigid_bores(spec: Stage) -> None:
    """Bores clamped node by node there, rigid here, all positions and loads: mean and peak to peak within 3 %, as for
    averaged bores, which are 4 % softer; in truth single positions stay within 1 %."""
    bodies = rigid_bores.rigid_bore_bodies(spec)
    golden, count = GOLDEN["te_um_with_clamped_bores"], GOLDEN["positions_per_pitch"]
    result = loaded_te(assemble(spec, bodies), [float(t) for t in golden], count, **{"effect.bearings": 0.0})
    for curve, (torque, theirs) in zip(1e6 * result.te, golden.items(), strict=True):
        here, values = curve[[int(k) for k in theirs]], np.array(list(theirs.values()))
        print(f"{torque} N·m: {len(values)} positions, {100 * (here / values - 1).min():+.2f} … "
              f"{100 * (here / values - 1).max():+.2f} %")  # fmt: skip
        assert here.mean() == pytest.approx(values.mean(), rel=0.015)
        assert np.ptp(here) == pytest.approx(np.ptp(values), rel=0.01)
        assert np.allclose(here, values, rtol=0.015)


def test_sun_and_planet_within_3_percent_at_two_loads() -> None:
    """The shipped bodies of `planetary54` as a pair: mean and peak to peak, and single positions but where a tooth pair
    begins or ends at a tip edge: 3.3 and 7.3 % there at the smaller load, where CalculiX hardly settles."""
    ours, rows = positions.te_of_gearfmu(sun_planet.sun_planet(), "averaged"), positions.read(TABLES / "sun_planet.csv")
    for curve, torque in zip(1e6 * ours.te, ours.torque, strict=True):
        here = [row for row in rows if float(row["torque_Nm"]) == torque]
        theirs = np.array([float(row["te_um"]) for row in here])
        mine = curve[[round(positions.POSITIONS * float(row["position"])) for row in here]]
        print(f"{torque} N·m, {len(here)} positions: {100 * (mine / theirs - 1).min():+.2f} … "
              f"{100 * (mine / theirs - 1).max():+.2f} %")  # fmt: skip
        inside = [k for k in range(positions.POSITIONS) if torque > 40.0 or k not in (5, 6)]
        assert len(here) == positions.POSITIONS and np.allclose(mine[inside], theirs[inside], rtol=0.03)
        assert mine.mean() == pytest.approx(theirs.mean(), rel=0.03)
        assert np.ptp(mine) == pytest.approx(np.ptp(theirs), rel=0.03)


def test_goldens_are_those_of_the_tables() -> None:
    for table, name in (
        ("positions", "te_um_by_torque_Nm_and_position"),
        ("positions_clamped", "te_um_with_clamped_bores"),
    ):
        with open(TABLES / f"{table}.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == sum(len(curve) for curve in GOLDEN[name].values()) == 3 * GOLDEN["positions_per_pitch"]
        for row in rows:
            place = str(round(GOLDEN["positions_per_pitch"] * float(row["position"])))
            assert GOLDEN[name][row["torque_Nm"]][place] == float(row["te_um"])


def test_meshes_are_whole_and_bore_weights_are_areas(pair: PairGeometry) -> None:
    """Section with every tooth: its area is the gear's but for the tip chamfers, every inner edge has two elements;
    bore weights find the bore's middle."""
    gear, roll = pair.gears[0], pair.path["C"]
    plane = section.gear_plane(gear, {0: roll}, range(-8, 8), section.Fineness(toothed=8))
    corners = plane.nodes[plane.quads[:, [0, 4, 1, 5, 2, 6, 3, 7]]]
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
    assert area.min() > 0 and area.sum() == pytest.approx(gear.z * sections.section(gear)[0], rel=2e-3)
    edges = np.sort(np.stack([plane.quads[:, :4], np.roll(plane.quads[:, :4], -1, axis=1)], axis=-1), axis=-1)
    _, shared = np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)
    assert shared.max() == 2 and (shared == 1).sum() > len(plane.bore)
    body = solid.extruded(plane, np.array([0.0, 3e-3, 7e-3]))
    place = body.weights @ body.nodes[body.bore]
    assert body.weights.sum() == pytest.approx(1) and np.allclose(place, [0, 0, 3.5e-3], atol=1e-7)
    contact = plane.nodes[plane.patch[0]]
    assert np.abs(np.linalg.norm(contact, axis=-1) - np.hypot(gear.r_b, roll)).max() < 0.3e-3
