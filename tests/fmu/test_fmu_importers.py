"""Other importers run the native FMU and give fmpy's numbers.

libcosim and Ecos come from PyPI. fmusim (Reference-FMUs), fmuCheck (FMI Library) and OMSimulator are taken from PATH or
from the environment variables FMUSIM, FMUCHECK and OMSIMULATOR; a test without its program is skipped and says so."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from test_fmu_equal import STEPS, Drive, H, fmu_run, inputs_at

import gearfmu as gf

NAMES = ["mesh.force", "mesh.te", "pinion.tau", "bearing.wheel.fx"]
HELD = {"pinion.phi": 2e-3, "pinion.w": 1.0}  # inputs


@pytest.mark.needs("libcosimpy")
def test_libcosim_gives_the_numbers_of_fmpy(native, unpacked):
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    variables = {v.name: v.valueReference for v in read_model_description(unpacked).modelVariables}
    execution = CosimExecution.from_step_size(int(H * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(native), instance_name="stage"))
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    manipulator.slave_real_values(slave, [variables[name] for name in HELD], list(HELD.values()))
    rows = []
    for _ in range(STEPS):
        execution.step()
        rows.append(observer.last_real_values(slave, [variables[name] for name in NAMES]))
    expected = held_run(unpacked)
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(np.array(rows) - expected) / scale).max() <= 1e-12


def held_run(folder: str) -> np.ndarray:
    """NAMES after each of STEPS steps with HELD, which is set after the initialisation."""
    at_rest = dict.fromkeys(HELD, 0.0)
    return fmu_run(folder, NAMES, Drive(lambda step: HELD, real=at_rest))


ECOS = """
import json, sys
from ecospy import EcosSimulation, EcosSimulationStructure
fmu, steps, h, inputs, outputs = json.loads(sys.argv[1])
with EcosSimulationStructure() as structure:
    structure.add_model("stage", fmu)
    with EcosSimulation(structure=structure, step_size=h) as simulation:
        simulation.init()
        for name, value in inputs.items():
            simulation.set_real("stage::" + name, value)
        rows = []
        for _ in range(steps):
            simulation.step()
            rows.append([simulation.get_real("stage::" + name) for name in outputs])
        simulation.terminate()
