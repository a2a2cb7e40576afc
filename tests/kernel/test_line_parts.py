"""Parts of a line of contact (docs/theory.md, 2.6): their law against places on a foundation that close one by one, how
they cover the line, and how their forces are shared out over the width."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from golden_stages import RIGID, Record, golden_model, stages
from golden_stages import _run as run
from inner import Inner
from scipy.integrate import quad

from gearfmu.stage.assembly.blob import read_blob

PLACES = 4


@pytest.fixture(scope="module")
def helical(inner_library: Path) -> Inner:
    return Inner(inner_library, golden_model("helical_pair"), {"slices": 5.0})


def approach(gaps: np.ndarray, load: float, yields: float) -> float:
    """Of places with these gaps (m) on a foundation of 1/yields per length: Σ (a − gap)₊ = PLACES·yields·load."""
    for closed in range(1, PLACES + 1):
        a = (PLACES * yields * load + gaps[:closed].sum()) / closed
        if closed == PLACES or a <= gaps[closed]:
            break
    return float(a)


@pytest.mark.parametrize("seed", range(4))
def test_a_part_approaches_as_its_places_on_a_foundation(helical: Inner, seed: int) -> None:
    """Beside the local law, and less what all places together would yield: exact but for rounding."""
    dice = np.random.default_rng(seed)
    gaps = np.sort(np.r_[0.0, dice.uniform(0, 8e-6, PLACES - 1)])
    for load in 10 ** dice.uniform(3, 6, 20):
        total, _, _, yields = helical.part(gaps[1:], load)
        local = helical.part(np.zeros(3), load)[0]
        assert total - local == pytest.approx(approach(gaps, load, yields) - yields * load, abs=1e-15)


def test_energy_is_the_work_of_the_approach_and_slopes_are_positive_and_fall(helical: Inner) -> None:
    """∫ f dδ by quadrature between the loads at which places close, 1e-7; δ is continuous there."""
    opens = np.array([1e-6, 2.5e-6, 6e-6])
    yields = helical.part(opens, 1.0)[3]
    before = np.r_[0.0, opens]
    closes = [(j * opens[j - 1] - before[:j].sum()) / (PLACES * yields) for j in range(1, PLACES)]
    for low, high in zip([1e3, *closes], [*closes, 2 * closes[-1]], strict=True):
        work = quad(lambda f: f * helical.part(opens, f)[1], low, high, epsrel=1e-10, limit=200)[0]
        assert helical.part(opens, high)[2] - helical.part(opens, low)[2] == pytest.approx(work, rel=1e-7)
        near = [helical.part(opens, high * (1 + sign * 1e-9)) for sign in (-1, 1)]
        assert near[1][0] - near[0][0] < 3e-9 * near[1][0]
        assert near[0][1] >= near[1][1] > 0


FUNCTIONS = 3  # of the stored model: degrees 0, 1, 2
INSIDE = (5e-3, 5e-3)  # m, rolls at mid-width of a line that crosses the whole face


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_parts_cover_the_line_and_their_weights_add_up_to_those_of_the_whole(helical: Inner, side: float) -> None:
    """From before a line begins to past its end: equal parts one after the other inside the face, together never
    shorter than 2 % of it. Means of P₁ over the parts have that over the line, 3·2z/b at its middle, as their mean."""
    assert dict(read_blob(golden_model("helical_pair")))["counts"][7] == FUNCTIONS
    face = helical.line(side, INSIDE, FUNCTIONS)[0]
    width = np.ptp(face)
    for roll in np.linspace(-20e-3, 40e-3, 61):
        ends, weights = helical.line(side, (roll, 22e-3 - roll), FUNCTIONS)
        assert np.allclose(np.diff(ends, axis=1), np.ptp(ends) / len(ends), rtol=1e-9)
        assert np.allclose(ends[1:, 0], ends[:-1, 1], atol=1e-15)
        assert 0.02 * width * (1 - 1e-9) <= np.ptp(ends) and np.abs(ends).max() <= 0.5 * width * (1 + 1e-9)
        assert weights[:, 0] == pytest.approx(1.0)
        assert weights[:, 1].mean() == pytest.approx(3 * 2 * ends.mean() / width, abs=1e-9)


def test_forces_are_shared_out_over_the_width_without_loss(helical: Inner) -> None:
    """To all slices that the part touches, by the lengths on them."""
    face, dice = helical.line(1.0, INSIDE, FUNCTIONS)[0], np.random.default_rng(1)
    for _ in range(50):
        low, high = np.sort(dice.uniform(face.min(), face.max(), 2))
        shared = helical.spread((low, high), 100.0)
        overlap = np.clip(np.minimum(high, face[:, 1]) - np.maximum(low, face[:, 0]), 0.0, None)
        assert shared == pytest.approx(100.0 * overlap / (high - low), abs=1e-9)


def energy_left(name: str = "helical", **parameters: float) -> float:
    """Energy (J) that the balance leaves of a golden stage that is loaded, reversed and loaded again, as rigid gears
    without contact dampers; dampers elsewhere take 23 J."""
    stage, record = stages()[name], Record()
    kernel = stage.kernel({"level": RIGID, "contact_damping": 0.0} | parameters, None)
    kernel.initialize()
    run(kernel, stage, range(stage.steps), record)
    return record.rows[-1]["energy.residual"]


def test_parts_that_stay_leave_nothing_of_the_energy() -> None:
    """Places, lines and laws of the start: parts close place by place and open again, 1e-7 of what dampers take."""
    for slices in (3.0, 7.0, 20.0):
        assert abs(energy_left("deviating", slices=slices, **{"effect.roll_motion": 0.0})) < 2e-6


def test_what_a_run_leaves_of_its_energy_is_work_of_the_moving_mesh() -> None:
    """It is no error of the step, so a third of the step leaves as much (3 %). What parts leave that ride over uneven
    flanks falls with their length: twenty leave less than half of three."""
    seven = energy_left(slices=7.0)
    assert energy_left(slices=7.0, h=2.5e-6) == pytest.approx(seven, rel=0.03)
    assert energy_left("deviating", slices=20.0) < 0.5 * energy_left("deviating", slices=3.0)
