"""Two methods, one answer: FMU and kernel, native and pythonfmu, one stage or thread beside another."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from small_stage import references, unpack

import gearfmu as gf
from evidence.fmu_probes.probes import Subject
from gearfmu.fmu import export
from gearfmu.stage import StageModel

STEPS, H = 200, 1e-4
TURN, RATIO = 2e-2, 16 / 24  # rad per step; the wheel turns the other way
INPUTS = {
    "pinion.phi": (1e-3, TURN),
    "pinion.w": (TURN / H, 0.0),
    "wheel.phi": (0.0, -TURN * RATIO),
    "wheel.w": (-TURN / H * RATIO, 0.0),
}

SIDE_BY_SIDE = """
import ctypes, json, sys
mode, folders = getattr(ctypes, sys.argv[1]), sys.argv[2:]
ctypes.cdll.LoadLibrary = lambda path: ctypes.CDLL(path, mode=mode)
from evidence.fmu_probes.probes import Subject
subjects = [Subject(folder).initialized() for folder in folders]
runs = [b"" for _ in folders]
for _ in range(20):
    for k, subject in enumerate(subjects):
        runs[k] += subject.run(1)
assert hasattr(ctypes.CDLL(None), "gk_step") == (mode == ctypes.RTLD_GLOBAL), "the mode had no effect"
print(json.dumps([bits.hex() for bits in runs]))
"""


def inputs_at(step: int, wrapped: bool = False) -> dict[str, float]:
    """A loaded pair that turns: angle, by wish between −π and π, speed, and no acceleration."""
    values = {name: base + step * slope for name, (base, slope) in INPUTS.items()}
    return {
        name: math.remainder(value, math.tau) if wrapped and name.endswith(".phi") else value
        for name, value in values.items()
    }


@dataclass(frozen=True)
class Drive:
    """Inputs of every step; integer and real parameters of the start; number of steps."""

    inputs: Callable[[int], dict[str, float]] = inputs_at
    whole: dict[str, int] = field(default_factory=dict)
    real: dict[str, float] = field(default_factory=dict)
    steps: int = STEPS


PAIR, WRAPPED = Drive(), Drive(lambda step: inputs_at(step, True))


def fmu_run(folder: str, outputs: list[str], drive: Drive = PAIR) -> np.ndarray:
    subject = Subject(folder)
    by_name = references(subject)

    def give(values: dict[str, float]) -> None:
        subject.fmu.setReal([by_name[name] for name in values], list(values.values()))

    subject.fmu.setInteger([by_name[name] for name in drive.whole], list(drive.whole.values()))
    give(drive.inputs(0) | drive.real)
    subject.fmu.setupExperiment(startTime=0.0)
    subject.fmu.enterInitializationMode()
    subject.fmu.exitInitializationMode()
    rows = []
    for k in range(drive.steps):
        give(drive.inputs(k))
        subject.fmu.doStep(k * H, H)
        rows.append(subject.fmu.getReal([by_name[name] for name in outputs]))
    subject.close()
    return np.array(rows)


def kernel_run(model: StageModel, outputs: list[str], drive: Drive = PAIR) -> np.ndarray:
    kernel = model.kernel()
    for name, value in (drive.inputs(0) | drive.real | drive.whole).items():
        kernel.set(name, value)
    kernel.initialize(0.0)
    rows = []
    for k in range(drive.steps):
        for name, value in drive.inputs(k).items():
            kernel.set(name, value)
        kernel.step(k * H, H)
        rows.append([kernel.get(name) for name in outputs])
    return np.array(rows)


def real_outputs(model: StageModel) -> list[str]:
    return [v.name for v in model.kernel_variables() if v.causality == "output" and v.type == "Real"]


@pytest.fixture(scope="module")
def outputs(model: StageModel) -> list[str]:
    return real_outputs(model)


def test_fmu_is_the_kernel_bit_for_bit(model, unpacked, unpacked_python, outputs):
    expected = kernel_run(model, outputs)
    assert np.ptp(expected[:, outputs.index("mesh.force")]) > 100, "the run loads the teeth"
    for folder in (unpacked, unpacked_python):
        assert fmu_run(folder, outputs).tobytes() == expected.tobytes()


SETS = {  # torques and twists of the ports and speeds at the start; a mesh that they load
    "planetary54/stage_housed": ({"carrier.tau": 600.0, "sun.tau": -150.0}, (85.0, 340.0), "ring_planet3.force"),
    "two_stage/stage_housed": ({"input.phi": 0.1}, (), "stage2.force"),
    "helical_set": ({"carrier.tau": 400.0, "sun.tau": -115.6}, (85.0, 294.2), "sun_planet1.force"),
}


@pytest.mark.parametrize("name", [*list(SETS)[:2], pytest.param("helical_set", marks=pytest.mark.full)])
def test_fmus_of_sets_and_housed_stages_are_their_kernel_bit_for_bit(name: str, tmp_path: Path) -> None:
    """With rigid bodies; sensors and mounts of a housing feel the run."""
    given, speeds, force = SETS[name]
    own = gf.assemble(name, ports={port.partition(".")[0]: "torque" for port in given} if speeds else None)
    start = dict(zip(("carrier.w_start", "sun.w_start"), speeds, strict=False))
    drive, names = Drive(lambda step: given, {"level": 0, "slices": 1}, start, 10), real_outputs(own)
    expected = kernel_run(own, names, drive)
    assert np.abs(expected[:, names.index(force)]).min() > 1000, "the run loads the teeth"
    assert fmu_run(unpack(export(own, tmp_path / "stage.fmu"), tmp_path / "open"), names, drive).tobytes() == (
        expected.tobytes()
    )
    felt = [np.ptp(expected[:, k]) for k, of in enumerate(names) if of.startswith(("sensor.", "mount."))]
    assert bool(felt) == bool(own.stage.housings) and min(felt, default=1.0) > 0


def test_angles_may_be_wrapped(unpacked, outputs):
    """To ±π, as some hosts give them: taken literally they ended the run as tooth penetration. Rounding remains."""
    straight, wrapped = (fmu_run(unpacked, outputs, drive) for drive in (PAIR, WRAPPED))
    assert max(abs(inputs_at(STEPS)[name]) for name in INPUTS if name.endswith(".phi")) > math.pi
    names = [i for i, name in enumerate(outputs) if name.startswith(("pinion", "wheel", "mesh"))]
    size = np.abs(straight).max(axis=0)
    print(dict(zip(outputs, np.abs(wrapped - straight).max(axis=0) / np.where(size > 0, size, 1), strict=True)))
    assert np.all(np.abs(wrapped - straight)[:, names] <= 1e-6 * size[names])


@pytest.mark.parametrize("order", [(0, 1), pytest.param((1, 0), marks=pytest.mark.full)])
@pytest.mark.parametrize("mode", [pytest.param("RTLD_LOCAL", marks=pytest.mark.full), "RTLD_GLOBAL"])
def test_two_stages_in_one_process(unpacked, unpacked_other, mode, order):
    """Also with all symbols global (RTLD_GLOBAL): the second FMU must not run the first one's kernel."""
    alone = []
    for folder in (unpacked, unpacked_other):
        subject = Subject(folder).initialized()
        alone.append(subject.run(20).hex())
        subject.close()
    assert alone[0] != alone[1]
    folders = [(unpacked, unpacked_other)[k] for k in order]
    command, log = [sys.executable, "-c", SIDE_BY_SIDE, mode, *folders], {**os.environ, "LD_DEBUG": "bindings"}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=log)
    assert json.loads(done.stdout.splitlines()[-1]) == [alone[k] for k in order]
    assert not crossing(done.stderr, folders), "the dynamic linker tied one FMU to the other"


