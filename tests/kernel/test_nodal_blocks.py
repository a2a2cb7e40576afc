"""Nodal contact on two blocks: exact penalty, impact and momentum; what the kernel refuses; and nothing changes for
those who do not ask for it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import stepped
from flat import FlatBody, FlatContact, flat_blob
from small_model import pair_blob, with_nodes

from gearfmu.errors import ModelError, SimulationError
from gearfmu.kernel import Kernel
from gearfmu.stage.assembly.blob import read_blob, write_blob

DG4, RK45, CENTRAL = 0, 2, 3
FULL, PAPER = 3, 4
LINE, NODAL = 1, 2
PENALTY, SPEED = 2e9, 0.1  # N/m³, m/s; the penalty of with_nodes
AREA = 1.0 * 0.01**2 / (2 * 0.01)  # m²: face width times arc length of the flank that a flat body has in name
MASSES = (0.8, 1.7)


def blocks(omega: float = 0.0, damping: float = 0.0) -> bytes:
    """Two blocks 1 m wide that just touch, rigid or with one mode each."""
    bodies = [
        FlatBody(m, np.array([omega] if omega else []), np.zeros(1 if omega else 0),
                 np.full((1, 1 if omega else 0), 0.4), np.zeros((1, 1)))
        for m in MASSES
    ]  # fmt: skip
    return flat_blob("blocks", bodies, FlatContact(damping=damping))


def run(blob: bytes, h: float, steps: int, names: tuple[str, ...], **parameters: float) -> np.ndarray:
    """(steps, names) after every step; the left block is thrown against the right one."""
    kernel = Kernel(blob, {"level": PAPER, "contact": NODAL, "left.w_start": SPEED, "h": h} | parameters)
    kernel.initialize()
    return stepped(kernel, steps, h, *names)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("nodes", [(2, 2), (9, 5), (40, 33)])
def test_rigid_blocks_are_a_spring_of_penalty_times_area(share: float, nodes: tuple[int, int]) -> None:
    """Whoever's nodes and however many: half a sine of amplitude v √(m K), K = k A; momentum and energy are kept."""
    reduced, stiffness = MASSES[0] * MASSES[1] / sum(MASSES), PENALTY * AREA
    h = 2e-6
    found = run(with_nodes(blocks(), share, nodes), h, 1400, ("mesh.force", "left.w", "right.w"))
    time, length = (np.arange(len(found)) + 1) * h, math.pi * math.sqrt(reduced / stiffness)
    peak = SPEED * math.sqrt(reduced * stiffness)
    exact = np.where(time < length, peak * np.sin(math.pi * time / length), 0.0)
    assert time[-1] > length and np.abs(found[:, 0] - exact).max() < 1e-5 * peak
    left = SPEED * (MASSES[0] - MASSES[1]) / sum(MASSES)
    assert found[-1, 1] == pytest.approx(left, rel=1e-5)
    assert found[-1, 2] == pytest.approx(SPEED + left, rel=1e-5)


def test_elastic_blocks_keep_momentum_and_energy() -> None:
    """Modes in contact, undamped: momentum to rounding, energy as the integrator keeps it, and with central
    differences of nearly second order."""
    blob = with_nodes(blocks(omega=6e3))
    names = ("left.gear.w", "right.gear.w", "energy.stored", "mesh.force")
    found = run(blob, 2e-6, 2000, names, **{"integrator": RK45})
    momentum = found[:, :2] @ np.array(MASSES)
    assert found[:, 3].max() > 0.0 and found[-1, 3] == 0.0
    assert np.abs(momentum / (MASSES[0] * SPEED) - 1).max() < 1e-9
    assert np.abs(found[:, 2] / (0.5 * MASSES[0] * SPEED**2) - 1).max() < 1e-5
    drifts = [np.ptp(run(blob, h, round(4e-3 / h), names, integrator=CENTRAL)[:, 2]) for h in (16e-6, 4e-6)]
    assert 0.5 * math.log2(drifts[0] / drifts[1]) > 1.4


def test_damping_takes_energy_and_never_pulls() -> None:
    found = run(with_nodes(blocks(damping=2e3)), 2e-6, 1400, ("energy.stored", "mesh.force"))
    assert found[-1, 0] < 0.99 * found[0, 0] and np.diff(found[:, 0]).max() < 1e-7 * found[0, 0]
    assert found[:, 1].min() == 0.0


def test_a_model_with_nodes_that_are_not_asked_for_is_the_same() -> None:
    """Line contact, by name and at every level but paper, and level paper without nodes: equal to the last bit."""
    plain = pair_blob(("torque", "torque"))
    nodal = with_nodes(plain, penalty=1e14)
    for level, parameters in ((FULL, {}), (PAPER, {"contact": LINE}), (PAPER, {"integrator": 1})):
        runs = [_pair_run(blob, level, parameters) for blob in (plain, nodal)]
        assert np.array_equal(*runs)
    assert not np.array_equal(_pair_run(plain, PAPER, {}), _pair_run(nodal, PAPER, {}))


def _pair_run(blob: bytes, level: int, parameters: dict[str, float]) -> np.ndarray:
    kernel = Kernel(blob, {"level": level, "pinion.w_start": 200.0, "wheel.w_start": -133.0} | parameters)
    kernel.initialize()
    return stepped(kernel, 40, 5e-6, "mesh.force", "mesh.te", "energy.stored")


@pytest.mark.parametrize(
    ("blob", "parameters", "words"),
    [
        (with_nodes(blocks()), {"integrator": DG4, "level": FULL}, "use integrator rk45 or central"),
        (with_nodes(blocks()), {"contact_penalty": 0.0}, "contact_penalty is 0"),
        (blocks(), {}, "no flank nodes"),
    ],
    ids=["dg4", "penalty", "no nodes"],
)
def test_what_nodal_contact_cannot_do_is_refused(blob: bytes, parameters: dict[str, float], words: str) -> None:
    with pytest.raises((ModelError, SimulationError), match=words):
        run(blob, 2e-6, 1, ("mesh.force",), **parameters)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ({"nodes0": np.array([1, 5], np.int32)}, "number of nodes of a flank = 1 is out of range"),
        ({"nodes1": np.array([9, 10000], np.int32)}, "number of nodes of a flank = 10000 is out of range"),
        ({"nodes1": None}, "nodes of a flank are missing"),
        ({"nodal": np.array([[-1.0, 0.5]])}, "penalty of nodal contact, N/m3, = -1 is out of range"),
        ({"nodal": np.array([[1e14, 1.5]])}, "numbers of nodal contact are out of range"),
        ({"nodal": np.array([1e14])}, "nodal has the wrong length"),
    ],
)
def test_a_blob_with_wrong_nodes_is_refused(damage: dict, words: str) -> None:
    sections = dict(read_blob(with_nodes(blocks()))) | damage
    with pytest.raises(ModelError, match=words):
        Kernel(write_blob({name: value for name, value in sections.items() if value is not None}))
