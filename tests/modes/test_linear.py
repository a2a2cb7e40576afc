"""The linearised stage: one oscillator by hand, tangent stiffness and mesh mode by other roads, ports and chains."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearfmu.body import ReducedBody, load_stage_bodies
from gearfmu.modes.linear import Linearised, linearised, stage_modes
from gearfmu.spec.ports import ChainSpec
from gearfmu.spec.stage import StageSpec, load_stage
from gearfmu.stage import StageModel, assemble, loaded_te

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
TORQUE = 302.0
PINION_BORE, WHEEL_BORE = -4, -1  # rows of the bores' angles


@pytest.fixture(scope="module")
def bodies() -> list[ReducedBody]:
    return load_stage_bodies(load_stage("fzg_c"))


@pytest.fixture(scope="module")
def model(bodies: list[ReducedBody]) -> StageModel:
    return assemble(load_stage("fzg_c"), bodies)


def with_ports(model: StageModel, bodies: list[ReducedBody], **ports: dict) -> StageModel:
    spec: StageSpec = model.spec
    changed = {name: spec.ports[name].model_copy(update=ports.get(name, {})) for name in spec.ports}
    return assemble(spec.model_copy(update={"ports": changed}), bodies)


def test_one_oscillator_behind_two_flexibilities_in_series() -> None:
    """2 kg on 3 µm/N of its own and 1 µm/N of residual; the dashpot lies beside the 3 µm/N."""
    system = Linearised(
        mass=np.array([2.0]), omega=np.zeros(1), zeta=np.zeros(1), rows=np.ones((1, 1)), own=np.array([3e-6]),
        residual=np.array([[1e-6]]), group=np.array([1]), dashpot=np.array([5.0]), tooth=np.array([-1]),
    )  # fmt: skip
    frequency, damping, shares, _ = system.modes(1)
    omega = np.sqrt(1 / 4e-6 / 2)
    assert frequency[0] == pytest.approx(omega / (2 * np.pi), rel=1e-12)
    assert damping[0] == pytest.approx(0.5 * 5.0 * omega * 3e-6 * 3 / 4, rel=1e-12)
    assert shares[0] == pytest.approx([0, 1, 0, 0])


def test_a_mode_of_a_body_keeps_its_damping() -> None:
    system = Linearised(
        mass=np.ones(1), omega=np.array([900.0]), zeta=np.array([0.02]), rows=np.zeros((1, 1)), own=np.ones(1),
        residual=np.zeros((1, 1)), group=np.zeros(1, int), dashpot=np.zeros(1), tooth=np.zeros(1, int),
    )  # fmt: skip
    frequency, damping, shares, mesh_force = system.modes(1)
    assert (2 * np.pi * frequency[0], damping[0], mesh_force[0]) == pytest.approx((900.0, 0.02, 0.0))
    assert shares[0] == pytest.approx([0, 0, 0, 1])


@pytest.mark.parametrize("rigid_bearings", [True, False])
def test_tangent_stiffness_is_that_of_te(model: StageModel, bodies: list[ReducedBody], rigid_bearings: bool) -> None:
    """Statics of (29) – modes, residual, local law, bearings – against a difference quotient of the contact routine,
    where no tip edge carries (its contact moves along the edge, which (29) does not know)."""
    theirs = loaded_te(model, [TORQUE], 8, rigid_bearings=rigid_bearings)
    r_b = bodies[0].r_b
    for place in (2, 3, 5, 7):
        system = linearised(model, bodies, TORQUE, place / 8)
        own = system.own.copy()
        own[[PINION_BORE, WHEEL_BORE]] = 1e3, 1e-15  # pinion free to turn, wheel held
        if rigid_bearings:
            own[[-6, -5, -3, -2]] = 1e-13
        compliance = _row_compliance(replace(system, own=own), PINION_BORE)
        assert 1 / (compliance * r_b**2) == pytest.approx(theirs.stiffness[0, place], rel=4e-3)


def _row_compliance(system: Linearised, row: int) -> float:
    """Displacement of a row under a unit load on it."""
    inner = np.linalg.inv(np.diag(system.own) + system.residual)
    unit = system.residual[:, row]
    load = system.rows.T @ (np.eye(len(inner))[row] - inner @ unit)
    moved = np.linalg.solve(system.stiffness, load)
    force = -inner @ (system.rows @ moved + unit)
    return float(system.rows[row] @ moved + system.residual[row] @ force + system.residual[row, row])


@pytest.mark.full
def test_mesh_mode_and_its_damping(
    model: StageModel, bodies: list[ReducedBody], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against benchmarks/mesh_mode.py, which takes gears as rigid on a mean mesh stiffness: elastic gears change its
    7.8 kHz a little; the contact dashpots that give it 3 % there give 3 % here."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    rigid = importlib.import_module("mesh_mode").mesh_mode("fzg_c", TORQUE)
    free = with_ports(model, bodies, pinion={"kind": "torque", "chain": None}, wheel={"kind": "torque", "chain": None})
    found = stage_modes(free, bodies, TORQUE, 8, positions=8)
    loudest = found.mesh_force.mean(axis=0).argmax()
    assert found.frequency[:, loudest].mean() == pytest.approx(rigid["frequency"], rel=0.12)
    assert found.damping_ratio[:, loudest].mean() == pytest.approx(0.03, rel=0.1)


def test_mesh_force_of_all_modes_is_that_of_a_blocked_mesh(model: StageModel, bodies: list[ReducedBody]) -> None:
    """Σ Γ²/ω² over all modes = 1ᵀ(D + C_res)⁻¹1, the force of a unit transmission error with every mode held, less
    what is left with all of them free: nothing, since the shafts hold one end only loosely."""
    system = linearised(model, bodies, TORQUE, 3 / 8)
    frequency, damping, _, mesh_force = system.modes(len(system.mass))
    total = (mesh_force * 2 * damping).sum()
    blocked = np.linalg.inv(np.diag(system.own) + system.residual)
    contacts = system.group == 0
    unit = contacts.astype(float)
    moved = np.linalg.solve(system.stiffness, system.rows.T @ blocked @ unit)
    assert total == pytest.approx(unit @ blocked @ system.rows @ moved, rel=1e-6)
    assert frequency[0] > 1 and len(frequency) == len(system.mass)


def test_shares_add_up_and_frequencies_ascend(model: StageModel, bodies: list[ReducedBody]) -> None:
    found = stage_modes(model, bodies, TORQUE, 20, positions=3)
    assert found.frequency.shape == (3, 20) and np.all(np.diff(found.frequency, axis=1) >= 0)
    assert np.allclose(found.shares.sum(axis=2), 1, atol=1e-6) and found.shares.min() > -1e-6
    assert found.damping_ratio.min() > 0.009


def test_ports(model: StageModel, bodies: list[ReducedBody]) -> None:
    """With torques on both shafts the stage turns freely: one rigid mode, which is not shown, in place of the
    lowest."""
    free = with_ports(model, bodies, pinion={"kind": "torque", "chain": None}, wheel={"kind": "torque", "chain": None})
    held = with_ports(model, bodies, pinion={"kind": "fixed", "chain": None}, wheel={"kind": "fixed", "chain": None})
    values = {
        name: np.linalg.eigvalsh(linearised(stage, bodies, TORQUE, 0.375).stiffness)
        for name, stage in (("free", free), ("spring", model), ("fixed", held))
    }
    assert abs(values["free"][0]) < 1e-6 * values["free"][1] and values["spring"][0] > 0
    first = {name: linearised(s, bodies, TORQUE, 0.375).modes(1)[0][0]
             for name, s in (("free", free), ("spring", model), ("fixed", held))}  # fmt: skip
    assert first["spring"] < first["fixed"] and first["spring"] < first["free"]


def test_a_chain_with_heavy_inertia_holds_the_shaft(model: StageModel, bodies: list[ReducedBody]) -> None:
    """Inertia 10 kg·m² behind the chain's shaft: the same as that shaft as a port spring, and one slow mode more."""
    chain = ChainSpec(inertia="10 kg*m^2", disc_inertia="1e-3 kg*m^2", shaft_k="15e3 N*m/rad", shaft_c="0.2 N*m*s/rad")
    chained = with_ports(model, bodies, pinion={"kind": "spring", "chain": chain})
    spring = with_ports(model, bodies, pinion={"kind": "spring", "k": 15e3, "c": 0.2, "chain": None})
    one, other = (linearised(s, bodies, TORQUE, 0.375) for s in (chained, spring))
    assert len(one.mass) == len(other.mass) + 1
    (slow, *_), pinion = one.modes(1), bodies[0]
    mesh = loaded_te(model, [TORQUE], 8).stiffness[0, 3] * pinion.r_b**2
    behind = 1 / (1 / 15e3 + 1 / mesh + 1 / (40e3 * (pinion.teeth / bodies[1].teeth) ** 2))
    assert slow[0] == pytest.approx(np.sqrt((20e3 + behind) / 10) / (2 * np.pi), rel=2e-3)
    for theirs, mine in zip(other.modes(6)[:3], one.modes(7)[:3], strict=True):
        assert np.allclose(mine[1:], theirs, rtol=1e-3, atol=1e-5)
