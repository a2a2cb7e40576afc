"""Shipped stages, assembled once."""

from __future__ import annotations

import pytest

import gearfmu as gf
from evidence.energy.free import FreePair, free_pair
from gearfmu.body import Body, load_bodies
from gearfmu.geometry import PairGeometry
from gearfmu.stage import StageModel, assemble
from gearfmu.stagefile.forms.general import Stage
from gearfmu.stagefile.stage import load_stage


@pytest.fixture(scope="session")
def spec() -> Stage:
    return load_stage("fzg_c")


@pytest.fixture(scope="session")
def relief_spec() -> Stage:
    return load_stage("fzg_c/stage_relief")


@pytest.fixture(scope="session")
def bodies(spec: Stage) -> list[Body]:
    return load_bodies(spec)


@pytest.fixture(scope="session")
def pair(spec: Stage) -> PairGeometry:
    return spec.written.geometry


@pytest.fixture(scope="session")
def plain(spec: Stage, bodies: list[Body]) -> StageModel:
    """No profile modification."""
    return assemble(spec, bodies)


@pytest.fixture(scope="session")
def pair_free(spec: Stage, bodies: list[Body]) -> FreePair:
    """Torque ports on both shafts, no profile modification."""
    return free_pair(spec, bodies)


@pytest.fixture(scope="session")
def relieved_free(relief_spec: Stage, bodies: list[Body]) -> FreePair:
    """Torque ports on both shafts, tip relief on both gears."""
    return free_pair(relief_spec, bodies)


@pytest.fixture(scope="session")
def helical() -> StageModel:
    return gf.assemble("helical_demo")


@pytest.fixture(scope="session")
def planetary() -> StageModel:
    return gf.assemble("planetary54")


@pytest.fixture(scope="session")
def two_stage() -> StageModel:
    return gf.assemble("two_stage")


@pytest.fixture(scope="session")
def relieved(relief_spec: Stage, bodies: list[Body]) -> StageModel:
    """Tip relief on both gears."""
    return assemble(relief_spec, bodies)
