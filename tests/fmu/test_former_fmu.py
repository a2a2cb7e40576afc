"""What gearfmu 0.2.0 exported is of use today. `former/` holds an FMU of `fzg_c` on coarse bodies, and those bodies.

They were made at commit 6fc3bb45 by `export` of the stage with both gears on 3 flank, 1 tooth, 2 root, 1 rim and 2
width elements, 31 modes, 5 rolls and 3 width functions.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

from gearfmu.body import load_bodies
from gearfmu.errors import FmuError
from gearfmu.fmu import export
from gearfmu.fmu.opened import read_fmu
from gearfmu.fmu.stage_file import STAGE_FILE, read_stage_file
from gearfmu.stage import assemble
from gearfmu.stagefile.stored import expected_hash, restored

FORMER = Path(__file__).with_name("former")
FMU = FORMER / "pair.fmu"
TWIST = 0.02  # rad, of the pinion's outer end while the wheel's is held
PORTS = ("pinion.tau", "wheel.tau")

needs_linux = pytest.mark.skipif(fmpy.platform != "linux64", reason="the former FMU has a binary for linux64 alone")


def torques(fmu: Path) -> dict[str, float]:
    """Mean torques (N·m) of the twisted pair over 4 ms."""
    inputs = np.array([(0.0, TWIST, 0.0)], dtype=[("time", float), ("pinion.phi", float), ("wheel.phi", float)])
    found = fmpy.simulate_fmu(
        str(fmu), stop_time=4e-3, step_size=2e-5, output_interval=2e-5, start_values={"pinion.phi": TWIST},
        input=inputs, output=PORTS,
    )  # fmt: skip
    return {port: float(found[port].mean()) for port in PORTS}


@needs_linux
def test_a_former_fmu_runs_and_its_stage_and_bodies_give_todays(tmp_path: Path) -> None:
    """Under FMPy, without gearfmu. Stage and bodies are taken over, and the FMU made of them carries the same torques:
    within 2 % (.5 % found), since a former FMU does not start at rest."""
    with zipfile.ZipFile(FMU) as archive:
        facts = read_stage_file(archive.read(STAGE_FILE), str(FMU))
    stage = restored(facts["stage"], FMU)
    bodies = load_bodies(stage, FORMER)
    assert [body.how.hash for body in bodies] == [expected_hash(stage, name) for name in stage.files]
    today = torques(export(assemble(stage, bodies), tmp_path / "today.fmu"))
    assert today["wheel.tau"] == pytest.approx(1.5 * today["pinion.tau"], rel=0.03)
    assert torques(FMU) == pytest.approx(today, rel=0.02)


def test_a_former_fmu_in_a_scene_is_refused_with_the_way_out() -> None:
    """Its model is of another version."""
    with pytest.raises(FmuError, match="export it again"):
        read_fmu(FMU)
