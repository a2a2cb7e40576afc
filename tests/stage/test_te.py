"""Loaded transmission error of the shipped pair: exact limits, equilibrium, two methods to one number, smoothness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from driven import begun

from gearfmu.body import Body
from gearfmu.kernel import Kernel
from gearfmu.stage import StageModel, assemble, loaded_te
from gearfmu.stage.run.te import statics_of
from gearfmu.stagefile.forms.expand import with_ports
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.tables.connections import ChainSpec

LOAD = 302.0  # N·m on the pinion
PITCH = 2 * math.pi / 24  # rad, of the wheel
POSITIONS = np.arange(16) / 16


def te(kernel: Kernel, torque: float, positions: np.ndarray = POSITIONS) -> np.ndarray:
    return np.array([kernel.transmission(-p * PITCH, torque).te for p in positions])


def above(values: np.ndarray, harmonic: int) -> float:
    """rms of what lies above a mesh harmonic; values over one pitch."""
    lines = np.fft.rfft(values)
    lines[: harmonic + 1] = 0
    return float(np.sqrt(np.mean(np.fft.irfft(lines, values.size) ** 2)))


def test_overload_finds_its_equilibrium_everywhere(plain: StageModel, relieved: StageModel) -> None:
    """Fifteen times the largest torque: rows in single precision leave 1e-7 of the deflection undecided, no more."""
    for model in (plain, relieved):
        kernel = statics_of(model)
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


def test_bearings_are_a_spring_behind_the_mesh(plain: StageModel, spec: Stage) -> None:
    """1/k of the stage = 1/k of the mesh + Σ 1/k of the bearings, where both have the same pairs in contact; the mesh
    stiffness is that of held axes."""
    soft, held = (loaded_te(plain, [LOAD], 16, **{"effect.bearings": on}) for on in (1.0, 0.0))
    assert np.allclose(soft.mesh_stiffness, held.stage_stiffness, rtol=1e-10, atol=0)  # other sums of the same numbers
    assert np.array_equal(held.mesh_stiffness, held.stage_stiffness)
    behind = 1 / soft.stage_stiffness - 1 / soft.mesh_stiffness
    expected = sum(1 / gear.bearing.stiffness for gear in spec.written.gears)
    assert np.median(behind) == pytest.approx(expected, rel=2e-2)


def test_a_chain_in_a_port_changes_nothing(plain: StageModel, spec: Stage, bodies: list[Body]) -> None:
    """Torque and reaction act on the bores: what an open clutch in a port would hold does not count."""
    chain = ChainSpec(inertia=0.05, disc_inertia=0.01, shaft_k=2e4, shaft_c=1.0)
    ports = {shaft: port.model_copy(update={"chain": chain}) for shaft, port in spec.ports.items()}
    chained = assemble(with_ports(spec, ports), bodies)
    assert np.array_equal(loaded_te(chained, [LOAD], 5).te, loaded_te(plain, [LOAD], 5).te)


@pytest.mark.parametrize("name, torque", [("relieved", 80.0), ("plain", LOAD)])
def test_smooth_over_the_pitch(name: str, torque: float, spec: Stage, relief_spec: Stage, bodies: list[Body]) -> None:
    """No filter anywhere: with tip relief at 80 N·m little is left above the 12th mesh harmonic; without relief the
    tip corners have real harmonics, and the grid of rolls must not add to them."""
    chosen = {"relieved": relief_spec, "plain": spec}[name]
    grids = [assemble(chosen, bodies), assemble(chosen, bodies, rolls=64)]
    once, twice = (te(statics_of(model), torque, np.arange(1024) / 1024) for model in grids)
    assert above(once - twice, 12) < 0.02e-6 and np.std(once - twice) < 0.05e-6
    if name == "relieved":
        assert above(once, 12) < 0.05e-6


def test_rest_under_torques_on_both_ports_is_the_transmission_there(relieved: StageModel) -> None:
    """Torques on both bores in the ratio of the teeth: where the wheel's comes to rest, held there it gives the
    pinion's angle. With the angles of `rest` and its wound shafts the stage begins under the torques it was asked for.
    Both but for the slope of the transmission error, by which torques at one instant are not quite in the ratio of the
    teeth (0.4 % here)."""
    kernel, torques = statics_of(relieved), {"pinion": LOAD, "wheel": LOAD * 24 / 16}
    assert kernel.ports == ["pinion", "wheel"]
    phi = kernel.rest(torques)
    assert phi["pinion"] == pytest.approx(kernel.transmission(phi["wheel"], LOAD).phi, rel=4e-3)
    ends = {f"{name}.phi": phi[name] + torque / relieved.stage.ports[name].k for name, torque in torques.items()}
    wound = begun(relieved.kernel(level=0.0), ends)
    assert [wound.get(f"{name}.tau") for name in torques] == pytest.approx([-t for t in torques.values()], rel=4e-3)


def test_direction_of_approach_does_not_matter(relieved: StageModel) -> None:
    """Equilibrium is one: continued forwards and backwards through the pitch, loading and unloading, as from
    scratch."""
    kernel, fresh = statics_of(relieved), te(statics_of(relieved), LOAD)
    kernel.transmission(0.0, 600.0)
    forwards = [kernel.transmission(-p * PITCH, LOAD, keep=True).te for p in POSITIONS]
    kernel.transmission(0.0, 1.0)
    backwards = [kernel.transmission(-p * PITCH, LOAD, keep=True).te for p in POSITIONS[::-1]][::-1]
    assert np.allclose(forwards, fresh, rtol=0, atol=1e-10) and np.allclose(backwards, fresh, rtol=0, atol=1e-10)
