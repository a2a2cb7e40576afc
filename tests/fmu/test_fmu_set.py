"""FMUs of the planetary set and of the train, on the ground and in a housing: the kernel's numbers bit for bit, their
state, names and terminals; all probes, of the set with either kind of port."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from small_stage import unpack

from evidence.fmu_probes.everything import findings
from evidence.fmu_probes.probes import Subject
from gearfmu.api.models import with_port_kinds
from gearfmu.body import load_bodies
from gearfmu.fmu import export
from gearfmu.fmu.description import shafts
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.stage import load_stage

STEPS, H, RIGID, SLICES = 10, 1e-4, 0, 1
START = {  # what drives a stage from its start on
    "planetary54": {"carrier.tau": 600.0, "sun.tau": -150.0, "carrier.w_start": 85.0, "sun.w_start": 340.0},
    "two_stage": {"input.phi": 0.1},
}
NAMES = {  # ports, and some of what each has
    "planetary54": (
        ["carrier", "sun"],
        {"sun_planet1.force", "ring_planet4.te", "pin.planet2.fx", "bearing.ring.fy", "planet3.gear.w"},
        {"sensor.top.ax", "mount.left_back.fy", "bearing.ring_seat.mz", "effect.housing"},
    ),
    "two_stage": (
        ["input", "output"],
        {"stage1.force", "stage2.te", "stage1.backlash", "bearing.input_left.fx", "seat.wheel2.mz"},
        {"sensor.top.ax", "mount.foot0.fy", "mount.foot3.fz_mean", "effect.housing"},
    ),
}
FORCE = {"planetary54": "ring_planet3.force", "two_stage": "stage2.force"}
PLAIN = [pytest.param(name, marks=pytest.mark.full) for name in START]
STAGES = [*(f"{name}/stage_housed" for name in START), *PLAIN]


def model(name: str, kind: str = "torque") -> StageModel:
    spec = load_stage(name)
    if name.startswith("planetary54"):
        spec = with_port_kinds(spec, {"carrier": kind, "sun": kind})
    return assemble(spec, load_bodies(spec))


@pytest.fixture(scope="module", params=STAGES)
def stage(request: pytest.FixtureRequest) -> tuple[str, StageModel]:
    """The name of the file without its housing, and the model."""
    return request.param.partition("/")[0], model(request.param)


@pytest.fixture(scope="module")
def fmu(stage: tuple[str, StageModel], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(stage[1], tmp_path_factory.mktemp("stage") / f"{stage[0]}.fmu")


@pytest.fixture
def subject(stage: tuple[str, StageModel], fmu: Path) -> Iterator[tuple[Subject, dict[str, int]]]:
    """The FMU, initialised with rigid bodies under START, and its value references."""
    folder = fmu.parent / "open"
    made = Subject(str(folder) if folder.is_dir() else unpack(fmu, folder))
    references = {v.name: v.valueReference for v in made.variables}
    made.fmu.setInteger([references["level"], references["slices"]], [RIGID, SLICES])
    start = START[stage[0]]
    made.fmu.setReal([references[name] for name in start], list(start.values()))
    made.fmu.setupExperiment(startTime=0.0)
    made.fmu.enterInitializationMode()
    made.fmu.exitInitializationMode()
    made.step_size = H
    yield made, references
    made.close()


def test_the_fmu_is_its_kernel_bit_for_bit(
    stage: tuple[str, StageModel], subject: tuple[Subject, dict[str, int]]
) -> None:
    (name, own), (theirs, references) = stage, subject
    kernel = own.kernel(level=float(RIGID), slices=float(SLICES))
    for variable, value in START[name].items():
        kernel.set(variable, value)
    kernel.initialize(0.0)
    names = [v.name for v in own.kernel_variables() if v.causality == "output" and v.type == "Real"]
    found, expected = [], []
    for step in range(STEPS):
        kernel.step(step * H, H)
        theirs.fmu.doStep(step * H, H)
        expected.append([kernel.get(name) for name in names])
        found.append(theirs.fmu.getReal([references[name] for name in names]))
    values = np.array(expected)
    assert np.abs(values[:, names.index(FORCE[name])]).min() > 1000, "the run loads the teeth"
    assert values.tobytes() == np.array(found).tobytes()
    felt = [np.ptp(values[:, k]) for k, of in enumerate(names) if of.startswith(("sensor.", "mount."))]
    assert bool(felt) == bool(own.stage.housings) and min(felt, default=1.0) > 0


@pytest.mark.full
def test_a_helical_set_runs_through_fmpy(tmp_path: Path) -> None:
    """An importer of its own, from start to end: kernel's numbers, axial forces of sun and ring among them."""
    spec = load_stage("helical_set")
    helical = assemble(spec, load_bodies(spec))
    file = export(helical, tmp_path / "helical_set.fmu")
    ratio = 90 / 26
    start = {"carrier.tau": 400.0, "sun.tau": -400 / ratio, "carrier.w_start": 85.0, "sun.w_start": 85 * ratio}
    names = ["sun_planet1.force_mean", "bearing.sun.fz_mean", "bearing.ring.fz_mean", "pin.planet2.mx_mean"]
    found = fmpy.simulate_fmu(
        str(file), start_values=start | {"level": RIGID}, output=names,
        stop_time=STEPS * H, step_size=H, output_interval=H,
    )  # fmt: skip
    kernel = helical.kernel(level=float(RIGID))
    for name, value in start.items():
        kernel.set(name, value)
    kernel.initialize(0.0)
    for step in range(STEPS):
        kernel.step(step * H, H)
        assert [found[name][step + 1] for name in names] == [kernel.get(name) for name in names]
    assert found["bearing.sun.fz_mean"][1:].mean() == pytest.approx(-3 * 579.1, rel=0.02)


def test_a_saved_state_goes_on_with_the_same_bits(subject: tuple[Subject, dict[str, int]]) -> None:
    theirs, _ = subject
    theirs.run(3)
    state, time = theirs.fmu.getFMUstate(), theirs.time
    image = theirs.fmu.serializeFMUstate(state)
    expected = theirs.run(STEPS)
    for again in (state, theirs.fmu.deSerializeFMUstate(image)):
        theirs.fmu.setFMUstate(again)
        theirs.time = time
        assert theirs.run(STEPS) == expected
        theirs.fmu.freeFMUstate(again)


def test_ports_meshes_and_supports_have_their_names(stage: tuple[str, StageModel]) -> None:
    ports, known, housed = NAMES[stage[0]]
    variables = stage[1].kernel_variables()
    names = {v.name for v in variables}
    assert list(shafts(variables)) == ports and known <= names
    assert housed & names == (housed if stage[1].stage.housings else set())


@pytest.mark.full
@pytest.mark.parametrize(("name", "kind"), [("planetary54", "torque"), ("planetary54", "spring"), ("two_stage", "")])
def test_the_fmu_passes_every_probe(name: str, kind: str, tmp_path: Path) -> None:
    assert findings(export(model(name, kind), tmp_path / "stage.fmu")) == []
