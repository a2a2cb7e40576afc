"""Natural frequencies that `stage_modes` reports are those of the stage at every position, and all of them.

Independent: eigenvalues of M and K alone (no shapes), less the free rotations that are known beforehand: one where no
port is a spring, and one of each gear without any contact.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
from kinds import FULL, KINDS, Kind, bodies_of, drawn, listed

from gearfmu.kernel import Kernel
from gearfmu.modes import linear
from gearfmu.report.campbell import LOUD, crossings, mesh_families
from gearfmu.stage import StageModel
from gearfmu.stage.run.limits import engagements_per_turn

COUNT = 16
DEAR = {"train": 3, "set": 12, "helical_set": 2}  # positions


@pytest.fixture(autouse=True)
def one_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Preparing one takes most of the time: `stage_modes` and the oracle share it."""
    made, own = {}, linear.full_kernel

    def kernel(model: StageModel) -> Kernel:
        if id(model) not in made:
            made[id(model)] = own(model)
        return made[id(model)]

    monkeypatch.setattr(linear, "full_kernel", kernel)


def free_rotations(kind: Kind, system: linear.Linearised) -> int:
    loaded = {e for e in system.linear.label[:, 0].tolist() if e >= 0}
    touching = {gear for e in loaded for gear in kind.stage.engagements[e].gears}
    held = any(port.kind == "spring" for port in kind.stage.ports.values())
    return (0 if held else 1) + sum(gear.name not in touching for gear in kind.stage.gears)


def frequencies(kind: Kind, model: StageModel, position: float) -> tuple[np.ndarray, int]:
    """The lowest natural frequencies (Hz) at a position without the slowest, which are free rotations, and number of
    the latter."""
    system = linear.linearised(model, kind.torque, position)
    root = np.sqrt(system.linear.mass)
    squared = sl.eigvalsh(system.stiffness / root / root[:, None], subset_by_index=[0, min(2 * COUNT, len(root)) - 1])
    free = free_rotations(kind, system)
    return np.sqrt(np.delete(squared, np.argsort(np.abs(squared))[:free])) / (2 * np.pi), free


@pytest.mark.parametrize(
    ("kind", "positions"),
    [pytest.param(KINDS[name], n, id=f"{name}-{n}") for name, n in (("pair", 12), ("helical", 3), ("internal", 12))]
    + [pytest.param(KINDS[name], n, id=f"{name}-{n}", marks=FULL) for name, n in DEAR.items()]
    + [pytest.param(drawn(seed), 3, id=f"drawn-{seed}", marks=FULL) for seed in range(20)],
)
def test_reported_modes_exist_at_every_position_and_none_is_missing(kind: Kind, positions: int) -> None:
    """Fault: near-rigid rotation of a set counted as a mode at positions where it was faster than 1 Hz, so that means
    over the positions ("1197 Hz") were those of different modes."""
    model = kind.model()
    found = linear.stage_modes(model, listed(kind.stage, bodies_of(kind.file)), kind.torque, COUNT, positions)
    numbers = []
    for position, own in zip(found.position, found.frequency, strict=True):
        real, free = frequencies(kind, model, position)
        numbers.append(free)
        nearest = np.abs(own[:, None] - real).argmin(axis=1)
        assert len(set(nearest)) == COUNT, "each reported mode is another one of the stage's"
        assert own == pytest.approx(real[nearest], rel=1e-6)
        sure = 0.9 * found.frequency[:, COUNT // 2 :].min()  # modes at the end of the list may leave it
        assert (own < sure).sum() == (real < sure).sum(), f"modes below {sure:.0f} Hz"
    assert found.rigid.shape == (positions, max(numbers))


def test_modes_are_the_same_at_four_times_as_many_positions() -> None:
    """A mode followed over 12 positions is one of those followed over 48; frequencies cross on the way. Fault: modes
    stacked by their number at each position."""
    model, bodies = KINDS["pair"].model(), list(bodies_of(KINDS["pair"].file).values())
    coarse, fine = (linear.stage_modes(model, bodies, 302.0, 40, n).frequency for n in (12, 48))
    assert (np.diff(coarse, axis=1) < 0).any(), "as two 39 kHz modes do"
    apart = np.abs(fine[::4, None, :] / coarse[:, :, None] - 1).max(axis=0).min(axis=1)
    assert (apart[:36] < 1e-6).all(), "the last of the list may leave it"


def test_equal_meshes_have_one_line_each() -> None:
    """By hand: four planets' meshes with the sun are one kind, those with the ring another, at the same orders; a mode
    that drives one of them drives all."""
    model = KINDS["set"].model()
    families = mesh_families(model)
    assert [len(family.meshes) for family in families] == [4, 4]
    assert {family.cycles for family in families} == set(engagements_per_turn(model)) == {54.0}
    assert len(mesh_families(KINDS["train"].model())) == 2
    force = np.zeros((1, 2, 8))
    force[0, 0, 2] = force[0, 1, :] = 1.0  # mode 1: one mesh of the sun alone; mode 2: all
    force[0, 1, 2] = 0.5 * LOUD
    modes = linear.StageModes(1.0, np.zeros(1), np.array([[900.0, 1800.0]]), force[:, :, 0], force, force)
    found = crossings(modes, families, 1e9)
    assert [(c.family.name[:8], c.mode) for c in found if c.order == 1] == [
        ("4 meshes", 1), ("4 meshes", 2), ("4 meshes", 2)
    ]  # fmt: skip
