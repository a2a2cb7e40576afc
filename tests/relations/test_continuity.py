"""Continuity: static results over positions, torque, backlash and place of an axis have kinks but no jumps.

A jump is found without any number of ours: intervals whose change stands out are halved again and again. What is
continuous changes by ever less there, a square root by 1/√2 a time; a jump stays."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from kinds import Drawn, Kind, every, some

from gearfmu.stage import StageModel
from gearfmu.stage.run.limits import place_of
from gearfmu.stage.run.te import statics_of

NOISE = 1e-10  # m: what rounding of the rows leaves of a transmission error
HALVINGS = 14  # a square root falls to 1/128, what is smooth to 1/16000
LEFT = 1 / 30  # of the largest change of an interval: four times what a square root leaves
LOOKED_AT = 3  # intervals
POSITIONS = {"pair": 120, "helical": 80, "internal": 90, "train": 60, "set": 5, "helical_set": 4}


def jump(values: Callable[[float], float], places: Sequence[float] | np.ndarray) -> tuple[float, float]:
    """Largest jump of a function over ascending places, in its unit, and where; (0, nan) where there is none."""
    grid = np.asarray(places, float)
    found = np.array([values(place) for place in grid])
    change = np.diff(found)
    about = np.convolve(np.pad(change, 1, mode="edge"), [0.5, 0, 0.5], mode="valid")
    worst, limit = (0.0, np.nan), max(LEFT * np.abs(change).max(), NOISE)
    for k in np.argsort(-np.abs(change - about))[:LOOKED_AT]:
        low, high, at_low, at_high = grid[k], grid[k + 1], found[k], found[k + 1]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            at = values(middle)
            if abs(at - at_low) > abs(at_high - at):
                high, at_high = middle, at
            else:
                low, at_low = middle, at
        left = abs(at_high - at_low)
        if left > limit and left > worst[0]:
            worst = float(left), float(low)
    return worst


def te_of(model: StageModel, torque: float, **parameters: float) -> Callable[[float], float]:
    """Transmission error (m) over the position in pitches."""
    kernel, place = statics_of(model, **parameters), place_of(model, None)
    return lambda part: kernel.transmission(-part * place.pitch, torque, place.number).te


@pytest.mark.parametrize("kind", every(full=["helical_set"]))
def test_transmission_error_does_not_jump_over_a_pitch(kind: Kind) -> None:
    """Rolls of all tooth pairs pass every cell of the grid along the flank, its first and last among them."""
    count = POSITIONS[kind.name.partition("-")[0]] * (2 if isinstance(kind, Drawn) else 1)
    assert jump(te_of(kind.model(), kind.torque), np.linspace(0, 1, count + 1))[0] == 0.0


@pytest.mark.parametrize("kind", some(["pair", "helical"], ["train"]))
def test_torque_through_zero_jumps_by_the_backlash_alone(kind: Kind) -> None:
    """On either side of 0 the transmission error is continuous down to the last part of the load; between the sides
    lies the normal backlash (less what both flanks are relieved: the unloaded curves of drive and coast)."""
    kernel, place = statics_of(kind.model()), place_of(kind.model(), None)
    for sign in (1, -1):
        at = 0.3 * place.pitch

        def over(size: float, sign: int = sign, at: float = at) -> float:
            return kernel.transmission(-at, sign * kind.torque * size, place.number).te

        assert jump(over, np.geomspace(1e-7, 1.0, 29))[0] == 0.0
        assert abs(over(1e-7) - over(2e-7)) < 1e-10


@pytest.mark.parametrize("kind", some(["pair", "internal"], ["helical"]))
def test_clearance_through_zero_does_not_jump(kind: Kind) -> None:
    """From teeth that are jammed to teeth with play: the coast flanks come and go without a jump."""
    model = kind.model()
    place = place_of(model, None)

    def over(backlash: float) -> float:
        found = statics_of(model, backlash=backlash)
        return found.transmission(-0.3 * place.pitch, kind.torque, place.number).te

    assert jump(over, np.linspace(-2e-5, 2e-5, 17))[0] == 0.0


@pytest.mark.parametrize("ends", [(5e-3, 20e-3), (20e-3, 5e-3)], ids=["external", "ring"])
def test_rows_along_a_flank_are_exact_for_parabolas_up_to_both_ends(inner_library: Path, ends: Sequence[float]) -> None:
    """Value and slope, at either side of every node: so what is read there is continuous with its first derivative.
    Sees the first or last cell of the grid of rolls left open, which moves a transmission error by a nanometre."""
    count, (form, tip) = 9, ends
    library = ctypes.CDLL(str(inner_library))
    nodes = np.linspace(form, tip, count)
    step = (tip - form) / (count - 1)
    for roll in np.concatenate([nodes, nodes[:-1] + 1e-9 * step, nodes[1:] - 1e-9 * step, nodes[:-1] + 0.3 * step]):
        out = (ctypes.c_double * 9)()
        library.probe_grid(ctypes.c_double(form), ctypes.c_double(tip), count, ctypes.c_double(roll), out)
        index, weight, slope = int(out[0]), np.array(out[1:5]), np.array(out[5:9])
        for power in range(3):
            given = (nodes[index : index + 4] / tip) ** power
            assert weight @ given == pytest.approx((roll / tip) ** power, rel=1e-12)
            assert slope @ given * tip == pytest.approx(power * (roll / tip) ** max(power - 1, 0), rel=1e-6, abs=1e-9)
