"""Constants of laws, each pinned by a number calculated by hand from its source: no relation sees a wrong one, which
is wrong for every gear alike."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest
from inner import Inner

import gearfmu as gf
from gearfmu.stage import StageModel, Steady, simulate

BENEDICT_KELLEY, ISO_TR_14179 = 1.0, 2.0


@pytest.fixture(scope="module")
def spur() -> StageModel:
    return gf.assemble("fzg_c/stage_relief")


def coefficient(library: Path, law: float, viscosity: float, roughness: float, **at: float) -> float:
    """Of the kernel; SI. at: pitch_sum, rho, width, load, total, slides, rolls, turns."""
    names = ("pitch_sum", "rho", "width", "load", "total", "slides", "rolls", "turns")
    given = [law, viscosity, roughness, *(at.get(name, 1.0) for name in names)]
    probe = ctypes.CDLL(str(library)).probe_friction
    probe.restype = ctypes.c_double
    return float(probe((ctypes.c_double * len(given))(*given)))


# ---- friction --------------------------------------------------------------------------------------------------------


def imperial(load: float, viscosity: float, slides: float, rolls: float) -> float:
    """Benedict and Kelley, ASLE Trans. 4 (1961) 59, smooth flanks: µ = 0.0127 log₁₀[3.17e8 W/(µ₀ V_s V_t²)] with W in
    lb/in, µ₀ in cP, speeds in in/s."""
    inch, pound = 25.4e-3, 4.4482216152605
    return 0.0127 * math.log10(3.17e8 * load * inch / pound / (1e3 * viscosity * slides * rolls**2 / inch**3))


def test_the_coefficient_of_benedict_and_kelley(inner_library: Path) -> None:
    """100 N/mm, 40 mPa s, sliding 2 m/s, rolling 10 m/s in sum, Ra 0.4 µm: 0.0127·1.13/0.73·log₁₀(29660·100/8000)
    = 0.0196589·2.569081 = 0.050505; of smooth flanks that of the paper, whose units are inch and pound."""
    at = {"load": 1e5, "slides": 2.0, "rolls": 10.0}
    assert coefficient(inner_library, BENEDICT_KELLEY, 0.04, 0.4e-6, **at) == pytest.approx(0.050505, rel=1e-5)
    smooth = coefficient(inner_library, BENEDICT_KELLEY, 0.04, 0.0, **at)
    assert smooth == pytest.approx(imperial(1e5, 0.04, 2.0, 10.0), rel=1e-4)


def test_the_coefficient_of_iso_tr_14179(inner_library: Path) -> None:
    """ISO/TR 14179-2, 5.2: 0.048·[F_bt/b/(v_Σc ρ_redc)]^0.2·η^−0.05·Ra^0.25 with 100 N/mm, 10 m/s, 10 mm, 40 mPa s and
    0.4 µm: 0.048·1·0.831575·0.795271 = 0.031744; 32 times the load per speed and radius doubles it."""
    at = {"pitch_sum": 0.1, "turns": -100.0, "rho": 0.01, "width": 0.02, "total": 2000.0}
    assert coefficient(inner_library, ISO_TR_14179, 0.04, 0.4e-6, **at) == pytest.approx(0.031744, rel=1e-4)
    doubled = coefficient(inner_library, ISO_TR_14179, 0.04, 0.4e-6, **at | {"total": 64e3})
    assert doubled == pytest.approx(2 * 0.031744, rel=1e-4)


def test_a_run_takes_the_speeds_and_the_load_of_its_contact(spur: StageModel) -> None:
    """The law of Benedict and Kelley where one pair of rigid teeth carries: sliding |s_A − C| (1 + r_A/r_B) ω, rolling
    (s_A + s_B r_A/r_B) ω, load F/b. Median: where a pair comes or goes the load is that of the step before."""
    speed, viscosity = 100.0, 0.04
    law = {"friction_law": BENEDICT_KELLEY, "oil_viscosity": viscosity, "flank_roughness": 1e-9}
    rigid = {"effect.elastic": 0.0, "level": 0.0, "effect.friction": 1.0, "slices": 1.0}
    trace = simulate(spur, Steady(spur, speed, 100.0), 6e-3, 1e-5, rigid | law)
    pair = spur.stage.written.geometry
    (a, b), pitch = pair.gears, 2 * math.pi / pair.gears[0].z
    ratio, width = a.r_b / b.r_b, min(gear.face_width for gear in spur.stage.gears)
    roll = a.r_b * (a.psi_b + pair.alpha_wt + trace["pinion.gear.phi"])
    roll = pair.path["B"] + np.mod(roll - pair.path["B"], a.r_b * pitch)
    slides, rolls = np.abs(roll - pair.path["C"]) * (1 + ratio) * speed, (roll + (pair.length - roll) * ratio) * speed
    chosen = (trace["mesh.pairs"] == 1) & (slides > 0.3) & (trace.time > 2e-3)
    assert chosen.sum() > 50
    expected = [
        imperial(f / width, viscosity, v, r)
        for f, v, r in zip(trace["mesh.force"][chosen], slides[chosen], rolls[chosen], strict=True)
    ]
    assert np.median(trace["mesh.friction_ratio"][chosen] / expected) == pytest.approx(1.0, abs=2e-3)


# ---- contact ---------------------------------------------------------------------------------------------------------


def test_helical_flanks_are_curved_in_their_normal_section(inner_library: Path) -> None:
    """1/ρ = (1/s_A + 1/s_B) cos β_b with rolls of the transverse section (ISO 21771, 1/ρ_n = cos β_b/ρ_t); β = 20° and
    α_n = 20°: sin β_b = sin β cos α_n = 0.321394, cos β_b = 0.946946. Red where the cosine is missing."""
    helical = gf.assemble("helical_demo")
    inner = Inner(inner_library, helical.blob, {"slices": 1.0})
    places = [p for p in inner.places(np.zeros(6)) if p.flank == 0]
    tips = [gear.s_tip for gear in helical.stage.written.geometry.gears]
    inside = [p for p in places if all(0 < roll < tip - 1e-4 for roll, tip in zip(p.roll, tips, strict=True))]
    assert inside
    for place in inside:
        assert place.curvature == pytest.approx(0.946946 * sum(1 / roll for roll in place.roll), rel=1e-6)
