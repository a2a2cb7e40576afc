"""What an importer connects, on the kernel: capacity with its rate, torque to hold, inputs left alone."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from evidence.accuracy.coupling import WiredSource, Wiring
from gearfmu import fmu
from gearfmu.cosim.accuracy import rms
from gearfmu.cosim.fmu_unit import FmuUnit
from gearfmu.cosim.kernel_unit import KernelUnit
from gearfmu.cosim.scene_run import drive_of, run_once, stage_model
from gearfmu.errors import CouplingError, ModelError
from gearfmu.scenefile.scene import load_scene
from gearfmu.stage import StageModel

TORQUE, H = "pinion.shaft.tau", 5e-6


@pytest.fixture(scope="module")
def model() -> StageModel:
    return stage_model(load_scene("clutch_closure"))


def started(model: StageModel, **more) -> KernelUnit:
    scene = load_scene("clutch_closure")
    unit = KernelUnit(model.blob, {"level": "rigid", "slices": 1, "h": H} | drive_of(scene, model.stage).start() | more)
    give(unit, {"pinion.w": 202.0, "wheel.w": -100.0})
    unit.initialize(0.0)
    return unit


def give(unit: KernelUnit, values: dict[str, float]) -> None:
    unit.set(unit.resolve(list(values)), list(values.values()))


def outputs(unit: KernelUnit) -> np.ndarray:
    return unit.get(unit.resolve(["pinion.clutch.tau", TORQUE, "pinion.disc.w", "pinion.inertia.w"])).copy()


def test_capacity_with_its_rate_is_a_ramp(model):
    """One step of 1 ms with a rate against 200 steps with the capacity of their middles held."""
    whole, parts, rate, steps = started(model), started(model), 5e4, 200
    give(whole, {"pinion.clutch.capacity_rate": rate, "pinion.phi": 0.0})
    whole.step(0.0, steps * H)
    for n in range(steps):
        turned = {"pinion.phi": 202.0 * n * H, "wheel.phi": -100.0 * n * H}
        give(parts, turned | {"pinion.clutch.capacity": rate * (n + 0.5) * H})
        parts.step(n * H, H)
    assert outputs(whole) == pytest.approx(outputs(parts), rel=1e-9)
    assert outputs(whole)[0] == pytest.approx(rate * (steps - 0.5) * H, rel=1e-12)
    assert whole.get(whole.resolve(["pinion.clutch.capacity"]))[0] == 0.0  # the input stays what it was given as


def test_a_falling_capacity_ends_at_zero(model):
    """The ramp does not go below zero, where a clutch would drive."""
    unit = started(model)
    give(unit, {"pinion.clutch.capacity": 10.0, "pinion.clutch.capacity_rate": -1e5})
    unit.step(0.0, 1e-3)
    assert outputs(unit)[0] == 0.0


def test_torque_to_hold_is_extrapolated_from_end_and_mean(model):
    unit = started(model)
    handle = unit.resolve(["pinion.tau", "pinion.tau_mean", "pinion.tau_next"])
    assert len(set(unit.get(handle))) == 1
    give(unit, {"pinion.clutch.capacity": 100.0})
    for n in range(5):
        give(unit, {"pinion.phi": 202.0 * n * 1e-3, "wheel.phi": -100.0 * n * 1e-3})
        unit.step(n * 1e-3, 1e-3)
        end, mean, ahead = unit.get(handle)
        assert ahead == 2.0 * end - mean and end != mean


def test_several_values_are_set_all_or_none(model):
    unit = started(model)
    handle = unit.resolve(["pinion.phi", "pinion.clutch.capacity"])
    before = unit.get(handle).copy()
    with pytest.raises(ModelError, match="pinion.clutch.capacity = -1"):
        unit.set(handle, [1.0, -1.0])
    assert unit.kernel.get("pinion.phi") == before[0] and unit.kernel.get("pinion.clutch.capacity") == before[1]


def test_logs_write_what_get_gives(model, tmp_path):
    """FMU and kernel: reals, integers and booleans of some steps, and no more rows than there is room for."""
    scene = load_scene("clutch_closure")
    parameters = {"level": "rigid", "slices": 1, "h": H} | drive_of(scene, model.stage).start()
    with closing(FmuUnit(fmu.export(model, tmp_path / "stage.fmu"), parameters)) as stage:
        stage.set(stage.resolve(["pinion.w", "wheel.w"]), [202.0, -100.0])
        stage.initialize(0.0)
        for unit in (stage, started(model)):
            names = list(unit.outputs())
            log, handle, rows = unit.log(names, 5), unit.resolve(names), []
            for n in range(5):
                unit.step(n * 1e-4, 1e-4)
                log.take()
                rows.append(unit.get(handle).copy())
            assert np.array_equal(log.rows(), rows)
            with pytest.raises(CouplingError, match="holds 5 times"):
                log.take()


def errors(model: StageModel, master: str, wiring: Wiring, steps: tuple[float, ...]) -> np.ndarray:
    """rms error, N·m, of the shaft torque in the first 20 ms by communication step; the clutch closes five times as
    fast as in the shipped scene."""

    def trace(master: str, step: float, wiring: Wiring):
        changes = {"duration": 0.02, "record": [TORQUE], "clutch.capacity": [["0 s", "0 N*m"], ["10 ms", "250 N*m"]]}
        changes |= {"stage.level": "rigid", "stage.slices": 1, "stage.h": H}
        changes |= {"coupling.master": master, "coupling.step": step}
        return run_once(load_scene("clutch_closure", changes), WiredSource(model, wiring=wiring)).trace

    reference = trace("gs_mean", H, Wiring())[TORQUE]
    return np.array([rms(trace(master, step, wiring)[TORQUE] - reference[:: round(step / H)]) for step in steps])


@pytest.mark.parametrize(
    ("master", "wiring", "order"),
    [
        ("gs_mean", Wiring(), 2),
        ("gs_mean", Wiring(rates=False), 1),
        ("jacobi", Wiring(), 1),
        ("jacobi", Wiring(("phi", "w"), held="tau_next"), 1),
    ],
    ids=["gs_mean", "gs_mean, capacity held", "jacobi", "a not connected"],
)
def test_order_on_the_kernel(model, master, wiring, order):
    """Observed order of the input shaft's torque from 100 to 50 µs."""
    found = errors(model, master, wiring, (1e-4, 5e-5))
    assert np.log2(found[0] / found[1]) == pytest.approx(order, abs=0.3), found
