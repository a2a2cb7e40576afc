"""Line contact: gaps are zero where involutes touch, gradients are derivatives of the gaps, flanks go over into tip
corners without a jump, the local law is Hertz's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from inner import Inner, Place
from small_model import BASE, PSI, TEETH, TIP, WORKING, _coast_shift, pair_blob

from gearfmu.stage.assembly.blob import GEAR_NUMBERS, gear_numbers, read_blob, write_blob

REFERENCE = json.loads((Path(__file__).parent.parent / "reference" / "hertz_line.json").read_text())
DRIVE, COAST = 0, 1


@pytest.fixture(scope="module")
def relieved(inner_library: Path) -> Inner:
    return Inner(inner_library, pair_blob(), {"effect.tip_relief": 1})


@pytest.fixture(scope="module")
def plain(inner_library: Path) -> Inner:
    return Inner(inner_library, pair_blob(), {"effect.tip_relief": 0})


@pytest.fixture(scope="module")
def misplaced(inner_library: Path) -> Inner:
    """Every tooth of both gears out of its place by up to 1.4 mrad (50 µm), either flank by an amount of its own."""
    angles = np.random.default_rng(3).uniform(-1.4e-3, 1.4e-3, (2, sum(TEETH)))
    index = {"index0": angles[:, : TEETH[0]], "index1": angles[:, TEETH[0] :]}
    return Inner(inner_library, write_blob(read_blob(pair_blob()) | index), {"effect.tip_relief": 1})


def turned(phi: float, dx: float = 0.0, dy: float = 0.0, lead: float = 0.0) -> np.ndarray:
    """Pinion at φ, wheel following without load and ahead by `lead` (m along the line of action); pinion shifted."""
    return np.array([dx, dy, phi, 0.0, 0.0, -phi * BASE[0] / BASE[1] - lead / BASE[1]])


def one(places: list[Place], flank: int, tooth: int) -> Place | None:
    return next((p for p in places if (p.flank, p.tooth) == (flank, tooth)), None)


def test_unmodified_drive_flanks_touch_at_every_angle_and_the_coast_gap_is_the_backlash(plain: Inner):
    for phi in np.linspace(-40.0, 40.0, 41):
        places = plain.places(turned(phi))
        on_line = [p for p in places if p.flank == DRIVE and p.roll[0] < TIP[0] and p.roll[1] < TIP[1]]
        assert on_line and max(abs(p.gap) for p in on_line) < 1e-14
        coast = [p.gap for p in places if p.flank == COAST and p.roll[0] < TIP[0] and p.roll[1] < TIP[1]]
        nominal = (
            2 * np.pi * BASE[0] / TEETH[0]
            - 2 * BASE[0] * (PSI[0] - np.tan(WORKING) + WORKING)
            - 2 * BASE[1] * (PSI[1] - np.tan(WORKING) + WORKING)
        )
        assert coast and np.allclose(coast, nominal + 1e-4 * np.cos(WORKING), atol=1e-12)


def test_a_tooth_out_of_its_place_closes_its_own_gap_by_base_radius_times_angle(inner_library: Path, plain: Inner):
    """Pinion tooth 2 by 1 mrad, and wheel tooth −2 that meets it by −0.4 mrad: the drive gap of this pair shrinks by
    r_b1·1e-3 − r_b2·0.4e-3, the coast gaps of both teeth grow by as much, all others stay."""
    index = {f"index{g}": np.zeros((2, z)) for g, z in enumerate(TEETH)}
    index["index0"][:, 2], index["index1"][:, -2] = 1e-3, -4e-4
    changed = Inner(inner_library, write_blob(read_blob(pair_blob()) | index), {"effect.tip_relief": 0})
    phi, closer = -2 * 2 * np.pi / TEETH[0] + 0.02, (BASE[0] * 1e-3, -BASE[1] * 4e-4)
    seen = set()
    for place in changed.places(turned(phi), 2e-3):
        nominal = one(plain.places(turned(phi), 2e-3), place.flank, place.tooth)
        if nominal is None or max(r - t for p in (place, nominal) for r, t in zip(p.roll, TIP, strict=True)) > -1e-5:
            continue
        sg = 1 if place.flank == DRIVE else -1
        teeth = (place.tooth == 2, place.tooth == (2 if place.flank == DRIVE else 2 + _coast_shift()))
        expected = -sg * sum(c for c, moved in zip(closer, teeth, strict=True) if moved)
        assert place.gap - nominal.gap == pytest.approx(expected, abs=1e-12)
        seen.add((place.flank, *teeth))
    assert {(DRIVE, True, True), (DRIVE, False, False)} <= seen and any(flank == COAST and any(t) for flank, *t in seen)


@pytest.mark.parametrize("gears", ["relieved", "misplaced"])
@pytest.mark.parametrize("dx, dy, lead", [(0, 0, 0), (3e-5, -2e-5, 1e-5), (-1e-4, 5e-5, -2e-5)])
def test_gradients_are_derivatives_of_the_gaps(
    gears: str, dx: float, dy: float, lead: float, request: pytest.FixtureRequest
):
    relieved: Inner = request.getfixturevalue(gears)
    step, kinds = np.array([1e-7, 1e-7, 1e-6, 1e-7, 1e-7, 1e-6]), set()
    for phi in np.linspace(0, 2 * np.pi / TEETH[0], 57, endpoint=False):
        frame = turned(phi, dx, dy, lead)
        for place in relieved.places(frame):
            kinds.add((place.flank, place.roll[0] >= TIP[0], place.roll[1] >= TIP[1]))
            for c in range(6):
                ends = []
                for sign in (-1, 1):
                    moved = frame.copy()
                    moved[c] += sign * step[c]
                    ends.append(one(relieved.places(moved, 2e-3), place.flank, place.tooth))
                kind = {(e.roll[0] >= TIP[0], e.roll[1] >= TIP[1]) for e in ends if e}
                if None in ends or len(kind) > 1:
                    continue
                slope = (ends[1].gap - ends[0].gap) / (2 * step[c])
                assert slope == pytest.approx(place.gradient[c], abs=2e-6 * max(1.0, np.abs(place.gradient).max()))
    assert kinds >= {(f, a, b) for f in (DRIVE, COAST) for a, b in ((False, False), (True, False), (False, True))}


@pytest.mark.parametrize("gears", ["relieved", "misplaced"])
@pytest.mark.parametrize("tooth_end", [0, 1])
@pytest.mark.parametrize("flank", [DRIVE, COAST])
def test_gap_and_gradient_go_over_from_flank_to_tip_corner_without_a_jump(
    gears: str, flank: int, tooth_end: int, request: pytest.FixtureRequest
):
    relieved: Inner = request.getfixturevalue(gears)

    def seen(phi: float) -> list[Place]:
        return relieved.places(turned(phi, 2e-5, 1e-5), 2e-3)

    phi, corner = next(
        (phi, place)
        for phi in np.linspace(0, 2 * np.pi / TEETH[0], 200, endpoint=False)
        for place in seen(phi)
        if place.flank == flank and place.roll[tooth_end] >= TIP[tooth_end]
    )
    sign = (1 if tooth_end == 0 else -1) * (1 if flank == DRIVE else -1)  # turn back onto the flank
    low, high = 0.0, 0.2
    for _ in range(60):
        middle = 0.5 * (low + high)
        place = one(seen(phi - sign * middle), flank, corner.tooth)
        still = place is not None and place.roll[tooth_end] >= TIP[tooth_end]
        low, high = (middle, high) if still else (low, middle)
    before, after = (one(seen(phi - sign * (high + d)), flank, corner.tooth) for d in (1e-9, -1e-9))
    assert after is not None and before is not None
    assert before.gap == pytest.approx(after.gap, abs=1e-10)
    assert np.allclose(before.gradient, after.gradient, atol=1e-5)
    assert before.curvature == pytest.approx(after.curvature, rel=1e-3)


def test_local_law_is_continuous_with_its_slope_and_its_energy_is_the_integral(plain: Inner):
    force = np.concatenate([np.geomspace(1e-3, 2e5, 4001)])
    approach, slope, energy = np.array([plain.law(f, 150.0) for f in force]).T
    assert np.all(slope > 0) and np.all(np.diff(approach) > 0)
    middle = np.array([plain.law(f, 150.0)[1] for f in np.sqrt(force[1:] * force[:-1])])
    assert np.allclose(np.diff(approach) / np.diff(force), middle, rtol=2e-3, atol=0)
    work = np.diff(approach) * 0.5 * (force[1:] + force[:-1])
    assert np.allclose(np.diff(energy), work, rtol=3e-5, atol=0)
    assert plain.law(0.0, 150.0)[0] == 0.0 and plain.law(0.0, 150.0)[2] == 0.0


def test_local_law_with_a_deep_strip_is_the_line_contact_of_weber_and_banaschek(inner_library: Path):
    """Two cylinders: δ = Σ 2(1 − ν²)/(πEL)·F·[ln(4w/b) − 1], b from Hertz (numbers of
    tests/reference/hertz_line.json)."""
    case = REFERENCE
    sections = read_blob(pair_blob())
    for g in (0, 1):
        local = 2 * (1 - case["nu"] ** 2) / (np.pi * case["E"])
        own = dict(zip(GEAR_NUMBERS, sections[f"gear{g}"], strict=True))
        own |= {"local": local, "face_width": case["L"], "strip_half_width": 1e-3}
        sections[f"gear{g}"] = gear_numbers(own)
    inner = Inner(inner_library, write_blob(sections), {"slices": 1})
    curvature = 1 / case["R1"] + 1 / case["R2"]
    local = 2 * (1 - case["nu"] ** 2) / (np.pi * case["E"] * case["L"])
    expected = 2 * local * case["F"] * (np.log(4 * 1e-3 / case["b"]) - 1)
    assert inner.law(case["F"], curvature)[0] == pytest.approx(expected, rel=1e-12)