def crossing(log: str, folders: list[str]) -> list[str]:
    """Pairs in glibc's LD_DEBUG=bindings that tie a symbol of one folder's library to a library of another folder."""
    pairs = re.findall(r"binding file (.*?) \[\d+\] to (.*?) \[\d+\]: .*", log)
    assert sys.platform != "linux" or any("libc.so" in target for _, target in pairs), "no bindings in the log"
    owners = {side: [folder for folder in folders if side.startswith(folder)] for pair in pairs for side in pair}
    return [pair for pair in pairs if all(map(owners.get, pair)) and owners[pair[0]] != owners[pair[1]]]


def test_instances_in_two_threads_do_not_meet(unpacked, unpacked_other):
    """Two FMUs, and two instances of one, stepped at the same time: the bits of each alone."""
    folders = (unpacked, unpacked_other, unpacked)
    alone = []
    for folder in folders[:2]:
        subject = Subject(folder).initialized()
        alone.append(subject.run(STEPS))
        subject.close()
    subjects = [Subject(folder).initialized() for folder in folders]
    gate = threading.Barrier(len(folders))

    def run(subject: Subject) -> bytes:
        gate.wait()
        return subject.run(STEPS)

    with ThreadPoolExecutor(len(folders)) as pool:
        together = list(pool.map(run, subjects))
    for subject in subjects:
        subject.close()
    assert together == [alone[0], alone[1], alone[0]]