print(json.dumps(rows))
"""


@pytest.mark.needs("ecospy")
def test_ecos_gives_the_numbers_of_fmpy(native, unpacked):
    setting = json.dumps([str(native), STEPS, H, HELD, NAMES])
    done = subprocess.run([sys.executable, "-c", ECOS, setting], capture_output=True, text=True)
    if "libtbb" in done.stderr:
        pytest.skip("needs the library libtbb: apt-get install libtbb12")
    assert done.returncode == 0, done.stderr[-2000:]
    expected = held_run(unpacked)
    rows = np.array(json.loads(done.stdout.splitlines()[-1]))
    assert (np.abs(rows - expected) / np.abs(expected).max(axis=0)).max() <= 1e-12


@pytest.mark.needs("fmu_manipulation_toolbox")
def test_a_container_makes_an_fmi_3_unit_with_the_same_bits(tmp_path):
    """All outputs of a run under a ramp of torque."""
    model = gf.assemble("fzg_c", ports={"pinion": "torque", "wheel": "fixed"})
    gf.export(model, tmp_path / "pair.fmu", level="fast")
    (tmp_path / "pair3.csv").write_text("rule;from_fmu;from_port;to_fmu;to_port\nFMU;pair.fmu;;;\n")
    tool = [sys.executable, "-m", "fmu_manipulation_toolbox.cli.fmucontainer"]
    subprocess.run([*tool, "-container", f"pair3.csv:{H}", "-fmi", "3"], cwd=tmp_path, check=True, capture_output=True)
    three = read_model_description(tmp_path / "pair3.fmu")
    names = sorted(v.name for v in three.modelVariables if v.causality == "output")
    assert three.fmiVersion == "3.0" and {"mesh.force", "mesh.te", "bearing.wheel.fx"} <= set(names)
    time = np.arange(101) * H
    torque = np.array(list(zip(time, 3e4 * time, strict=True)), dtype=[("time", float), ("pinion.tau", float)])
    two, container = (
        simulate_fmu(str(tmp_path / f), stop_time=100 * H, step_size=H, output_interval=H, input=torque, output=names)
        for f in ("pair.fmu", "pair3.fmu")
    )
    assert two["mesh.force"][-1] > 1000 and two.tobytes() == container.tobytes()


def omsimulator_script(fmu: Path, inputs: Path, out: Path) -> Path:
    """A Lua script: the pair in a weakly coupled system, its inputs from a table beside it."""
    script = out.with_suffix(".lua")
    wires = "".join(f'oms_addConnection("m.root.t.{n}", "m.root.stage.{n}")\n' for n in inputs_at(0))
    script.write_text(
        f'oms_setTempDirectory("{out.parent}")\noms_newModel("m")\noms_addSystem("m.root", oms_system_wc)\n'
        f'oms_addSubModel("m.root.stage", "{fmu}")\noms_addSubModel("m.root.t", "{inputs}")\n{wires}'
        f'oms_setResultFile("m", "{out}")\noms_setStopTime("m", {STEPS * H})\n'
        f'oms_setFixedStepSize("m.root", {H})\noms_instantiate("m")\noms_initialize("m")\noms_simulate("m")\n'
        'oms_terminate("m")\noms_delete("m")\n',
        encoding="utf-8",
    )
    return script


PROGRAMS = {  # environment variable, words of the command, where to get the program
    "fmpy": (
        "",
        "-m fmpy simulate {fmu} --stop-time {stop} --step-size {h} --output-interval {h} --input-file {inputs} "
        "--output-file {out}",
        "",
    ),
    "fmusim": (
        "FMUSIM",
        "--interface-type cs --stop-time {stop} --output-interval {h} --input-file {inputs} --output-file {out} "
        + "".join(f"--output-variable {name} " for name in NAMES)
        + "{fmu}",
        "a release of github.com/modelica/Reference-FMUs has it",
    ),
    "fmuCheck": (
        "FMUCHECK",
        "-k cs -h {h} -s {stop} -n 0 -i {inputs} -o {out} {fmu}",
        "github.com/modelica-tools/FMUComplianceChecker has it",
    ),
    "OMSimulator": ("OMSIMULATOR", "{script}", "openmodelica.org has it"),
}


@pytest.mark.full
@pytest.mark.parametrize("name", PROGRAMS)
def test_programs_give_the_numbers_of_fmpy(name, native, unpacked, tmp_path):
    """Inputs from a table, outputs as a table: within 1e-9 of the largest value of each output."""
    variable, words, source = PROGRAMS[name]
    program = sys.executable if name == "fmpy" else os.environ.get(variable) or shutil.which(name)
    if program is None:
        pytest.skip(f"needs the program {name} on PATH, or its path in {variable}: {source}")
    inputs, out = tmp_path / "inputs.csv", tmp_path / "out.csv"
    with inputs.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *inputs_at(0)])
        writer.writerows([k * H, *inputs_at(k).values()] for k in range(STEPS + 1))
    script = omsimulator_script(native, inputs, out)
    values = {"fmu": native, "inputs": inputs, "out": out, "script": script, "h": H, "stop": STEPS * H}
    command = [program, *(word.format(**values) for word in words.split())]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    table = np.genfromtxt(out, delimiter=",", names=True, deletechars="", dtype=float)
    columns = [next(c for c in table.dtype.names if c.strip('"').endswith(n)) for n in NAMES]
    found = np.array([np.interp(np.arange(STEPS + 1) * H, table[table.dtype.names[0]], table[c]) for c in columns]).T
    expected = fmu_run(unpacked, NAMES)
    assert np.ptp(expected[:, 0]) > 100, "the run loads the teeth"
    assert (np.abs(found[1:] - expected) / np.abs(expected).max(axis=0)).max() <= 1e-9
