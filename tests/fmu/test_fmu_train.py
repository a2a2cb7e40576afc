"""The FMU of a train: the kernel's numbers bit for bit, one terminal for each port, variables of every mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_stage import unpack

from evidence.fmu_probes.everything import findings
from evidence.fmu_probes.probes import Subject
from gearfmu.body import load_bodies
from gearfmu.fmu import export
from gearfmu.fmu.description import shafts
from gearfmu.stage import StageModel, Steady, assemble
from gearfmu.stagefile.stage import load_stage

STEPS, H = 20, 1e-4


TRAINS = ["two_stage/stage_housed", pytest.param("two_stage", marks=pytest.mark.full)]


@pytest.fixture(scope="module", params=TRAINS)
def train(request: pytest.FixtureRequest) -> StageModel:
    """At level fast with one slice, which takes a tenth of the preparation."""
    spec = load_stage(request.param)
    return assemble(spec, load_bodies(spec)).with_starts({"level": 1.0, "slices": 1.0})


@pytest.fixture(scope="module")
def fmu(train: StageModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(train, tmp_path_factory.mktemp("train") / "train.fmu")


def test_the_fmu_of_a_train_is_its_kernel_bit_for_bit(train: StageModel, fmu: Path) -> None:
    drive, kernel, subject = Steady(train, 200.0, 100.0), train.kernel(), Subject(unpack(fmu, fmu.parent / "open"))
    references = {v.name: v.valueReference for v in subject.variables}
    outputs = [v.name for v in train.kernel_variables() if v.causality == "output" and v.type == "Real"]
    subject.fmu.setupExperiment(startTime=0.0)
    subject.fmu.enterInitializationMode()
    ours, theirs = [], []
    for step in range(STEPS):
        for name, value in drive(step * H).items():
            kernel.set(name, value)
            subject.fmu.setReal([references[name]], [value])
        if step == 0:
            kernel.initialize(0.0)
            subject.fmu.exitInitializationMode()
        kernel.step(step * H, H)
        subject.fmu.doStep(step * H, H)
        ours.append([kernel.get(name) for name in outputs])
        theirs.append(subject.fmu.getReal([references[name] for name in outputs]))
    subject.close()
    found = np.array(ours)
    assert np.abs(found[:, outputs.index("stage2.force")]).min() > 1000, "the run loads the teeth"
    assert found.tobytes() == np.array(theirs).tobytes()
    felt = [np.ptp(found[:, k]) for k, name in enumerate(outputs) if name.startswith(("sensor.", "mount."))]
    assert bool(felt) == bool(train.stage.housings) and min(felt, default=1.0) > 0


@pytest.mark.full
def test_the_fmu_of_a_train_is_valid(fmu: Path) -> None:
    assert findings(fmu) == []


def test_the_fmu_of_a_train_names_ports_and_meshes(train: StageModel) -> None:
    assert list(shafts(train.kernel_variables())) == ["input", "output"]
    names = {v.name for v in train.kernel_variables()}
    assert {"stage1.force", "stage2.te", "stage1.backlash", "bearing.input_left.fx", "seat.wheel2.mz"} <= names
    housed = {"sensor.top.ax", "mount.foot0.fy", "mount.foot3.fz_mean", "effect.housing"}
    assert housed & names == (housed if train.stage.housings else set())
