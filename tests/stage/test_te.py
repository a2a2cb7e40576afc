"""Loaded transmission error of the shipped pair: exact limits, equilibrium, two methods to one number, convergence,
smoothness."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearfmu.body import Body
from gearfmu.geometry import PairGeometry
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import ChainSpec

LOAD = 302.0  # N·m on the pinion
PITCH = 2 * math.pi / 24  # rad, of the wheel
POSITIONS = np.arange(16) / 16


def ready(model: StageModel, **parameters: float) -> Kernel:
    kernel = model.kernel(**{"level": 0.0, **parameters})
    kernel.prepare()
    return kernel


def te(kernel: Kernel, torque: float, positions: np.ndarray = POSITIONS) -> np.ndarray:
    return np.array([kernel.transmission(-p * PITCH, torque).te for p in positions])


def above(values: np.ndarray, harmonic: int) -> float:
    """rms of what lies above a mesh harmonic; values over one pitch."""
    lines = np.fft.rfft(values)
    lines[: harmonic + 1] = 0
    return float(np.sqrt(np.mean(np.fft.irfft(lines, values.size) ** 2)))


def test_vanishes_with_the_load_and_grows_with_it(plain: StageModel) -> None:
    """The unmodified rigid pair just touches at zero: what is left is compliance × force, positive under load."""
    kernel = ready(plain)
    torques = [1e-6, 1e-3, 1.0, 10.0, 80.0, LOAD, 600.0]
    values = np.array([te(kernel, torque) for torque in torques])
    assert np.all(values > 0) and np.all(np.diff(values, axis=0) > 0)
    assert values[0].max() < 1e-12
    assert np.allclose(values[1] / values[0], 1e3, rtol=1e-2)  # the local law is linear at vanishing force


def test_overload_finds_its_equilibrium_everywhere(plain: StageModel, relieved: StageModel) -> None:
    """Fifteen times the largest torque: rows in single precision leave 1e-7 of the deflection undecided, no more."""
    for model in (plain, relieved):
        kernel = ready(model)
        torques = [1500.0, 3000.0, 6000.0, 9000.0]
        values = np.array([te(kernel, torque, np.arange(41) / 41) for torque in torques])
        assert np.all(np.diff(values, axis=0) > 0)
        assert abs(values[3].mean() / values[2].mean() / 1.5 - 1) < 0.02  # neighbours come in: single positions to 4 %


@pytest.mark.parametrize("rigid_bearings", [False, True])
def test_unloaded_te_is_zero_where_unmodified_flanks_just_touch(plain: StageModel, rigid_bearings: bool) -> None:
    """The zero of the scale: with nothing to bend them the involutes of the pair as drawn touch at te = 0
    everywhere."""
    result = loaded_te(plain, [0.0, 302.0], 64, **{"effect.bearings": float(not rigid_bearings)})
    assert np.abs(result.te[0]).max() < 1e-11 and result.te[1].min() > 2e-5
    assert np.all(result.stage_stiffness[0] > 0.4 * result.stage_stiffness[1])


def test_unloaded_te_of_a_relieved_pair_is_the_gap_of_the_nearest_flanks(
    relieved: StageModel, relief_spec: Stage, pair: PairGeometry
) -> None:
    """With the axes held: te₀ = min over the pairs in reach of the relief depths at the rolls of contact, to the shift
    of these rolls by te₀ itself (slope of the relief: < 1 %)."""
    shapes, positions = pair.gears, 64
    found = loaded_te(relieved, [0.0], positions, **{"effect.bearings": 0.0, "effect.tip_contact": 0.0}).te[0]
    first = shapes[0].r_b * (shapes[0].psi_b + pair.alpha_wt)  # roll of pinion tooth 0 at position 0
    rolls = first + pair.base_pitch * (np.arange(-3, 4)[:, None] + np.arange(positions) / positions)
    depth = np.zeros(rolls.shape)
    for gear, shape, roll in zip(relief_spec.gears, shapes, (rolls, pair.length - rolls), strict=True):
        start = gear.tip_relief.start_roll
        relief = gear.tip_relief.amount * (np.maximum(roll - start, 0) / (shape.s_a - start)) ** 2
        depth += np.where((roll < shape.s_form) | (roll > shape.s_tip), np.inf, relief)
    assert found.max() > 3e-6 and np.allclose(found, depth.min(axis=0), rtol=1e-2, atol=1e-11)
    coast = loaded_te(relieved, [-1e-2], positions, **{"effect.bearings": 0.0, "effect.tip_contact": 0.0}).te[0]
    assert np.ptp(coast) == pytest.approx(np.ptp(found), rel=1e-2)  # the same relief on the other flanks
    assert coast.max() == pytest.approx(-pair.normal_backlash, abs=2e-8)


def test_negative_torque_is_carried_by_the_coast_flanks_across_the_backlash(
    plain: StageModel, pair: PairGeometry
) -> None:
    values = te(ready(plain), -1e-3)
    assert np.allclose(values, -pair.normal_backlash, atol=1e-8)


def test_forces_hold_the_torque_and_shares_add_up(plain: StageModel, pair: PairGeometry) -> None:
    kernel = ready(plain, **{"effect.tip_contact": 0.0})
    for position in POSITIONS:
        forces = kernel.transmission(-position * PITCH, LOAD).forces
        assert sum(map(sum, forces.values())) * pair.gears[0].r_b == pytest.approx(LOAD, rel=1e-9)
        assert all(force >= 0 for row in forces.values() for force in row)
    shares = loaded_te(plain, [80.0, LOAD], 16).shares
    assert np.allclose(shares.sum(axis=2), 1.0, atol=1e-12)


def test_slices_symmetric_about_mid_width_carry_the_same(plain: StageModel) -> None:
    for slices in (2, 5, 10):
        for forces in ready(plain, slices=slices).transmission(-0.3 * PITCH, LOAD).forces.values():
            assert np.allclose(forces, forces[::-1], rtol=1e-6, atol=1e-6)
            if slices > 2 and sum(forces) > 1e3:  # each has rows of its own: the middle is stiffer than the ends
                assert np.ptp(forces) > 0.005 * max(forces)


def test_repeats_after_one_pitch_and_after_a_turn(plain: StageModel) -> None:
    kernel = ready(plain)
    once = te(kernel, LOAD)
    for pitches in (1, -1, 24, 240):
        assert np.allclose(te(kernel, LOAD, POSITIONS + pitches), once, rtol=1e-9, atol=0)


def test_tangent_stiffness_is_the_slope_of_force_over_te(plain: StageModel, pair: PairGeometry) -> None:
    result = loaded_te(plain, [LOAD * 0.99, LOAD, LOAD * 1.01], 16)
    slope = 0.02 * LOAD / pair.gears[0].r_b / (result.te[2] - result.te[0])
    same_pairs = np.all((result.shares[0] > 0) == (result.shares[2] > 0), axis=1)
    assert same_pairs.sum() > 8
    assert np.allclose(result.stage_stiffness[1][same_pairs], slope[same_pairs], rtol=1e-3)


def test_bearings_are_a_spring_behind_the_mesh(plain: StageModel, spec: Stage) -> None:
    """1/k of the stage = 1/k of the mesh + Σ 1/k of the bearings, where both have the same pairs in contact; the mesh
    stiffness is that of held axes."""
    soft, held = (loaded_te(plain, [LOAD], 16, **{"effect.bearings": on}) for on in (1.0, 0.0))
    assert np.allclose(soft.mesh_stiffness, held.stage_stiffness, rtol=1e-10, atol=0)  # other sums of the same numbers
    assert np.array_equal(held.mesh_stiffness, held.stage_stiffness)
    behind = 1 / soft.stage_stiffness - 1 / soft.mesh_stiffness
    expected = sum(1 / gear.bearing.stiffness for gear in spec.written.gears)
    assert np.median(behind) == pytest.approx(expected, rel=2e-2)


def test_bearings_add_their_compliance(plain: StageModel, spec: Stage, pair: PairGeometry) -> None:
    """Isotropic bearings: te grows by F(1/k₁ + 1/k₂); where the moved axes change which pairs carry, by up to a few
    percent more."""
    expected = LOAD / pair.gears[0].r_b * sum(1 / gear.bearing.stiffness for gear in spec.written.gears)
    soft, held = (
        loaded_te(plain, [LOAD], 16, **{"effect.bearings": float(not rigid)}).te[0] for rigid in (False, True)
    )
    more = (soft - held) / expected
    assert np.allclose(np.median(more), 1.0, atol=2e-3) and np.allclose(more, 1.0, atol=6e-2)
    assert np.mean(np.abs(more - 1) < 0.02) > 0.8


def test_level_does_not_change_the_static_te(plain: StageModel) -> None:
    """What is dynamic at level full is residual at level rigid: the same static compliance, but where a tip corner
    carries: its rows have a kink between two nodes of the tables."""
    rigid = te(ready(plain, level=0.0), LOAD)
    for level in (1.0, 2.0, 3.0):
        found = te(ready(plain, level=level), LOAD) / rigid - 1
        assert np.abs(found).max() < 2e-5 and np.median(np.abs(found)) < 2e-6


def test_a_chain_in_a_port_changes_nothing(plain: StageModel, spec: Stage, bodies: list[Body]) -> None:
    """Torque and reaction act on the bores: what an open clutch in a port would hold does not count."""
    chain = ChainSpec(inertia=0.05, disc_inertia=0.01, shaft_k=2e4, shaft_c=1.0)
    ports = {shaft: port.model_copy(update={"chain": chain}) for shaft, port in spec.ports.items()}
    chained = assemble(with_ports(spec, ports), bodies)
    assert np.array_equal(loaded_te(chained, [LOAD], 5).te, loaded_te(plain, [LOAD], 5).te)


def test_converges_with_slices(plain: StageModel) -> None:
    finest = te(ready(plain, slices=10), LOAD)
    error = [np.abs(te(ready(plain, slices=slices), LOAD) / finest - 1).max() for slices in (1, 3, 5)]
    assert error[0] < 1e-3 and error[2] < 1e-4


def test_direction_of_approach_does_not_matter(relieved: StageModel) -> None:
    """Equilibrium is one: continued forwards and backwards through the pitch, loading and unloading, as from
    scratch."""
    kernel, fresh = ready(relieved), te(ready(relieved), LOAD)
    kernel.transmission(0.0, 600.0)
    forwards = [kernel.transmission(-p * PITCH, LOAD, keep=True).te for p in POSITIONS]
    kernel.transmission(0.0, 1.0)
    backwards = [kernel.transmission(-p * PITCH, LOAD, keep=True).te for p in POSITIONS[::-1]][::-1]
    assert np.allclose(forwards, fresh, rtol=0, atol=1e-10) and np.allclose(backwards, fresh, rtol=0, atol=1e-10)


def test_tip_relief_unloads_the_ends_of_contact(plain: StageModel, relieved: StageModel) -> None:
    before, after = (loaded_te(model, [LOAD], 64) for model in (plain, relieved))
    assert np.all(after.te > before.te - 1e-9) and np.all(after.te < before.te + 15e-6)
    assert np.ptp(after.te) < np.ptp(before.te)
    assert ready(relieved, **{"effect.tip_relief": 0.0}).transmission(0.0, LOAD).te == before.te[0, 0]


@pytest.mark.parametrize("name, torque", [("relieved", 80.0), ("plain", LOAD)])
def test_smooth_over_the_pitch(name: str, torque: float, spec: Stage, relief_spec: Stage, bodies: list[Body]) -> None:
    """No filter anywhere: with tip relief at 80 N·m little is left above the 12th mesh harmonic; without relief the
    tip corners have real harmonics, and the grid of rolls must not add to them."""
    chosen = {"relieved": relief_spec, "plain": spec}[name]
    grids = [assemble(chosen, bodies), assemble(chosen, bodies, rolls=64)]
    once, twice = (te(ready(model), torque, np.arange(1024) / 1024) for model in grids)
    print(
        f"{name} {torque:g} N·m: above 12th harmonic {1e6 * above(once, 12):.4f} µm rms, "
        f"grid {1e6 * above(once - twice, 12):.4f} µm rms"
    )
    assert above(once - twice, 12) < 0.02e-6 and np.std(once - twice) < 0.05e-6
    if name == "relieved":
        assert above(once, 12) < 0.05e-6


def test_rest_under_torques_on_both_ports_is_the_transmission_there(relieved: StageModel) -> None:
    """Torques on both bores in the ratio of the teeth: where the wheel's comes to rest, held there it gives the
    pinion's angle. With the angles of `rest` and its wound shafts the stage begins under the torques it was asked for.
    Both but for the slope of the transmission error, by which torques at one instant are not quite in the ratio of the
    teeth (0.4 % here)."""
    kernel, torques = ready(relieved), {"pinion": LOAD, "wheel": LOAD * 24 / 16}
    assert kernel.ports == ["pinion", "wheel"]
    phi = kernel.rest(torques)
    assert phi["pinion"] == pytest.approx(kernel.transmission(phi["wheel"], LOAD).phi, rel=4e-3)
    started = relieved.kernel(level=0.0)
    for name, torque in torques.items():
        stiffness = relieved.stage.ports[name].k
        assert stiffness is not None
        started.set(f"{name}.phi", phi[name] + torque / stiffness)
    started.initialize()
    assert [started.get(f"{name}.tau") for name in torques] == pytest.approx([-t for t in torques.values()], rel=4e-3)
