"""The GUID of an FMU says what its model was made of: stage, files, bodies, ports, starts; no rounding, no order."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import pytest

from gearfmu.body import load_bodies
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.expand import rewritten
from gearfmu.stagefile.stage import load_stage

MAKES = """
import sys
from gearfmu.body import load_bodies
from gearfmu.stagefile.stage import load_stage
from gearfmu.stage import assemble
spec = load_stage(sys.argv[1])
model = assemble(spec, load_bodies(spec))
print(model.hash, model.guid)
"""


def made(**changes: object) -> StageModel:
    spec = load_stage("fzg_c/stage_relief")
    return assemble(rewritten(spec, **changes), load_bodies(spec))


@pytest.mark.parametrize("stage", ["fzg_c", pytest.param("helical_demo", marks=pytest.mark.full)])
def test_other_rounding_leaves_the_guid(stage: str) -> None:
    """Two sets of routines of one linear algebra stand for two versions of numpy: the numbers differ, the GUID does
    not. Where a processor knows one of them only, the hashes agree as well and the test says nothing."""
    spec = load_stage(stage)
    here = assemble(spec, load_bodies(spec))
    environment = os.environ | {"OPENBLAS_CORETYPE": "Prescott"}
    command = [sys.executable, "-c", MAKES, stage]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    hash_there, guid_there = done.stdout.split()
    assert guid_there == here.guid
    if hash_there == here.hash:
        pytest.skip("this linear algebra has one set of routines here")


def test_what_a_model_is_made_of_changes_the_guid() -> None:
    spec = load_stage("fzg_c/stage_relief")
    base = made()
    ports = {name: port.model_copy(update={"k": 1e5}) for name, port in spec.ports.items()}
    others = [
        made(),
        made(torque_max=math.nextafter(spec.written.torque_max, math.inf)),
        made(name="another"),
        made(ports=ports),
        base.with_starts({"level": 1.0}),
        assemble(spec, load_bodies(spec), observe=["pinion"]),
    ]
    guids = [model.guid for model in (base, *others)]
    assert guids[0] == guids[1] != base.hash and len(set(guids)) == len(guids) - 1


def test_the_way_to_a_model_leaves_the_guid() -> None:
    """Torque ports turned into springs are springs of the file; a start that is set twice is set once."""
    spec = load_stage("fzg_c/stage_relief")
    torques = {name: port.model_copy(update={"kind": "torque"}) for name, port in spec.ports.items()}
    springs = {name: port.model_copy(update={"kind": "spring"}) for name, port in spec.ports.items()}
    assert made(ports=torques).driven_by_springs().guid == made(ports=springs).guid != made(ports=torques).guid
    fast = made().with_starts({"level": 1.0})
    assert fast.with_starts({"level": 1.0}).guid == fast.guid
